"""Poses that are a tilt and a distance, and the coordinates in which they are algebraic.

A platform tilted by β in the direction α, at the distance d: users write (α, β, d), formulas take
(a, b, d) with (a, b) = tan(β/2)·(cos α, sin α). There the direction α, which has no value at β = 0, does no
harm, and the unit vector halfway between the vertical and the platform's normal is
n = (a, b, 1)/√(1 + a² + b²).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import Interval, arctangent2, root, sqr

FloatArray = NDArray[np.float64]
Bounds = tuple[float, float]


def half_tilts(poses: FloatArray) -> FloatArray:
    """(a, b, d) of poses (α, β, d), both (N, 3)."""
    alpha, beta, distance = poses.T
    size = np.tan(0.5 * beta)
    return np.column_stack([size * np.cos(alpha), size * np.sin(alpha), distance])


def tilts(coordinates: FloatArray) -> FloatArray:
    """(α, β, d) of coordinates (a, b, d), both (N, 3): β ≥ 0, α in (−π, π], 0 where β = 0."""
    a, b, distance = coordinates.T
    return np.column_stack([np.arctan2(b, a), 2.0 * np.arctan(np.hypot(a, b)), distance])


def tilt_bounds(box: Sequence[Bounds]) -> tuple[Bounds, ...]:
    """Bounds of α, β, d over a box of (a, b, d); those of α are all directions where the box holds β = 0."""
    a, b = (Interval(low, high) for low, high in box[:2])
    alpha = arctangent2(b, a)
    beta = 2.0 * arctangent2(root(sqr(a) + sqr(b)), Interval(1.0, 1.0))
    return (alpha.lo, alpha.hi), (beta.lo, beta.hi), box[2]


def normal_rates(poses: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """α̇ and β̇ (N, 3) from the rates ṅ (N, 3, 3), one column for each actuator; NaN at β = 0."""
    alpha, half = poses[:, 0], 0.5 * poses[:, 1]
    along = np.column_stack([np.cos(half) * np.cos(alpha), np.cos(half) * np.sin(alpha), -np.sin(half)])
    around = np.column_stack([-np.sin(alpha), np.cos(alpha), np.zeros_like(alpha)])
    tilt = np.where(np.abs(np.sin(half)) > math.ulp(1.0), np.sin(half), np.nan)
    turning = np.einsum("nk,nkj->nj", around, rates) / tilt[:, None]
    tilting = 2.0 * np.einsum("nk,nkj->nj", along, rates)
    return turning, np.where(np.isnan(turning), np.nan, tilting)
