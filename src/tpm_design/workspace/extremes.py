"""Least and greatest values of an index over a region: a lattice, then polish from its best poses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel
from tpm_design.workspace.indices import Index, index_value, values_at
from tpm_design.workspace.region_geometry import POINTS, PlacedRegion, nearest, surface_frame

EIGHTHS = 8
MOST_MOVES = 400
FINEST_STEP = 1e-7
ERROR_FLOOR = 1e-10


@dataclass(frozen=True)
class Extreme:
    """``value`` in the index's unit, ``error``: what half the samples would have missed plus the polish's
    last gains, ``pose`` (3,) in metres where it is attained. ``pieces``: the extremes found from each eighth
    of the region, whose least (or greatest) is ``value``: smoother in the design than their minimum."""

    value: float
    error: float
    pose: tuple[float, float, float]
    pieces: tuple[float, ...]


@inner
def _polish(geometry, mode, region, index, start, value, step, smallest):  # type: ignore[no-untyped-def]
    """Compass search inside the region from ``start``: (value, decrease by the smallest steps, x, y, z)."""
    x, y, z = start[0], start[1], start[2]
    last = 0.0
    for _ in range(MOST_MOVES):
        if step <= smallest:
            break
        best, bx, by, bz = value, x, y, z
        for way in surface_frame(region, x, y, z):
            for sign in (-step, step):
                u = nearest(region, x + sign * way[0], y + sign * way[1], z + sign * way[2])
                trial = index_value(geometry, mode, index, u[0], u[1], u[2])
                if trial < best:
                    best, bx, by, bz = trial, u[0], u[1], u[2]
        if best < value:
            last += value - best
            # a second step the same way, while it pays
            u = nearest(region, 2.0 * bx - x, 2.0 * by - y, 2.0 * bz - z)
            trial = index_value(geometry, mode, index, u[0], u[1], u[2])
            value, x, y, z = best, bx, by, bz
            if trial < value:
                last += value - trial
                value, x, y, z = trial, u[0], u[1], u[2]
        else:
            if 0.4 * step > smallest:
                last = 0.0
            step *= 0.4
    return value, last, x, y, z


@inner
def _best_of_eighths(region, points, values, stride):  # type: ignore[no-untyped-def]
    """Index of the best of every ``stride``-th lattice pose in each octant about the region's centre, −1
    where there is none."""
    best = np.full(EIGHTHS, -1, np.int64)
    for n in range(0, values.size, stride):
        eighth = 0
        for axis in range(3):
            if points[n, axis] > region.centre[axis]:
                eighth += 1 << axis
        if best[eighth] < 0 or values[n] < values[best[eighth]]:
            best[eighth] = n
    return best


@inner
def _polished(geometry, mode, region, index, points, values, chosen, step, smallest):  # type: ignore[no-untyped-def]
    """(value, decrease by the smallest steps, x, y, z) (K, 5) from each chosen pose; rows of +inf where
    it is −1."""
    out = np.full((chosen.size, 5), math.inf)
    for k in range(chosen.size):
        n = chosen[k]
        if n >= 0:
            start = (points[n, 0], points[n, 1], points[n, 2])
            value, gain, x, y, z = _polish(geometry, mode, region, index, start, values[n], step, smallest)
            out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = value, gain, x, y, z
    return out


@inner
def _least(geometry, mode, region, index, points, spacing):  # type: ignore[no-untyped-def]
    """Value, error, pose and pieces (8,) of ``Extreme``, the index's sign still on them."""
    values = values_at(geometry, mode, index, points)
    if region.form == POINTS:
        n = values.argmin()
        value, error, pose = values[n], 0.0, (points[n, 0], points[n, 1], points[n, 2])
        pieces = np.full(EIGHTHS, value)
    else:
        # each eighth's best pose, then the best of every second pose alone where that is another one
        chosen = np.empty(2 * EIGHTHS, np.int64)
        chosen[:EIGHTHS] = _best_of_eighths(region, points, values, 1)
        chosen[EIGHTHS:] = _best_of_eighths(region, points, values, 2)
        halved = np.empty(EIGHTHS, np.int64)
        for eighth in range(EIGHTHS):
            halved[eighth] = eighth + EIGHTHS
            if chosen[eighth + EIGHTHS] == chosen[eighth]:
                halved[eighth] = eighth
                chosen[eighth + EIGHTHS] = -1
        step, smallest = 0.5 * spacing, FINEST_STEP * spacing
        found = _polished(geometry, mode, region, index, points, values, chosen, step, smallest)
        best = found[:, 0].argmin()
        value, pose = found[best, 0], (found[best, 2], found[best, 3], found[best, 4])
        error = found[halved, 0].min() - value + found[best, 1]
        pieces = np.where(np.isfinite(found[:EIGHTHS, 0]), found[:EIGHTHS, 0], value)
        pieces[pieces.argmin()] = value
    return value, error, pose, pieces


@kernel
def _extremes(geometry, mode, region, indices, points, spacing):  # type: ignore[no-untyped-def]
    """One row for each row of ``indices`` (quantity, part, motor, sign): value, error, pose, pieces."""
    out = np.empty((indices.shape[0], 5 + EIGHTHS))
    for k in range(indices.shape[0]):
        sign = indices[k, 3]
        index = Index(int(indices[k, 0]), int(indices[k, 1]), indices[k, 2], sign)
        value, error, pose, pieces = _least(geometry, mode, region, index, points, spacing)
        # shrinks with the lattice, so that a finer look at the same pose never contradicts a coarser one
        longest = 2.0 * max(region.half)
        floor = ERROR_FLOOR * abs(value) * (min(1.0, spacing / longest) if longest > 0.0 else 1.0)
        out[k, 0], out[k, 1] = sign * value, error + floor
        for axis in range(3):
            out[k, 2 + axis] = pose[axis]
        for eighth in range(EIGHTHS):
            out[k, 5 + eighth] = sign * pieces[eighth]
    return out


def extremes_over_region(
    geometry: object,
    signs: object,
    region: PlacedRegion,
    indices: Sequence[Index],
    points: NDArray[np.float64],
    spacing: float,
) -> tuple[Extreme, ...]:
    """The least value of each index (the greatest for sign −1) over the region.

    ``points`` (N, 3): the region's lattice; ``spacing`` (m) between its poses.
    """
    table = np.array(indices, dtype=np.float64).reshape(-1, 4)
    rows = _extremes(geometry, signs, region, table, points, spacing).tolist()
    return tuple(Extreme(row[0], row[1], (row[2], row[3], row[4]), tuple(row[5:])) for row in rows)
