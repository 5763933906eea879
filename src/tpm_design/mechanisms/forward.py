"""Forward position by branch and prune: every pose in given boxes where a mechanism's limbs close.

A box of poses is dropped when an interval bound of a residual keeps away from 0, narrowed by the interval
Newton step in its Hansen–Sengupta form, and halved where that no longer helps. A step that maps a box into
its own interior proves that the box holds exactly one assembly. Nothing is sampled, so that no assembly is
missed.

A. Neumaier, Interval Methods for Systems of Equations, Cambridge 1990, sections 5.1–5.2;
J.-P. Merlet, Solving the Forward Kinematics of a Gough-Type Parallel Manipulator with Interval Analysis,
Int. J. Robotics Research 23(3), 2004.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import Interval, inner, kernel, variables
from tpm_design.arithmetic.rounding import check_rounding
from tpm_design.errors import ParameterError
from tpm_design.mechanisms import equations, pointwise
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.mechanism import FloatArray, Mechanism
from tpm_design.mechanisms.velocity import adjugate_columns

# boxes that take less than this share of their chart are kept as cells that may hold a singular assembly
CELL = 1e-7
# relative widening of a box before the Newton step, so that an assembly on a shared face is proved as well
OVERLAP = 0.02
BOX_LIMIT = 300_000
CANDIDATE_LIMIT = 5_000
# each halving adds one box to the stack, and none is halved below CELL
STACK = 128
# candidates nearer to each other than this share of the reach are one assembly …
SAME = 1e-9
# … and different assemblies nearer than this are a singular cluster
APART = 1e-6
# relative, from 1 rad up: the inverse map loses half its digits where a limb is stretched
AGREEMENT = 1e-6

Chart = tuple[float, ...]


@inner
def _middle(interval):  # type: ignore[no-untyped-def]
    return 0.5 * (interval.lo + interval.hi)


@inner
def _enclosures(geometry, motor, q, chart, box):  # type: ignore[no-untyped-def]
    """Bounds over ``box`` (3, 2) of the residuals, rows of bounds of their derivatives, and whether the box
    may hold an assembly for all that these bounds tell."""
    u, v, w = variables(
        (Interval(box[0, 0], box[0, 1]), Interval(box[1, 0], box[1, 1]), Interval(box[2, 0], box[2, 1]))
    )
    (a, b, c), excesses = equations.closure(geometry, motor, q, chart, u, v, w)
    possible = True
    for residual in (a, b, c):
        possible = possible and residual.value.lo <= 0.0 <= residual.value.hi
    for excess in excesses:
        possible = possible and excess.value.lo <= AGREEMENT
    return (a.value, b.value, c.value), (a.derivatives, b.derivatives, c.derivatives), possible


@inner
def _inverse_of_middle(rows):  # type: ignore[no-untyped-def]
    """Inverse of the matrix of midpoints, by rows; not finite where that has no inverse."""
    a, b, c = rows
    middle = (
        (_middle(a[0]), _middle(a[1]), _middle(a[2])),
        (_middle(b[0]), _middle(b[1]), _middle(b[2])),
        (_middle(c[0]), _middle(c[1]), _middle(c[2])),
    )
    (u, v, w), determinant = adjugate_columns(middle)
    return (
        (u[0] / determinant, v[0] / determinant, w[0] / determinant),
        (u[1] / determinant, v[1] / determinant, w[1] / determinant),
        (u[2] / determinant, v[2] / determinant, w[2] / determinant),
    )


@inner
def _newton_bound(k, inverse, rows, values, centre, box):  # type: ignore[no-untyped-def]
    """Bounds of coordinate ``k`` of every zero in the box, from the ``k``-th preconditioned equation."""
    weights = inverse[k]
    total = weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2]
    pivot = Interval(1.0, 1.0)
    for j in range(3):
        slope = weights[0] * rows[0][j] + weights[1] * rows[1][j] + weights[2] * rows[2][j]
        if j == k:
            pivot = slope
        else:
            total = total + slope * Interval(box[j, 0] - centre[j, 0], box[j, 1] - centre[j, 0])
    return centre[k, 0] - total / pivot


@inner
def _newton_step(geometry, motor, q, chart, box, limits, wide, centre):  # type: ignore[no-untyped-def]
    """Narrow ``box`` (3, 2) in place. −1: it holds no zero; 1: ``wide`` holds just one; else 0."""
    for k in range(3):
        slack = OVERLAP * (box[k, 1] - box[k, 0])
        wide[k, 0] = max(limits[k, 0], box[k, 0] - slack)
        wide[k, 1] = min(limits[k, 1], box[k, 1] + slack)
        centre[k, 0] = 0.5 * (wide[k, 0] + wide[k, 1])
        centre[k, 1] = centre[k, 0]
    values, rows, possible = _enclosures(geometry, motor, q, chart, wide)
    if not possible:
        return -1
    inverse = _inverse_of_middle(rows)
    for row in inverse:
        if not math.isfinite(row[0] + row[1] + row[2]):
            return 0
    values, _, _ = _enclosures(geometry, motor, q, chart, centre)
    inside = 0
    for k in range(3):
        bound = _newton_bound(k, inverse, rows, values, centre, wide)
        if bound.lo > wide[k, 0] and bound.hi < wide[k, 1]:
            inside += 1
        wide[k, 0] = max(wide[k, 0], bound.lo)
        wide[k, 1] = min(wide[k, 1], bound.hi)
        if wide[k, 0] > wide[k, 1]:
            return -1
    if inside == 3:
        return 1
    for k in range(3):
        box[k, 0] = max(box[k, 0], wide[k, 0])
        box[k, 1] = min(box[k, 1], wide[k, 1])
        if box[k, 0] > box[k, 1]:
            return -1
    return 0


@kernel
def _polish(geometry, motor, q, chart, points):  # type: ignore[no-untyped-def]
    """Newton's method on each of ``points`` (K, 3) in place, until the step is lost in rounding."""
    point = np.empty((3, 2))
    for n in range(points.shape[0]):
        before = math.inf
        for _ in range(60):
            for k in range(3):
                point[k, 0] = points[n, k]
                point[k, 1] = points[n, k]
            values, rows, _ = _enclosures(geometry, motor, q, chart, point)
            inverse = _inverse_of_middle(rows)
            size = 0.0
            for k in range(3):
                step = 0.0
                for j in range(3):
                    step += inverse[k][j] * _middle(values[j])
                points[n, k] -= step
                size += abs(step)
            if not math.isfinite(size) or size == 0.0 or (size < 1e-13 and size >= before):
                break
            before = size


@inner
def _total_share(box, limits):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(3):
        total += (box[k, 1] - box[k, 0]) / (limits[k, 1] - limits[k, 0])
    return total


@inner
def _widest(box, limits):  # type: ignore[no-untyped-def]
    """The coordinate in which ``box`` takes the greatest share of ``limits``, and that share."""
    widest, greatest = 0, 0.0
    for k in range(3):
        share = (box[k, 1] - box[k, 0]) / (limits[k, 1] - limits[k, 0])
        if share > greatest:
            widest, greatest = k, share
    return widest, greatest


@inner
def _copy(source, target):  # type: ignore[no-untyped-def]
    for k in range(3):
        target[k, 0] = source[k, 0]
        target[k, 1] = source[k, 1]


@kernel
def _branch_and_prune(geometry, motor, q, chart, limits, stack, found, unique, used):  # type: ignore[no-untyped-def]
    """Boxes in ``limits`` (3, 2) with just one zero (``unique``), or perhaps singular ones, into ``found``.

    Returns their number and the number of boxes looked at so far, ``used``; stops where either runs out.
    """
    box, wide, centre = np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 2))
    _copy(limits, stack[0])
    depth = 1
    count = 0
    while depth > 0 and used < BOX_LIMIT and count < found.shape[0]:
        depth -= 1
        _copy(stack[depth], box)
        used += 1
        state = 0
        narrowing = True
        while state == 0 and narrowing:
            before = _total_share(box, limits)
            state = _newton_step(geometry, motor, q, chart, box, limits, wide, centre)
            after = _total_share(box, limits)
            narrowing = CELL < after < 0.6 * before
        k, share = _widest(box, limits)
        if state == 1 or (state == 0 and share <= CELL):
            _copy(wide, found[count])
            unique[count] = state == 1
            count += 1
        elif state == 0:
            middle = 0.5 * (box[k, 0] + box[k, 1])
            _copy(box, stack[depth])
            stack[depth, k, 0] = middle
            _copy(box, stack[depth + 1])
            stack[depth + 1, k, 1] = middle
            depth += 2
    return count, used


@dataclass(frozen=True)
class Candidates:
    """Where ``equations.closure`` may vanish in one chart: coordinates (K, 3), polished, the boxes (K, 3, 2)
    they were found in, and whether each box is proved to hold just one zero (K,)."""

    chart: Chart
    coordinates: FloatArray
    boxes: FloatArray
    unique: NDArray[np.bool_]


def candidates(
    geometry: Any,
    motor: float,
    q: tuple[float, float, float],
    charts: Sequence[tuple[Chart, NDArray[np.float64]]],
) -> list[Candidates]:
    """Every zero of ``equations.closure`` in the ``charts``, each with the limits (3, 2) of its coordinates.

    Raises ParameterError where zeros do not stand apart: a curve of them, or a cluster at a singularity.
    """
    check_rounding()
    stack = np.empty((STACK, 3, 2))
    found = np.empty((CANDIDATE_LIMIT, 3, 2))
    unique = np.empty(CANDIDATE_LIMIT, dtype=np.bool_)
    used = 0
    result = []
    for chart, limits in charts:
        count, used = _branch_and_prune(geometry, motor, q, chart, limits, stack, found, unique, used)
        if used >= BOX_LIMIT or count >= CANDIDATE_LIMIT:
            raise _not_apart(q, "A singularity or a continuum of poses is there")
        boxes = found[:count].copy()
        coordinates = boxes.mean(axis=2)
        _polish(geometry, motor, q, chart, coordinates)
        result.append(Candidates(chart, coordinates, boxes, unique[:count].copy()))
    return result


def confirmed(
    mechanism: Mechanism,
    found: Sequence[Assembly],
    modes: Iterable[Any],
    q: FloatArray,
    motor: float,
    turn: float,
) -> tuple[Assembly, ...]:
    """Those of ``found``, each once, that have the actuator coordinates ``q`` (3,) in one of the ``modes``
    (their signs) by the inverse map, within the limits of legs and joints. ``turn``: differences of q by
    multiples of it count as none; 0 if there is no such period.

    Raises ParameterError where two are nearer than can be told apart.
    """
    radius = mechanism.reach_radius()
    # of two that are the same, the one that is proved to be unique
    distinct = _distinct(sorted(found, key=lambda assembly: not assembly.unique), SAME * radius)
    x, y, z = pointwise.columns(np.array([assembly.pose for assembly in distinct]))
    valid = np.zeros(x.size, dtype=np.bool_)
    actuators, legs, side = np.empty((x.size, 3)), np.empty(x.size), np.empty(x.size)
    for signs in modes:
        pointwise.actuators_row(mechanism.geometry, signs, motor, x, y, z, actuators)
        pointwise.reach_row(mechanism.geometry, signs, x, y, z, legs, side)
        difference = actuators - q
        if turn > 0.0:
            difference -= turn * np.round(difference / turn)
        agrees = (np.abs(difference) <= AGREEMENT * np.maximum(1.0, np.abs(q))).all(axis=1)
        valid |= agrees & (legs >= -SAME * radius) & (side >= -SAME * radius)
    kept = [assembly for assembly, holds in zip(distinct, valid, strict=True) if holds]
    apart = _distinct(kept, APART * radius)
    if len(apart) < len(kept):
        crowded = next(assembly for assembly in kept if assembly not in apart)
        raise _not_apart(q, f"Several may lie in the box {_box_text(mechanism, crowded)}")
    return tuple(sorted(kept, key=lambda assembly: assembly.pose))


def _distinct(found: Iterable[Assembly], apart: float) -> list[Assembly]:
    """The finite assemblies, the first of each cluster closer than ``apart``."""
    kept: list[Assembly] = []
    for assembly in found:
        pose = np.array(assembly.pose)
        if np.isfinite(pose).all() and all(np.max(np.abs(pose - other.pose)) > apart for other in kept):
            kept.append(assembly)
    return kept


def _box_text(mechanism: Mechanism, assembly: Assembly) -> str:
    box = " × ".join(f"[{low:.9g}, {high:.9g}]" for low, high in assembly.box)
    return (
        f"{box} m" if mechanism.kind.translational else f"{box} of ({', '.join(mechanism.kind.coordinates)})"
    )


def _not_apart(q: Sequence[float] | FloatArray, where: str) -> ParameterError:
    shown = ", ".join(f"{value:g}" for value in q)
    return ParameterError(
        f"The assemblies for q = ({shown}) do not stand apart. {where}.",
        remedy="Give actuator coordinates beside the singularity.",
    )
