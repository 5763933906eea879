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
from tpm_design.synthesis.contacts import Contacts, Walls, contacts, seen_from
from tpm_design.synthesis.fold_planes import fold_plane
from tpm_design.synthesis.growth import Grown

FloatArray = NDArray[np.float64]

MOST_EXCHANGES = 60
MOST_CONTACTS = 120
# of the size: by how much one program may move or resize the body at most
STRIDE = 0.25
# of a move: a body of which a larger share is beyond a bound shows that moves are too long
ASTRAY = 0.05
# of the size: moves so small end the exchange, and so do programs that gain no larger share of the volume
CLOSE, GAIN, MOST_IDLE = 1e-9, 1e-9, 6
# of the size: a contact so little beyond a bound is on it
TOUCHING = 1e-12
MOST_SHRINKINGS = 12
# lattice poses along the longest side: in each exchange, and of the finer looks at what comes of them
COARSE, FINE = 9, 25
MOST_LOOKS = 5
# of the half sizes, from a contact to where other bounds that meet there are looked for: far enough to give
# them contacts of their own, and so near that their planes touch the body
ASIDE, CLOSE_BY = 2e-3, 1e-5
# of the size: contacts on the way to an optimum that are no farther from a bound there tell its planes, too
BESIDE = 1e-4
# of the reach: larger bodies between planes are not bounded by them
LIMIT = 2.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """A body at a local optimum. ``gap``: by which share of its volume the largest body between the planes
    that touch the free set at its contacts is larger, 0 at an optimum; None where they bound no body."""

    body: Grown
    gap: float | None


def fitted(form: BodyForm, start: Grown) -> Fitted | None:
    """The body at a local optimum, all of it in the free set as far as its contacts tell; None where nothing
    of it is."""
    best = start
    known: Contacts | None = None
    for _ in range(MOST_LOOKS):
        found, known = _exchanged(form, best, known)
        if found is None:
            return None
        # a finer look may find what the contacts so far have missed
        inside, seen, share = _shrunk(form, found, known, FINE)
        if inside is None:
            return None
        best, known = inside, _nearest(form, inside, seen)
        if share >= 1.0 - CLOSE:
            break
    return Fitted(best, _gap(form, best, known))


def _exchanged(form: BodyForm, start: Grown, known: Contacts | None) -> tuple[Grown | None, Contacts]:
    """The body at a local optimum with respect to its contacts on a coarse lattice and ``known`` ones."""
    best, known, _ = _shrunk(form, start, known, COARSE)
    if best is None:
        return None, known
    stride, idle = STRIDE, 0
    for _ in range(MOST_EXCHANGES):
        size, volume = float(form.half(best.sizes).max()), form.volume(best.sizes)
        trial = _solved(form, best, known, stride)
        moved = float(np.abs(np.append(trial.centre - best.centre, trial.sizes - best.sizes)).max())
        inside, fresh, share = _shrunk(form, trial, known, COARSE)
        if moved <= CLOSE * size or stride <= CLOSE or idle >= MOST_IDLE:
            break
        gained = 0.0 if inside is None else form.volume(inside.sizes) / volume - 1.0
        idle = 0 if gained > GAIN else idle + 1
        if gained > 0.0 and moved > 0.5 * stride * size:
            stride = min(STRIDE, 2.0 * stride)
        elif gained <= 0.0 and (1.0 - share > ASTRAY * moved / size or idle > 1):
            stride = 0.5 * min(stride, moved / size)
        if inside is not None and gained > 0.0:
            best = inside
        # what any body on the way came near to must hold for every other
        known = _nearest(form, best, fresh)
    return best, known


def _nearest(form: BodyForm, body: Grown, found: Contacts) -> Contacts:
    """Contacts of other bodies seen from this one: the nearest of those that differ."""
    here = seen_from(form, body.free, body.centre, body.sizes, found).distinct()
    return here.chosen(np.argsort(here.distance, kind="stable")[:MOST_CONTACTS])


def _shrunk(
    form: BodyForm, body: Grown, known: Contacts | None, samples: int
) -> tuple[Grown | None, Contacts, float]:
    """The body shrunk about its centre until no contact, ``known`` ones included, is beyond its bound and no
    fold inside, None where that takes too much; all contacts on the way; and the share of its size that fits,
    to first order."""
    every, first = known, 1.0
    for number in range(MOST_SHRINKINGS):
        found = contacts(form, body.free, body.centre, body.sizes, aside=ASIDE, samples=samples)
        if every is not None:
            found = found.joined(seen_from(form, body.free, body.centre, body.sizes, every))
        every = found
        share = _share_inside(form, body, found)
        first = share if number == 0 else first
        if share >= 1.0:
            return body, every, first
        # to first order: a little more, so that it comes to an end
        body = replace(body, sizes=max(0.7, 1.0 - 1.1 * (1.0 - share)) * body.sizes)
    assert every is not None
    return None, every, first


def _share_inside(form: BodyForm, body: Grown, found: Contacts) -> float:
    """By which share the body must be shrunk about its centre, to first order, to be in the free set."""
    half = form.half(body.sizes)
    shares = [1.0]
    extents = np.einsum("kj,kj->k", found.normal, half * found.unit)
    short = np.flatnonzero(found.distance < -TOUCHING * float(half.max()))
    shares += [float(found.distance[k] / extents[k]) + 1.0 if extents[k] > 0.0 else 0.0 for k in short]
    planes = _planes(form, body, found)
    rooms = planes.rooms(form, body.centre, body.sizes)
    cut = rooms < -TOUCHING * float(half.max())
    shares += (1.0 + rooms[cut] / form.extents(planes.normals[cut], body.sizes)).tolist()
    return min(shares)


def _planes(form: BodyForm, body: Grown, found: Contacts) -> Walls:
    """What no part of the body may be beyond: walls, and the planes in front of folds."""
    folds = [fold_plane(form, body.centre, body.sizes, line) for line in body.free.lines]
    normals = np.array([fold.normal for fold in folds]).reshape(-1, 3)
    return found.walls.joined(Walls(normals, np.array([fold.offset for fold in folds])))


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
        planes = _planes(self.form, body, self.contacts)
        return np.append(values, planes.rooms(self.form, body.centre, body.sizes)) / self.length

    def room_slope(self, x: FloatArray) -> FloatArray:
        body = self.body_at(x)
        pick = np.arange(len(self.contacts.bound))
        _, slopes = body.free.slopes(self._poses(body))
        normals = slopes[self.contacts.bound, pick] / self.contacts.steepness[:, None]
        # on a kink the slope beside it, from where the program started
        normals = np.where(np.isfinite(normals), normals, -self.contacts.normal)
        rows = np.hstack([normals, (normals * self.contacts.unit) @ self.form.spread])
        planes = _planes(self.form, body, self.contacts).normals
        return np.vstack([rows, -np.hstack([planes, self._extent_slopes(planes, body)])])

    def _poses(self, body: Grown) -> FloatArray:
        return body.centre + self.form.half(body.sizes) * self.contacts.unit

    def _extent_slopes(self, normals: FloatArray, body: Grown) -> FloatArray:
        """Of the body's extents along normals (W, 3), by its sizes: (W, k)."""
        step = 1e-6 * float(body.sizes.max())
        columns = [
            self.form.extents(normals, body.sizes + step * unit)
            - self.form.extents(normals, body.sizes - step * unit)
            for unit in np.eye(body.sizes.size)
        ]
        return np.column_stack(columns) / (2.0 * step)


def _solved(form: BodyForm, body: Grown, known: Contacts, stride: float) -> Grown:
    from scipy.optimize import minimize

    program = _Program(form, body, known)
    x = np.append(body.centre, body.sizes) / program.length
    half = form.half(x[3:])
    move = stride * float(half.max())
    bounds = [(value - move, value + move) for value in x[:3]]
    bounds += [(value * (1.0 - stride), value * (1.0 + stride)) for value in x[3:]]
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


def _gap(form: BodyForm, body: Grown, known: Contacts | None) -> float | None:
    """``Fitted.gap`` of a body, by what is known of its surroundings and a closer look."""
    half = form.half(body.sizes)
    size = float(half.max())
    close = contacts(form, body.free, body.centre, body.sizes, aside=CLOSE_BY, samples=FINE)
    near = close.chosen(close.distance <= 4.0 * CLOSE_BY * size)
    if known is not None:
        near = near.joined(known.chosen(known.distance <= BESIDE * size))
    planes = _planes(form, body, near)
    # room of each contact's plane about the body's centre
    rooms = near.distance + np.einsum("kj,kj->k", near.normal, half * near.unit)
    normals = np.vstack([near.normal, planes.normals])
    offsets = np.append(rooms, planes.offsets - planes.normals @ body.centre)
    found = largest_between(form.unit, form.spread, normals, offsets / body.free.length, LIMIT)
    if found is None or np.any(found.sizes > 0.99 * LIMIT):
        return None
    return max(0.0, form.volume(body.free.length * found.sizes) / form.volume(body.sizes) - 1.0)
