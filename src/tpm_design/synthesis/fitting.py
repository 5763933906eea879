"""A grown body moved and resized until it is locally the largest.

What must hold at every pose of the body is asked at its contacts alone, where it is nearest to the bounds;
the contacts of the body that results are added, and so on until none is beyond a bound (an exchange method,
R. Hettich, K. O. Kortanek, Semi-infinite programming, SIAM Rev. 35, 1993). Each program is solved by
sequential quadratic programming (SLSQP).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tpm_design.optimizers.polytope import largest_between
from tpm_design.synthesis.body_forms import BodyForm
from tpm_design.synthesis.contacts import Contacts, contacts, contacts_at
from tpm_design.synthesis.fold_planes import fold_plane
from tpm_design.synthesis.growth import Grown

FloatArray = NDArray[np.float64]

MOST_EXCHANGES = 30
# of the size: by how much one program may move or resize the body
STRIDE = 0.25
# of the size: contacts that are so little beyond a bound, and changes so small, end the exchange
CLOSE = 1e-9
# of the half sizes, from a contact to where other bounds that meet there are looked for: far enough to give
# them contacts of their own, and so near that their planes touch the body
ASIDE, CLOSE_BY = 2e-3, 1e-5


def fitted(form: BodyForm, start: Grown) -> Grown:
    """The body at a local optimum, up to ``CLOSE`` within the free set."""
    body = start
    known: Contacts | None = None
    for _ in range(MOST_EXCHANGES):
        fresh = contacts(form, body.free, body.centre, body.sizes, aside=ASIDE)
        if known is not None:
            again = contacts_at(form, body.free, body.centre, body.sizes, known.unit, known.bound)
            fresh = fresh.joined(again).distinct()
        known = fresh
        following = _solved(form, body, known)
        size = float(form.half(body.sizes).max())
        moved = np.abs(np.append(following.centre - body.centre, following.sizes - body.sizes)).max()
        body = following
        if moved <= CLOSE * size and float(known.distance.min(initial=0.0)) >= -CLOSE * size:
            break
    return body


@dataclass(frozen=True, eq=False)
class _Program:
    """One program in x = (centre, sizes) / length."""

    form: BodyForm
    body: Grown
    contacts: Contacts

    @property
    def length(self) -> float:
        return self.body.free.length

    def body_at(self, x: FloatArray) -> Grown:
        return replace(self.body, centre=self.length * x[:3], sizes=self.length * x[3:])

    def cost(self, x: FloatArray) -> float:
        return -float(np.log(self.form.half(x[3:])).sum())

    def cost_slope(self, x: FloatArray) -> FloatArray:
        return np.append(np.zeros(3), -(1.0 / self.form.half(x[3:])) @ self.form.spread)

    def room(self, x: FloatArray) -> FloatArray:
        """≥ 0 at all contacts and folds, shares of the length."""
        body = self.body_at(x)
        pick = np.arange(len(self.contacts.bound))
        values = body.free.margins(self._poses(body))[self.contacts.bound, pick] / self.contacts.steepness
        folds = [fold_plane(self.form, body.centre, body.sizes, line).room for line in body.free.lines]
        return np.append(values, folds) / self.length

    def room_slope(self, x: FloatArray) -> FloatArray:
        body = self.body_at(x)
        pick = np.arange(len(self.contacts.bound))
        _, slopes = body.free.slopes(self._poses(body))
        normals = slopes[self.contacts.bound, pick] / self.contacts.steepness[:, None]
        # on a kink the slope beside it, from where the program started
        normals = np.where(np.isfinite(normals), normals, -self.contacts.normal)
        rows = [np.hstack([normals, (normals * self.contacts.unit) @ self.form.spread])]
        for line in body.free.lines:
            normal = fold_plane(self.form, body.centre, body.sizes, line).normal
            rows.append(np.append(-normal, -self._extent_slope(normal, body))[None])
        return np.vstack(rows)

    def _poses(self, body: Grown) -> FloatArray:
        return body.centre + self.form.half(body.sizes) * self.contacts.unit

    def _extent_slope(self, normal: FloatArray, body: Grown) -> FloatArray:
        """Of the body's extent along a normal, by its sizes. Extents are homogeneous and exact differences
        of them smooth enough."""
        step = 1e-6 * float(body.sizes.max())
        count = body.sizes.size
        up = [self.form.extents(normal[None], body.sizes + step * unit)[0] for unit in np.eye(count)]
        down = [self.form.extents(normal[None], body.sizes - step * unit)[0] for unit in np.eye(count)]
        return (np.array(up) - np.array(down)) / (2.0 * step)


def _solved(form: BodyForm, body: Grown, known: Contacts) -> Grown:
    from scipy.optimize import minimize

    program = _Program(form, body, known)
    x = np.append(body.centre, body.sizes) / program.length
    half = form.half(x[3:])
    move = STRIDE * float(half.max())
    bounds = [(value - move, value + move) for value in x[:3]]
    bounds += [(value * (1.0 - STRIDE), value * (1.0 + STRIDE)) for value in x[3:]]
    rules: Any = {"type": "ineq", "fun": program.room, "jac": program.room_slope}
    found: Any = minimize(
        program.cost,
        x,
        jac=program.cost_slope,
        bounds=bounds,
        constraints=[rules],
        method="SLSQP",
        options={"maxiter": 60, "ftol": 1e-14},
    )
    return program.body_at(np.asarray(found.x)) if np.isfinite(found.x).all() else body


def upper_volume(form: BodyForm, body: Grown) -> float | None:
    """The volume (m³) of the largest body between the planes that touch the free set at this one's contacts:
    its own at a local optimum. None where they do not bound it."""
    near = contacts(form, body.free, body.centre, body.sizes, aside=CLOSE_BY)
    near = near.chosen(near.distance <= 4.0 * CLOSE_BY * float(form.half(body.sizes).max()))
    folds = [fold_plane(form, body.centre, body.sizes, line) for line in body.free.lines]
    half = form.half(body.sizes)
    # room of each contact's plane about the body's centre
    rooms = near.distance + np.einsum("kj,kj->k", near.normal, half * near.unit)
    normals = np.vstack([near.normal, *(fold.normal[None] for fold in folds)])
    offsets = np.append(rooms, [fold.offset - fold.normal @ body.centre for fold in folds])
    found = largest_between(form.unit, form.spread, normals, offsets / body.free.length, 2.0)
    if found is None or np.any(found.sizes > 1.99):
        return None
    return form.volume(body.free.length * found.sizes)
