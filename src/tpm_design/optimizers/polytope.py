"""The largest body of a family between given planes, as one convex program.

A body {centre + (spread sizes) ∘ u : u in the unit body} lies in n · x ≤ b where n · centre plus its extent
along n is at most b. The extents of boxes, cylinders and ellipsoids are convex in the sizes, the geometric
mean of the half sizes is concave: the program has one optimum. For ellipsoids it is the maximum-volume
ellipsoid of R. Deits, R. Tedrake, Computing large convex regions of obstacle-free space through semidefinite
programming, WAFR 2014, with its axes along those of the coordinates.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
UnitBody = Literal["box", "cylinder", "ellipsoid"]


def extents(unit: UnitBody, normals: FloatArray, half: FloatArray) -> FloatArray:
    """How far a body with half sizes ``half`` (3,) extends from its centre along ``normals`` (N, 3): (N,)."""
    if unit == "ellipsoid":
        return np.asarray(np.linalg.norm(normals * half, axis=1))
    return np.asarray(linear_extents(unit, normals) @ half)


def linear_extents(unit: UnitBody, normals: FloatArray) -> FloatArray:
    """(N, 3): the extents of a box or a cylinder (its first two half sizes equal) are this matrix times the
    half sizes."""
    if unit == "box":
        return np.abs(normals)
    across = np.linalg.norm(normals[:, :2], axis=1)
    return np.column_stack([across, np.zeros(len(normals)), np.abs(normals[:, 2])])


@dataclass(frozen=True)
class LargestBody:
    """``centre`` (3,), ``sizes`` (k,), and the logarithm of the product of the half sizes."""

    centre: FloatArray
    sizes: FloatArray
    log_product: float


def largest_between(
    unit: UnitBody, spread: FloatArray, normals: FloatArray, offsets: FloatArray, limit: float
) -> LargestBody | None:
    """The largest body with ``normals`` (N, 3) · x ≤ ``offsets`` (N,) throughout, half sizes ``spread``
    (3, k) · sizes, its centre and sizes within ± ``limit``. None where there is none, or the solver fails."""
    import cvxpy

    # its functions are not all declared for type checkers
    cp: Any = cvxpy
    count = spread.shape[1]
    centre, sizes = cp.Variable(3), cp.Variable(count)
    room: Any = offsets - normals @ centre
    if unit != "ellipsoid":
        fits = [linear_extents(unit, normals) @ spread @ sizes <= room]
    elif count == 1:
        fits = [np.linalg.norm(normals * spread[:, 0], axis=1)[:, None] @ sizes <= room]
    else:
        axes = [cp.multiply(normals[:, axis], spread[axis] @ sizes) for axis in range(3)]
        fits = [cp.SOC(room, cp.vstack(axes), axis=0)]
    # the logarithm's own cone made the solver fail in a third of the cases
    volume = sizes[0] if count == 1 else cp.geo_mean(spread @ sizes)
    problem: Any = cp.Problem(
        cp.Maximize(volume), [*fits, cp.abs(centre) <= limit, sizes >= 0.0, sizes <= limit]
    )
    try:
        with warnings.catch_warnings():
            # what an inaccurate end gives is polished and checked by other means
            warnings.simplefilter("ignore")
            problem.solve(solver=cp.CLARABEL)
    except (cp.error.SolverError, ArithmeticError, ValueError):
        return None
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE) or sizes.value is None:
        return None
    found = np.asarray(sizes.value, dtype=np.float64)
    half = spread @ found
    if not np.all(half > 0.0):
        return None
    return LargestBody(np.asarray(centre.value, dtype=np.float64), found, float(np.log(half).sum()))
