"""Segments of rays that lie in one aspect: brackets on a few samples, ends polished.

A ray is origin + t · scale · direction, t from 0 to its end. Sample parameters crowd at both ends of an
interval, where determinants have infinite slope (the elbow term goes with the root of the distance to
the shell).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tpm_design.mechanisms.pointwise import reach_row, singularity_row
from tpm_design.workspace.poses import side_code, side_margin, workspace_margin

REACH_SAMPLES = 24
SIDE_SAMPLES = 20
SEGMENTS_PER_RAY = 8


@dataclass(frozen=True)
class Segments:
    """S segments: ``ray`` (S,) index, ``start`` and ``end`` (S,) ray parameters, ``code`` (S,) sides."""

    ray: NDArray[np.int64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    code: NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def _margin(geometry, mode, code, floor, origin, step, t):  # type: ignore[no-untyped-def]
    """Margin along a ray: of reach for code 0, of the sides of the singularities otherwise."""
    x = origin[0] + t * step[0]
    y = origin[1] + t * step[1]
    z = origin[2] + t * step[2]
    if code == 0:
        return workspace_margin(geometry, mode, x, y, z)
    return side_margin(geometry, mode, code, floor, x, y, z)


@njit(cache=True, nogil=True, error_model="numpy")
def _side(geometry, mode, floor, origin, step, t):  # type: ignore[no-untyped-def]
    x = origin[0] + t * step[0]
    y = origin[1] + t * step[1]
    z = origin[2] + t * step[2]
    return side_code(geometry, mode, floor, x, y, z)


@njit(cache=True, nogil=True, error_model="numpy")
def boundary(geometry, mode, code, floor, origin, step, inside, outside):  # type: ignore[no-untyped-def]
    """Ray parameter where ``_margin`` changes sign between ``inside`` (≥ 0) and ``outside``.

    T. R. Chandrupatla, A new hybrid quadratic/bisection algorithm, Adv. Eng. Softw. 28, 1997.
    """
    a, b = outside, inside
    fa = _margin(geometry, mode, code, floor, origin, step, a)
    fb = _margin(geometry, mode, code, floor, origin, step, b)
    if fa >= 0.0:
        return a
    if not fb >= 0.0:
        return b
    if not math.isfinite(fa):
        fa = -abs(fb) - 1.0
    c, fc = a, fa
    share = 0.5
    tolerance = 1e-12 * max(abs(a), abs(b))
    for _ in range(80):
        t = a + share * (b - a)
        ft = _margin(geometry, mode, code, floor, origin, step, t)
        if (ft >= 0.0) == (fa >= 0.0):
            c, fc = a, fa
        else:
            c, fc = b, fb
            b, fb = a, fa
        a, fa = t, ft
        if fa == 0.0 or abs(b - a) <= tolerance:
            break
        xi = (a - b) / (c - b)
        phi = (fa - fb) / (fc - fb)
        if 1.0 - math.sqrt(1.0 - xi) < phi < math.sqrt(xi):
            share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
            edge = 0.5 * tolerance / abs(b - a)
            share = min(1.0 - edge, max(edge, share))
        else:
            share = 0.5
    return a if fa >= 0.0 else b


@njit(cache=True, nogil=True, error_model="numpy")
def _append(out, count, ray, start, end, code):  # type: ignore[no-untyped-def]
    rays, starts, ends, codes = out
    if end > start and count < rays.size:
        rays[count], starts[count], ends[count], codes[count] = ray, start, end, code
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _place(origin, steps, rays, parameters):  # type: ignore[no-untyped-def]
    """Poses at ray parameters (S, K) of rays (S,) as contiguous x, y, z (S·K,)."""
    segments, samples = parameters.shape
    x, y, z = np.empty(segments * samples), np.empty(segments * samples), np.empty(segments * samples)
    for s in range(segments):
        dx, dy, dz = steps[rays[s], 0], steps[rays[s], 1], steps[rays[s], 2]
        for k in range(samples):
            n = s * samples + k
            x[n] = origin[0] + parameters[s, k] * dx
            y[n] = origin[1] + parameters[s, k] * dy
            z[n] = origin[2] + parameters[s, k] * dz
    return x, y, z


@njit(cache=True, nogil=True, error_model="numpy")
def _reachable_segments(geometry, mode, origin, steps, limits, out):  # type: ignore[no-untyped-def]
    count = 0
    rays = np.arange(limits.size)
    parameters = np.empty((limits.size, REACH_SAMPLES))
    for ray in range(limits.size):
        for k in range(REACH_SAMPLES):
            parameters[ray, k] = limits[ray] * max(1e-12, k / (REACH_SAMPLES - 1))
    x, y, z = _place(origin, steps, rays, parameters)
    legs, side = np.empty(x.size), np.empty(x.size)
    reach_row(geometry, mode, x, y, z, legs, side)
    for ray in range(limits.size):
        step = (steps[ray, 0], steps[ray, 1], steps[ray, 2])
        before = False
        opened = 0.0
        for k in range(REACH_SAMPLES):
            n = ray * REACH_SAMPLES + k
            inside = legs[n] >= 0.0 and side[n] >= 0.0
            if inside and not before:
                opened = parameters[ray, k]
                if k > 0:
                    opened = boundary(geometry, mode, 0, 0.0, origin, step, opened, parameters[ray, k - 1])
                else:
                    opened = 0.0
            if before and not inside:
                closed = boundary(
                    geometry, mode, 0, 0.0, origin, step, parameters[ray, k - 1], parameters[ray, k]
                )
                count = _append(out, count, ray, opened, closed, 1)
            before = inside
        if before:
            count = _append(out, count, ray, opened, limits[ray], 1)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _code(determinants, n, floor):  # type: ignore[no-untyped-def]
    """As ``side_code``, from a column of determinants."""
    code = 1
    bit = 1
    for k in range(determinants.shape[0]):
        if determinants[k, n] > floor:
            code += bit
        elif not determinants[k, n] < -floor:
            return 0
        bit *= 2
    return code


@njit(cache=True, nogil=True, error_model="numpy")
def _sided_segments(geometry, mode, floor, origin, steps, determinant_count, found, out):  # type: ignore[no-untyped-def]
    """Cut reachable segments where the side of a singularity changes."""
    rays, starts, ends = found
    shape = np.empty(SIDE_SAMPLES)
    for k in range(SIDE_SAMPLES):
        shape[k] = 0.5 * (1.0 - math.cos(math.pi * k / (SIDE_SAMPLES - 1)))
    shape[0], shape[-1] = 1e-9, 1.0 - 1e-9
    parameters = np.empty((rays.size, SIDE_SAMPLES))
    for s in range(rays.size):
        for k in range(SIDE_SAMPLES):
            parameters[s, k] = starts[s] + (ends[s] - starts[s]) * shape[k]
    x, y, z = _place(origin, steps, rays, parameters)
    determinants = np.empty((determinant_count, x.size))
    singularity_row(geometry, mode, x, y, z, determinants)
    count = 0
    for s in range(rays.size):
        ray = rays[s]
        step = (steps[ray, 0], steps[ray, 1], steps[ray, 2])
        opened = starts[s]
        before = _code(determinants, s * SIDE_SAMPLES, floor)
        for k in range(1, SIDE_SAMPLES):
            code = _code(determinants, s * SIDE_SAMPLES + k, floor)
            if code == before:
                continue
            last, here = parameters[s, k - 1], parameters[s, k]
            # several determinants may change between two samples: walk from one change to the next
            for _ in range(4):
                if before == code:
                    break
                if before == 0:
                    opened = here
                    if code > 0:
                        opened = boundary(geometry, mode, code, floor, origin, step, here, last)
                    break
                closed = boundary(geometry, mode, before, floor, origin, step, last, here)
                count = _append(out, count, ray, opened, closed, before)
                opened = closed
                last = closed + 1e-9 * (here - closed)
                before = _side(geometry, mode, floor, origin, step, last)
            before = code
        if before > 0:
            count = _append(out, count, ray, opened, ends[s], before)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _trace(geometry, mode, sided, floor, origin, scale, directions, limits, determinant_count):  # type: ignore[no-untyped-def]
    steps = np.empty_like(directions)
    for ray in range(directions.shape[0]):
        for k in range(3):
            steps[ray, k] = scale[k] * directions[ray, k]
    size = SEGMENTS_PER_RAY * limits.size
    out = (np.empty(size, np.int64), np.empty(size), np.empty(size), np.empty(size, np.int64))
    count = _reachable_segments(geometry, mode, origin, steps, limits, out)
    if sided:
        found = (out[0][:count].copy(), out[1][:count].copy(), out[2][:count].copy())
        count = _sided_segments(geometry, mode, floor, origin, steps, determinant_count, found, out)
    return out[0][:count], out[1][:count], out[2][:count], out[3][:count]


def trace(
    geometry: object,
    signs: object,
    *,
    determinant_count: int,
    sided: bool,
    floor: float,
    origin: tuple[float, float, float],
    scale: tuple[float, float, float],
    directions: NDArray[np.float64],
    limits: NDArray[np.float64],
) -> Segments:
    """Segments of each ray in order along it.

    ``sided``: cut where a determinant changes side or falls to ``floor``; otherwise reach alone.
    ``limits`` (N,): ray parameters at which the rays end.
    """
    return Segments(
        *_trace(geometry, signs, sided, floor, origin, scale, directions, limits, determinant_count)
    )
