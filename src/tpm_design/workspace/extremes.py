"""Least and greatest values of an index over a region: a lattice, then polish from its best poses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tpm_design.workspace.indices import Index, index_value, index_values
from tpm_design.workspace.region_geometry import POINTS, PlacedRegion, nearest

STARTS = 3
FINEST_STEP = 1e-7
ERROR_FLOOR = 1e-10


@dataclass(frozen=True)
class Extreme:
    """``value`` in the index's unit, ``error``: what half the samples would have missed plus the polish's
    last gain, ``pose`` (3,) in metres where it is attained."""

    value: float
    error: float
    pose: tuple[float, float, float]


@njit(cache=True, nogil=True, error_model="numpy")
def _polish(geometry, mode, region, index, start, value, step, smallest):  # type: ignore[no-untyped-def]
    """Compass search inside the region from ``start``: (value, last decrease, x, y, z)."""
    x, y, z = start[0], start[1], start[2]
    last = 0.0
    while step > smallest:
        best, bx, by, bz = value, x, y, z
        for axis in range(3):
            for sign in (-1.0, 1.0):
                u = nearest(
                    region,
                    x + (sign * step if axis == 0 else 0.0),
                    y + (sign * step if axis == 1 else 0.0),
                    z + (sign * step if axis == 2 else 0.0),
                )
                trial = index_value(geometry, mode, index, u[0], u[1], u[2])
                if trial < best:
                    best, bx, by, bz = trial, u[0], u[1], u[2]
        if best < value:
            last = value - best
            # a second step the same way, while it pays
            u = nearest(region, 2.0 * bx - x, 2.0 * by - y, 2.0 * bz - z)
            trial = index_value(geometry, mode, index, u[0], u[1], u[2])
            value, x, y, z = best, bx, by, bz
            if trial < value:
                value, x, y, z = trial, u[0], u[1], u[2]
        else:
            step *= 0.4
    return value, last, x, y, z


@njit(cache=True, nogil=True, error_model="numpy")
def _starts(values, points, stride, number, separation):  # type: ignore[no-untyped-def]
    """Indices of the best lattice poses, apart from each other, of every ``stride``-th pose."""
    chosen = np.full(STARTS, -1, np.int64)
    count = 0
    for _ in range(number):
        best = -1
        for n in range(0, values.size, stride):
            if best >= 0 and values[n] >= values[best]:
                continue
            near = False
            for k in range(count):
                m = chosen[k]
                square = (
                    (points[n, 0] - points[m, 0]) ** 2
                    + (points[n, 1] - points[m, 1]) ** 2
                    + (points[n, 2] - points[m, 2]) ** 2
                )
                near = near or square < separation * separation
            if not near:
                best = n
        if best < 0:
            break
        chosen[count] = best
        count += 1
    return chosen[:count]


@njit(cache=True, nogil=True, error_model="numpy")
def _least(geometry, mode, region, index, points, spacing):  # type: ignore[no-untyped-def]
    values = index_values(geometry, mode, index, points)
    smallest = FINEST_STEP * spacing
    results = np.full(2, math.inf)
    pose = (points[0, 0], points[0, 1], points[0, 2])
    last = 0.0
    if region.form == POINTS:
        n = int(np.argmin(values))
        return values[n], 0.0, (points[n, 0], points[n, 1], points[n, 2])
    for attempt in range(2):
        chosen = _starts(values, points, 1 + attempt, STARTS - attempt, 2.5 * spacing)
        for n in chosen:
            start = (points[n, 0], points[n, 1], points[n, 2])
            value, step, x, y, z = _polish(
                geometry, mode, region, index, start, values[n], 0.5 * spacing, smallest
            )
            if value < results[attempt]:
                results[attempt] = value
                if value < min(results[0], results[1 - attempt]) or attempt == 0:
                    pose, last = (x, y, z), step
    return min(results[0], results[1]), abs(results[0] - results[1]) + last, pose


def least_over_region(
    geometry: object,
    signs: object,
    region: PlacedRegion,
    index: Index,
    points: NDArray[np.float64],
    spacing: float,
) -> Extreme:
    """The least value of the index (the greatest for sign −1) over the region.

    ``points`` (N, 3): the region's lattice; ``spacing`` (m) between its poses.
    """
    value, error, pose = _least(geometry, signs, region, index, points, spacing)
    # shrinks with the lattice, so that a finer look at the same pose never contradicts a coarser one
    longest = 2.0 * max(region.half)
    floor = ERROR_FLOOR * abs(value) * (min(1.0, spacing / longest) if longest > 0.0 else 1.0)
    return Extreme(index.sign * value, error + floor, (float(pose[0]), float(pose[1]), float(pose[2])))
