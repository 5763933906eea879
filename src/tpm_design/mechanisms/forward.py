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
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tpm_design.arithmetic import Interval, variables
from tpm_design.errors import ParameterError
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.velocity import adjugate_columns

# narrower boxes (as a share of the widest) are kept as cells that may hold an assembly at a singularity
CELL = 1e-7
# relative widening of a box before the Newton step, so that an assembly on a shared face is proved as well
OVERLAP = 0.02
BOX_LIMIT = 400_000
CELL_LIMIT = 20_000
# assemblies nearer to each other than this share of the widest box are one
APART = 1e-9


@njit(cache=True, nogil=True, error_model="numpy")
def _middle(interval):  # type: ignore[no-untyped-def]
    return 0.5 * (interval.lo + interval.hi)


@njit(cache=True, nogil=True, error_model="numpy")
def _residuals(geometry, motor, q, x, y, z):  # type: ignore[no-untyped-def]
    return equations.closure(geometry, motor, q, x, y, z)


@njit(cache=True, nogil=True, error_model="numpy")
def _slopes(geometry, motor, q, x, y, z):  # type: ignore[no-untyped-def]
    """Rows of bounds of the residuals' derivatives over a box."""
    u, v, w = variables((x, y, z))
    first, second, third = equations.closure(geometry, motor, q, u, v, w)
    return first.derivatives, second.derivatives, third.derivatives


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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
            total = total + slope * Interval(box[j, 0] - centre[j], box[j, 1] - centre[j])
    return centre[k] - total / pivot


@njit(cache=True, nogil=True, error_model="numpy")
def _newton_step(geometry, motor, q, box, limits, wide, centre):  # type: ignore[no-untyped-def]
    """Narrow ``box`` (3, 2) in place. −1: it holds no zero; 1: a zero is proved unique near it; else 0."""
    for k in range(3):
        slack = OVERLAP * (box[k, 1] - box[k, 0])
        wide[k, 0] = max(limits[k, 0], box[k, 0] - slack)
        wide[k, 1] = min(limits[k, 1], box[k, 1] + slack)
        centre[k] = 0.5 * (wide[k, 0] + wide[k, 1])
    rows = _slopes(
        geometry,
        motor,
        q,
        Interval(wide[0, 0], wide[0, 1]),
        Interval(wide[1, 0], wide[1, 1]),
        Interval(wide[2, 0], wide[2, 1]),
    )
    inverse = _inverse_of_middle(rows)
    for row in inverse:
        if not math.isfinite(row[0] + row[1] + row[2]):
            return 0
    values = _residuals(
        geometry,
        motor,
        q,
        Interval(centre[0], centre[0]),
        Interval(centre[1], centre[1]),
        Interval(centre[2], centre[2]),
    )
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


@njit(cache=True, nogil=True, error_model="numpy")
def _polish(geometry, motor, q, pose):  # type: ignore[no-untyped-def]
    """Newton's method on ``pose`` (3,) in place, until the step is lost in rounding."""
    before = math.inf
    for _ in range(60):
        x = Interval(pose[0], pose[0])
        y = Interval(pose[1], pose[1])
        z = Interval(pose[2], pose[2])
        inverse = _inverse_of_middle(_slopes(geometry, motor, q, x, y, z))
        values = _residuals(geometry, motor, q, x, y, z)
        size = 0.0
        for k in range(3):
            step = 0.0
            for j in range(3):
                step += inverse[k][j] * _middle(values[j])
            pose[k] -= step
            size += abs(step)
        if not math.isfinite(size) or size == 0.0 or (size < 1e-13 and size >= before):
            return
        before = size


@njit(cache=True, nogil=True, error_model="numpy")
def _away_from_zero(geometry, motor, q, box):  # type: ignore[no-untyped-def]
    values = _residuals(
        geometry,
        motor,
        q,
        Interval(box[0, 0], box[0, 1]),
        Interval(box[1, 0], box[1, 1]),
        Interval(box[2, 0], box[2, 1]),
    )
    away = False
    for value in values:
        away = away or value.lo > 0.0 or value.hi < 0.0
    return away


@njit(cache=True, nogil=True, error_model="numpy")
def _widest(box):  # type: ignore[no-untyped-def]
    widest = 0
    for k in range(1, 3):
        if box[k, 1] - box[k, 0] > box[widest, 1] - box[widest, 0]:
            widest = k
    return widest


@njit(cache=True, nogil=True, error_model="numpy")
def _branch_and_prune(geometry, motor, q, limits, smallest, found, count, used):  # type: ignore[no-untyped-def]
    """Polished candidates in the box ``limits`` (3, 2), appended to ``found`` (M, 3).

    Returns their number, and the number of boxes looked at so far; stops where either runs out.
    """
    stack = np.empty((256, 3, 2))
    stack[0] = limits
    depth = 1
    box = np.empty((3, 2))
    wide = np.empty((3, 2))
    centre = np.empty(3)
    while depth > 0 and used < BOX_LIMIT and count < found.shape[0]:
        depth -= 1
        box[:] = stack[depth]
        used += 1
        state = -1 if _away_from_zero(geometry, motor, q, box) else 0
        narrowing = True
        while state == 0 and narrowing:
            before = (box[0, 1] - box[0, 0]) + (box[1, 1] - box[1, 0]) + (box[2, 1] - box[2, 0])
            state = _newton_step(geometry, motor, q, box, limits, wide, centre)
            after = (box[0, 1] - box[0, 0]) + (box[1, 1] - box[1, 0]) + (box[2, 1] - box[2, 0])
            narrowing = after < 0.6 * before and after > smallest
        k = _widest(box)
        if state == 1 or (state == 0 and box[k, 1] - box[k, 0] <= smallest):
            for j in range(3):
                found[count, j] = 0.5 * (wide[j, 0] + wide[j, 1])
            _polish(geometry, motor, q, found[count])
            count += 1
        elif state == 0:
            middle = 0.5 * (box[k, 0] + box[k, 1])
            stack[depth] = box
            stack[depth, k, 0] = middle
            stack[depth + 1] = box
            stack[depth + 1, k, 1] = middle
            depth += 2
    return count, used


def closures(
    geometry: Any, motor: float, q: tuple[float, float, float], boxes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Poses (K, 3) in ``boxes`` (B, 3, 2) of metres where the limbs close, polished, in the order found.

    Those at which the equations vanish without an assembly are among them. Raises ParameterError where
    assemblies do not stand apart: a curve of them, or a cluster at a singularity.
    """
    widest = float(np.max(boxes[:, :, 1] - boxes[:, :, 0]))
    found = np.empty((CELL_LIMIT, 3))
    count, used = 0, 0
    for limits in boxes:
        count, used = _branch_and_prune(geometry, motor, q, limits, CELL * widest, found, count, used)
        if used >= BOX_LIMIT or count >= CELL_LIMIT:
            raise ParameterError(
                f"The assemblies for q = {tuple(round(value, 6) for value in q)} do not stand apart.",
                remedy="A singularity or a continuum of poses is there: give actuator coordinates beside it.",
            )
    return _distinct(found[:count], APART * widest)


def _distinct(poses: NDArray[np.float64], apart: float) -> NDArray[np.float64]:
    """The finite poses, one of each cluster closer than ``apart``."""
    kept: list[NDArray[np.float64]] = []
    for pose in poses[np.isfinite(poses).all(axis=1)]:
        if all(np.max(np.abs(pose - other)) > apart for other in kept):
            kept.append(pose)
    return np.array(kept).reshape(-1, 3)
