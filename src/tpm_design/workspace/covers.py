"""Proofs over a region by branch and bound: a cover of boxes, on each of which a statement is proved.

On a box an inequality g > 0 is proved by interval arithmetic alone or, where that is too wide, by the mean
value theorem: g ≥ g(c) − Σ |g'_j| h_j with derivatives enclosed over the box, and with c at the worst end of
every variable in which g is monotone. The parameters of the limbs are variables like the pose's coordinates,
so that manufacturing tolerances enter with their true effect.

A cover is a box and a text, in preorder: "x", "y", "z" a bisection across that axis, the lower half first;
"p" proved, "o" outside the domain, "n" nowhere within reach.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import Interval, formula, inner, kernel, variables
from tpm_design.arithmetic.interval import up
from tpm_design.arithmetic.lifting import lifted, roomy_variables, seeded
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace import statements
from tpm_design.workspace.region_geometry import POINTS, PlacedRegion
from tpm_design.workspace.separation import proved_apart

# isort: split
from numba.cpython.unsafe.tuple import tuple_setitem

PROVED, OUTSIDE, NOWHERE, OPEN = 0, 1, 2, 3
ENDED_PROVED, ENDED_SMALL, ENDED_LIMIT = 0, 1, 2
LETTERS = np.frombuffer(b"ponxyz", dtype=np.uint8)
AXIS_LETTER = 3
STACK = 256
# boxes that take less than this share of the root in every direction are given up
SMALLEST_SHARE = 2.0**-26


def unreachable(statement: Any, geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> bool:
    """Whether the statement says nothing about a box of poses, since none is within reach."""
    raise NotImplementedError


@formula(unreachable, statements.Reach)
@formula(unreachable, statements.Determinant)
@formula(unreachable, statements.Serial)
@formula(unreachable, statements.Frobenius)
@formula(unreachable, statements.Condition)
@formula(unreachable, statements.Slowest)
@formula(unreachable, statements.Fastest)
@formula(unreachable, statements.Transmission)
@formula(unreachable, statements.Sensitivity)
def _of_the_whole_domain(statement, geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    return False


@formula(unreachable, statements.Regular)
def _of_poses_within_reach(statement, geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    out = False
    for margin in equations.leg_margins(geometry, mode, x, y, z):
        out = out or margin.hi < 0.0
    for margin in equations.mode_margins(geometry, mode, x, y, z):
        out = out or margin.hi < 0.0
    return out


@inner
def _slope_bound(slope, half):  # type: ignore[no-untyped-def]
    """Bound of |slope| · half."""
    if half == 0.0:
        return 0.0
    return (Interval(max(-slope.lo, slope.hi), max(-slope.lo, slope.hi)) * half).hi


@inner
def _worst_end(slope, lo, hi):  # type: ignore[no-untyped-def]
    """Where a function with this slope is least, and the half width left to its mean-value bound."""
    if slope.lo >= 0.0:
        return lo, 0.0
    if slope.hi <= 0.0:
        return hi, 0.0
    middle = min(hi, max(lo, 0.5 * (lo + hi)))
    return middle, up(max(hi - middle, middle - lo))


class Exact(NamedTuple):
    """One machine."""

    factor: float = 0.0


class Toleranced(NamedTuple):
    """Every machine of the geometry's intervals."""

    factor: float = 1.0


def slopes(
    tolerances: Any, statement: Any, geometry: Any, mode: Any, guide: Any, x: Any, y: Any, z: Any
) -> Any:
    """Slacks as Duals over the pose, and over each limb's parameters where these have tolerances."""
    raise NotImplementedError


def worst_machine(tolerances: Any, geometry: Any, limb_slopes: Any, number: Any) -> Any:
    """The machine where slack ``number`` is least, as far as slopes tell, and what the others may take."""
    raise NotImplementedError


@formula(slopes, Exact)
def _slopes_of_one_machine(tolerances, statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    return statements.slacks(statement, geometry, mode, guide, *variables((x, y, z))), 0.0


@formula(slopes, Toleranced)
def _slopes_of_machines(tolerances, statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    limb_slopes = (
        _limb_slopes(statement, geometry, mode, guide, 0, x, y, z),
        _limb_slopes(statement, geometry, mode, guide, 1, x, y, z),
        _limb_slopes(statement, geometry, mode, guide, 2, x, y, z),
    )
    return _pose_slopes(statement, geometry, mode, guide, x, y, z), limb_slopes


@formula(worst_machine, Exact)
def _the_machine(tolerances, geometry, limb_slopes, number):  # type: ignore[no-untyped-def]
    return geometry, 0.0


@formula(worst_machine, Toleranced)
def _the_worst_machine(tolerances, geometry, limb_slopes, number):  # type: ignore[no-untyped-def]
    machine, first = _at_worst_machine(geometry, 0, limb_slopes, number)
    machine, second = _at_worst_machine(machine, 1, limb_slopes, number)
    machine, third = _at_worst_machine(machine, 2, limb_slopes, number)
    return machine, (Interval(first, first) + second + third).hi


@inner
def _limb_slopes(statement, geometry, mode, guide, limb, x, y, z):  # type: ignore[no-untyped-def]
    """Derivatives of the slacks by one limb's parameters."""
    values = roomy_variables(equations.limb_parameters(geometry, limb))
    moved = equations.with_limb_parameters(geometry, limb, values)
    like = values[0]
    return statements.slacks(statement, moved, mode, guide, lifted(x, like), lifted(y, like), lifted(z, like))


@inner
def _pose_slopes(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    """Derivatives of the slacks by the pose, in the type that ``_limb_slopes`` has: compiled once."""
    values = roomy_variables(equations.limb_parameters(geometry, 0))
    like = values[0]
    constants = values
    for q in range(len(values)):
        constants = tuple_setitem(constants, q, lifted(values[q].value, like))
    still = equations.with_limb_parameters(geometry, 0, constants)
    return statements.slacks(statement, still, mode, guide, *seeded((x, y, z), like))


@inner
def _at_worst_machine(geometry, limb, slopes, number):  # type: ignore[no-untyped-def]
    """The geometry with one limb's parameters where a slack is least, as far as its slopes tell, and what
    the others may still take from it."""
    values = equations.limb_parameters(geometry, limb)
    ends = values
    left = 0.0
    for q in range(len(values)):
        slope = slopes[limb][number].derivatives[q]
        end, half = _worst_end(slope, values[q].lo, values[q].hi)
        ends = tuple_setitem(ends, q, Interval(end, end))
        left = (Interval(left, left) + _slope_bound(slope, half)).hi
    return equations.with_limb_parameters(geometry, limb, ends), left


@inner
def _bound_at_worst(statement, geometry, mode, tolerances, guide, box, pose_slopes, limb_slopes, number):  # type: ignore[no-untyped-def]
    """Lower bound of slack ``number`` over the box and all machines, by the mean value theorem."""
    x0, hx = _worst_end(pose_slopes[number].derivatives[0], box[0, 0], box[0, 1])
    y0, hy = _worst_end(pose_slopes[number].derivatives[1], box[1, 0], box[1, 1])
    z0, hz = _worst_end(pose_slopes[number].derivatives[2], box[2, 0], box[2, 1])
    taken = Interval(0.0, 0.0) + _slope_bound(pose_slopes[number].derivatives[0], hx)
    taken = taken + _slope_bound(pose_slopes[number].derivatives[1], hy)
    taken = taken + _slope_bound(pose_slopes[number].derivatives[2], hz)
    machine, left = worst_machine(tolerances, geometry, limb_slopes, number)
    values = statements.slacks(
        statement, machine, mode, guide, Interval(x0, x0), Interval(y0, y0), Interval(z0, z0)
    )
    return (values[number] - (taken + left)).lo


@inner
def _examine(statement, geometry, nominal, mode, tolerances, box, known):  # type: ignore[no-untyped-def]
    """Verdict on a box, the bits of the slacks proved on it (``known`` ones are not looked at again), and
    the axis to bisect."""
    x, y, z = Interval(box[0, 0], box[0, 1]), Interval(box[1, 0], box[1, 1]), Interval(box[2, 0], box[2, 1])
    half = (0.5 * (x.hi - x.lo), 0.5 * (y.hi - y.lo), 0.5 * (z.hi - z.lo))
    centre = (x.lo + half[0], y.lo + half[1], z.lo + half[2])
    guide = statements.guide(statement, nominal, mode, centre, half)
    natural = statements.slacks(statement, geometry, mode, guide, x, y, z)
    pending = 0
    for number in range(len(natural)):
        if natural[number].lo > 0.0:
            known |= 1 << number
        if not known & (1 << number):
            pending += 1
    if pending == 0:
        return PROVED, known, 0
    if unreachable(statement, geometry, mode, x, y, z):
        return NOWHERE, known, 0
    pose_slopes, limb_slopes = slopes(tolerances, statement, geometry, mode, guide, x, y, z)
    weights = (0.0, 0.0, 0.0)
    for number in range(len(natural)):
        if known & (1 << number):
            continue
        bound = _bound_at_worst(
            statement, geometry, mode, tolerances, guide, box, pose_slopes, limb_slopes, number
        )
        if bound > 0.0:
            known |= 1 << number
            pending -= 1
            continue
        derivatives = pose_slopes[number].derivatives
        shares = (
            _slope_bound(derivatives[0], half[0]),
            _slope_bound(derivatives[1], half[1]),
            _slope_bound(derivatives[2], half[2]),
        )
        total = shares[0] + shares[1] + shares[2]
        if 0.0 < total < math.inf:
            weights = (
                weights[0] + shares[0] / total,
                weights[1] + shares[1] / total,
                weights[2] + shares[2] / total,
            )
    if pending == 0:
        return PROVED, known, 0
    return OPEN, known, _axis_of_greatest(weights, half)


@inner
def _axis_of_greatest(weights, half):  # type: ignore[no-untyped-def]
    """The axis that matters most to the slacks; the widest where they do not tell."""
    a, b, c = weights if max(weights[0], weights[1], weights[2]) > 0.0 else half
    if a >= b and a >= c:
        return 0
    return 1 if b >= c else 2


@inner
def _share(box, root):  # type: ignore[no-untyped-def]
    """Greatest share of the root that the box takes in one direction."""
    greatest = 0.0
    for k in range(3):
        width = root[k, 1] - root[k, 0]
        if width > 0.0:
            greatest = max(greatest, (box[k, 1] - box[k, 0]) / width)
    return greatest


@kernel
def _cover(statement, geometry, nominal, mode, tolerances, region, distance, root, used, letters, culprit):  # type: ignore[no-untyped-def]
    """Write the tree of a cover of ``root`` (3, 2) into ``letters``; how it ended and its length.

    ``culprit`` (3, 2): the box that was given up. ``used``: letters that are already there.
    """
    stack = np.empty((STACK, 3, 2))
    bits = np.zeros(STACK, dtype=np.int64)
    box = np.empty((3, 2))
    stack[0] = root
    depth = 1
    while depth > 0:
        depth -= 1
        box[:] = stack[depth]
        known = bits[depth]
        if used >= letters.size:
            culprit[:] = box
            return ENDED_LIMIT, used
        if region.form != POINTS and proved_apart(region, distance, box):
            letters[used] = LETTERS[OUTSIDE]
            used += 1
            continue
        verdict, known, axis = _examine(statement, geometry, nominal, mode, tolerances, box, known)
        if verdict != OPEN:
            letters[used] = LETTERS[verdict]
            used += 1
            continue
        lo, hi = box[axis, 0], box[axis, 1]
        middle = 0.5 * (lo + hi)
        if _share(box, root) <= SMALLEST_SHARE or depth + 2 > STACK or not lo < middle < hi:
            culprit[:] = box
            return ENDED_SMALL, used
        letters[used] = LETTERS[AXIS_LETTER + axis]
        used += 1
        if not statements.inherited(statement):
            known = 0
        stack[depth] = box
        stack[depth, axis, 0] = middle
        bits[depth] = known
        stack[depth + 1] = box
        stack[depth + 1, axis, 1] = middle
        bits[depth + 1] = known
        depth += 2
    return ENDED_PROVED, used


@dataclass(frozen=True)
class Cover:
    """A box (3, 2) in metres and the tree of its bisections."""

    root: tuple[tuple[float, float], ...]
    tree: str


@dataclass(frozen=True)
class Proof:
    """How far a proof came. ``covers`` are complete if it is ``proved``; else ``open_box`` (3, 2) is a box on
    which the statement was not proved. ``ending`` "small": that box is as small as is tried; "limit": no
    boxes were left. ``boxes``: how many were looked at."""

    ending: Literal["proved", "small", "limit"]
    covers: tuple[Cover, ...]
    boxes: int
    open_box: NDArray[np.float64] | None

    @property
    def proved(self) -> bool:
        return self.ending == "proved"


def prove(
    statement: Any,
    mechanism: Mechanism,
    mode: Mode,
    region: PlacedRegion,
    *,
    tolerance: Mapping[str, float],
    distance: float,
    boxes: int,
) -> Proof:
    """Prove ``statement`` at every pose within ``distance`` (m) of the region and for every machine within
    ``tolerance`` (name → ±, SI, each limb by itself), looking at no more than ``boxes`` boxes."""
    geometry = mechanism.enclosed_geometry(tolerance)
    tolerances = Toleranced() if any(bound > 0.0 for bound in tolerance.values()) else Exact()
    letters = np.empty(boxes, dtype=np.uint8)
    culprit = np.empty((3, 2))
    covers: list[Cover] = []
    used = 0
    for root in roots(region, distance):
        before = used
        ended, used = _cover(
            statement, geometry, mechanism.geometry, mode.signs, tolerances, region, distance, root, used,
            letters, culprit,
        )  # fmt: skip
        if ended != ENDED_PROVED:
            return Proof("small" if ended == ENDED_SMALL else "limit", (), used, culprit)
        sides = [(float(lo), float(hi)) for lo, hi in root]
        covers.append(Cover(tuple(sides), letters[before:used].tobytes().decode("ascii")))
    return Proof("proved", tuple(covers), used, None)


def roots(region: PlacedRegion, distance: float) -> list[NDArray[np.float64]]:
    """Boxes (3, 2) that together hold every pose within ``distance`` (m) of the region."""
    around = Interval(-distance, distance)
    if region.form == POINTS:
        sides = [[float(value) + around for value in point] for point in region.points]
    else:
        pairs = zip(region.centre, region.half, strict=True)
        sides = [[centre + Interval(-half, half) + around for centre, half in pairs]]
    if distance == 0.0 and region.form == POINTS:
        return [np.column_stack([point, point]) for point in region.points]
    return [np.array([(side.lo, side.hi) for side in box]) for box in sides]
