"""Least and greatest values of an index over a region: a lattice, then polish from its best poses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel, short_kernel
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
    of the region, whose least (or greatest) is ``value``: smoother in the design than their minimum.
    ``piece_poses`` (P, 3): where they are attained."""

    value: float
    error: float
    pose: tuple[float, float, float]
    pieces: tuple[float, ...]
    piece_poses: NDArray[np.float64] = field(compare=False)


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
def _polished(geometry, mode, region, index, points, values, spacing):  # type: ignore[no-untyped-def]
    """As ``_least``, of a solid region: polished from the best pose of each eighth, and from the best of
    every second pose alone where that is another one."""
    pieces, poses = np.full(EIGHTHS, math.inf), np.empty((EIGHTHS, 3))
    before = np.full(EIGHTHS, -1, np.int64)
    value, gain, pose = math.inf, 0.0, (points[0, 0], points[0, 1], points[0, 2])
    halved = math.inf
    # a loop, since for each literal stride everything would be compiled by itself
    for stride in range(1, 3):
        chosen = _best_of_eighths(region, points, values, stride)
        for eighth in range(EIGHTHS):
            n = chosen[eighth]
            if stride == 2 and n == before[eighth]:
                halved = min(halved, pieces[eighth])
            elif n >= 0:
                start = (points[n, 0], points[n, 1], points[n, 2])
                found, last, x, y, z = _polish(
                    geometry, mode, region, index, start, values[n], 0.5 * spacing, FINEST_STEP * spacing
                )
                if found < value:
                    value, gain, pose = found, last, (x, y, z)
                if stride == 1:
                    pieces[eighth] = found
                    poses[eighth, 0], poses[eighth, 1], poses[eighth, 2] = x, y, z
                else:
                    halved = min(halved, found)
            before[eighth] = n
    least = 0
    for eighth in range(EIGHTHS):
        if not math.isfinite(pieces[eighth]):
            pieces[eighth] = value
            poses[eighth, 0], poses[eighth, 1], poses[eighth, 2] = pose
        if pieces[eighth] < pieces[least]:
            least = eighth
    pieces[least] = value
    poses[least, 0], poses[least, 1], poses[least, 2] = pose
    return value, halved - value + gain, pose, pieces, poses


@inner
def _least(geometry, mode, region, index, points, spacing):  # type: ignore[no-untyped-def]
    """Value, error, pose, pieces (8,) and their poses of ``Extreme``, the index's sign still on them."""
    values = values_at(geometry, mode, index, points)
    if region.form != POINTS:
        return _polished(geometry, mode, region, index, points, values, spacing)
    n = 0
    for other in range(values.size):
        if values[other] < values[n]:
            n = other
    poses = np.empty((EIGHTHS, 3))
    for eighth in range(EIGHTHS):
        for axis in range(3):
            poses[eighth, axis] = points[n, axis]
    return values[n], 0.0, (points[n, 0], points[n, 1], points[n, 2]), np.full(EIGHTHS, values[n]), poses


@kernel
def _extremes(geometry, mode, region, indices, points, spacing):  # type: ignore[no-untyped-def]
    """One row for each row of ``indices`` (quantity, part, motor, sign): value, error, pose, pieces, and the
    pose of each of these."""
    out = np.empty((indices.shape[0], 5 + 4 * EIGHTHS))
    for k in range(indices.shape[0]):
        sign = indices[k, 3]
        index = Index(int(indices[k, 0]), int(indices[k, 1]), indices[k, 2], sign)
        value, error, pose, pieces, poses = _least(geometry, mode, region, index, points, spacing)
        # shrinks with the lattice, so that a finer look at the same pose never contradicts a coarser one
        longest = 2.0 * max(region.half)
        floor = ERROR_FLOOR * abs(value) * (min(1.0, spacing / longest) if longest > 0.0 else 1.0)
        out[k, 0], out[k, 1] = sign * value, error + floor
        for axis in range(3):
            out[k, 2 + axis] = pose[axis]
        for eighth in range(EIGHTHS):
            out[k, 5 + eighth] = sign * pieces[eighth]
            for axis in range(3):
                out[k, 5 + EIGHTHS + 3 * eighth + axis] = poses[eighth, axis]
    return out


@short_kernel
def _near(geometry, mode, indices, offsets, centre, out):  # type: ignore[no-untyped-def]
    """Write the index of each row of ``indices`` at its poses, given (K, P, 3) from ``centre``."""
    for k in range(indices.shape[0]):
        sign = indices[k, 3]
        index = Index(int(indices[k, 0]), int(indices[k, 1]), indices[k, 2], sign)
        for n in range(offsets.shape[1]):
            x, y, z = offsets[k, n, 0] + centre[0], offsets[k, n, 1] + centre[1], offsets[k, n, 2] + centre[2]
            out[k, n] = sign * index_value(geometry, mode, index, x, y, z)


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
    rows = _extremes(geometry, signs, region, _table(tuple(indices)), points, spacing)
    poses = rows[:, 5 + EIGHTHS :].reshape(-1, EIGHTHS, 3)
    return tuple(
        Extreme(row[0], row[1], (row[2], row[3], row[4]), tuple(row[5 : 5 + EIGHTHS]), where)
        for row, where in zip(rows.tolist(), poses, strict=True)
    )


@lru_cache(maxsize=256)
def _table(indices: tuple[Index, ...]) -> NDArray[np.float64]:
    """As kernels take them (K, 4)."""
    return np.array(indices, dtype=np.float64).reshape(-1, 4)


class IndicesNear:
    """Indices, each at poses (K, P, 3) of its own that move with a ``centre``, asked many times."""

    def __init__(
        self, indices: Sequence[Index], poses: NDArray[np.float64], centre: tuple[float, float, float]
    ) -> None:
        self._table = _table(tuple(indices))
        self._offsets = np.ascontiguousarray(poses) - np.array(centre)

    def values(
        self, machines: Sequence[tuple[object, object, tuple[float, float, float]]]
    ) -> NDArray[np.float64]:
        """(N, K, P), in each index's unit, for machines (geometry, signs of the mode) with the poses about
        centres of their own."""
        found = np.empty((len(machines), *self._offsets.shape[:2]))
        for (geometry, signs, centre), out in zip(machines, found, strict=True):
            _near(geometry, signs, self._table, self._offsets, centre, out)
        return found
