"""Segments of rays that lie in one aspect: brackets on a few samples, ends polished.

A ray is origin + t · scale · direction, t from 0 to its end. Sample parameters crowd at both ends of an
interval, where determinants have infinite slope (the elbow term goes with the root of the distance to
the shell). All brackets of a kind are polished together, in vectorised rows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel
from tpm_design.mechanisms.pointwise import reach_row, singularity_row

REACH_SAMPLES = 24
SIDE_SAMPLES = 20
MOST_STEPS = 80
REACH = -1


@dataclass(frozen=True)
class Segments:
    """S segments: ``ray`` (S,) index, ``start`` and ``end`` (S,) ray parameters, ``code`` (S,) sides."""

    ray: NDArray[np.int64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    code: NDArray[np.int64]


@inner
def _place(origin, steps, ray, t, poses, n):  # type: ignore[no-untyped-def]
    """Write the pose at a ray parameter as the n-th column of poses (3, N)."""
    for axis in range(3):
        poses[axis, n] = origin[axis] + t * steps[ray, axis]


@inner
def _workspace_margins(geometry, mode, poses, count):  # type: ignore[no-untyped-def]
    """Metres (N,) of the first ``count`` poses, ≥ 0 where reachable in the mode."""
    legs, side = np.empty(count), np.empty(count)
    reach_row(geometry, mode, poses[0, :count], poses[1, :count], poses[2, :count], legs, side)
    for n in range(count):
        legs[n] = min(legs[n], side[n])
    return legs


@inner
def _determinants(geometry, mode, determinant_count, poses, count):  # type: ignore[no-untyped-def]
    """Signed determinants (D, N) of the first ``count`` poses."""
    determinants = np.empty((determinant_count, count))
    singularity_row(geometry, mode, poses[0, :count], poses[1, :count], poses[2, :count], determinants)
    return determinants


@inner
def _next_share(a, fa, b, fb, c, fc, tolerance):  # type: ignore[no-untyped-def]
    """Where between ``a``, the newest point, and ``b``, of the other sign, to look next; ``c`` came before.

    T. R. Chandrupatla, A new hybrid quadratic/bisection algorithm, Adv. Eng. Softw. 28, 1997.
    """
    xi = (a - b) / (c - b)
    phi = (fa - fb) / (fc - fb)
    if not 1.0 - math.sqrt(1.0 - xi) < phi < math.sqrt(xi):
        return 0.5
    share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    edge = 0.5 * tolerance / abs(b - a)
    return min(1.0 - edge, max(edge, share))


@inner
def _roots(geometry, mode, determinant_count, origin, steps, changes, brackets):  # type: ignore[no-untyped-def]
    """Ray parameters (N,) where margins change sign, on the side where they are ≥ 0.

    ``changes`` (N, 3+): ray and whose margin, a determinant's number or REACH in every row. ``brackets``
    (N, 5): two ray parameters, the margins there, the level that a determinant passes.
    """
    size = changes.shape[0]
    a, b, fa, fb = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    for i in range(size):
        a[i], b[i], fa[i], fb[i] = brackets[i, 0], brackets[i, 1], brackets[i, 2], brackets[i, 3]
    t = 0.5 * (a + b)
    poses = np.empty((3, size))
    unfinished = np.arange(size)
    count = size
    for _ in range(MOST_STEPS):
        if count == 0:
            break
        for n in range(count):
            _place(origin, steps, changes[unfinished[n], 0], t[unfinished[n]], poses, n)
        if changes[0, 1] == REACH:
            margins = _workspace_margins(geometry, mode, poses, count)
        else:
            determinants = _determinants(geometry, mode, determinant_count, poses, count)
            margins = np.empty(count)
            for n in range(count):
                i = unfinished[n]
                margins[n] = determinants[changes[i, 1], n] - brackets[i, 4]
        kept = 0
        for n in range(count):
            i = unfinished[n]
            c, fc = a[i], fa[i]
            if (margins[n] >= 0.0) != (fa[i] >= 0.0):
                c, fc = b[i], fb[i]
                b[i], fb[i] = a[i], fa[i]
            a[i], fa[i] = t[i], margins[n]
            tolerance = 1e-12 * max(abs(a[i]), abs(b[i]))
            if fa[i] != 0.0 and abs(b[i] - a[i]) > tolerance:
                share = _next_share(a[i], fa[i], b[i], fb[i], c, fc, tolerance)
                t[i] = a[i] + share * (b[i] - a[i])
                unfinished[kept] = i
                kept += 1
        count = kept
    for i in range(size):
        if not fa[i] >= 0.0:
            a[i] = b[i]
    return a


@inner
def _append(out, count, ray, start, end, code):  # type: ignore[no-untyped-def]
    """Add a segment unless it is empty."""
    if end > start:
        rays, starts, ends, codes = out
        n = count[0]
        rays[n], starts[n], ends[n], codes[n] = ray, start, end, code
        count[0] = n + 1


@inner
def _empty_segments(size):  # type: ignore[no-untyped-def]
    return np.empty(size, np.int64), np.empty(size), np.empty(size), np.empty(size, np.int64)


@inner
def _reachable_segments(geometry, mode, determinant_count, origin, steps, limits):  # type: ignore[no-untyped-def]
    """Segments of code 1 and their number."""
    size = limits.size * REACH_SAMPLES
    parameters, poses = np.empty(size), np.empty((3, size))
    for ray in range(limits.size):
        for k in range(REACH_SAMPLES):
            n = ray * REACH_SAMPLES + k
            parameters[n] = limits[ray] * max(1e-12, k / (REACH_SAMPLES - 1))
            _place(origin, steps, ray, parameters[n], poses, n)
    margins = _workspace_margins(geometry, mode, poses, size)
    changes, brackets = np.empty((size, 2), np.int64), np.empty((size, 5))
    found = 0
    for n in range(1, size):
        if n % REACH_SAMPLES > 0 and (margins[n] >= 0.0) != (margins[n - 1] >= 0.0):
            changes[found, 0], changes[found, 1] = n // REACH_SAMPLES, REACH
            brackets[found, 0], brackets[found, 1] = parameters[n - 1], parameters[n]
            brackets[found, 2], brackets[found, 3] = margins[n - 1], margins[n]
            found += 1
    ends = _roots(
        geometry, mode, determinant_count, origin, steps, changes[:found], brackets[:found]
    )
    out = _empty_segments(limits.size + found)
    count = np.zeros(1, np.int64)
    code = 1
    change = 0
    for ray in range(limits.size):
        inside = margins[ray * REACH_SAMPLES] >= 0.0
        opened = 0.0
        while change < found and changes[change, 0] == ray:
            if inside:
                _append(out, count, ray, opened, ends[change], code)
            inside = not inside
            opened = ends[change]
            change += 1
        if inside:
            _append(out, count, ray, opened, limits[ray], code)
    return out, count[0]


@inner
def _state(determinant, floor):  # type: ignore[no-untyped-def]
    """+1 or −1 on a side of the singularity, 0 within ``floor`` of it or where undefined."""
    if determinant > floor:
        return 1
    return -1 if determinant < -floor else 0


@inner
def _code(states):  # type: ignore[no-untyped-def]
    """As ``side_code``."""
    code = 1
    for k in range(states.size):
        if states[k] == 0:
            return 0
        if states[k] > 0:
            code += 1 << k
    return code


@inner
def _sort(keys, rows, first, last):  # type: ignore[no-untyped-def]
    """Sort keys and rows from ``first`` to before ``last``; few and nearly in order."""
    for end in range(first + 1, last):
        n = end
        while n > first and keys[n - 1] > keys[n]:
            keys[n - 1], keys[n] = keys[n], keys[n - 1]
            for k in range(rows.shape[1]):
                rows[n - 1, k], rows[n, k] = rows[n, k], rows[n - 1, k]
            n -= 1


@inner
def _sided_segments(geometry, mode, determinant_count, floor, origin, steps, found, count):  # type: ignore[no-untyped-def]
    """The first ``count`` reachable segments cut where the side of a singularity changes, their number."""
    rays, starts, ends, _ = found
    shape = np.empty(SIDE_SAMPLES)
    for k in range(SIDE_SAMPLES):
        shape[k] = 0.5 * (1.0 - math.cos(math.pi * k / (SIDE_SAMPLES - 1)))
    shape[0], shape[-1] = 1e-9, 1.0 - 1e-9
    size = count * SIDE_SAMPLES
    parameters, poses = np.empty(size), np.empty((3, size))
    for s in range(count):
        for k in range(SIDE_SAMPLES):
            n = s * SIDE_SAMPLES + k
            parameters[n] = starts[s] + (ends[s] - starts[s]) * shape[k]
            _place(origin, steps, rays[s], parameters[n], poses, n)
    determinants = _determinants(geometry, mode, determinant_count, poses, size)
    # ray, determinant, segment, state after the change
    changes, brackets = np.empty((2 * determinant_count * size, 4), np.int64), np.empty((2 * determinant_count * size, 5))
    total = 0
    for n in range(1, size):
        for part in range(determinant_count):
            if n % SIDE_SAMPLES == 0:
                continue
            before, here = determinants[part, n - 1], determinants[part, n]
            state, after = _state(before, floor), _state(here, floor)
            while state != after:
                level = floor * (state if state != 0 else after)
                # without a floor the two sides touch
                state = after if floor == 0.0 or state == 0 else 0
                changes[total, 0], changes[total, 1] = rays[n // SIDE_SAMPLES], part
                changes[total, 2], changes[total, 3] = n // SIDE_SAMPLES, state
                brackets[total, 0], brackets[total, 1] = parameters[n - 1], parameters[n]
                brackets[total, 2], brackets[total, 3] = before - level, here - level
                brackets[total, 4] = level
                total += 1
    roots = _roots(
        geometry, mode, determinant_count, origin, steps, changes[:total], brackets[:total]
    )
    out = _empty_segments(count + total)
    number = np.zeros(1, np.int64)
    states = np.empty(determinant_count, np.int64)
    change = 0
    for s in range(count):
        last = change
        while last < total and changes[last, 2] == s:
            last += 1
        _sort(roots, changes, change, last)
        for part in range(determinant_count):
            states[part] = _state(determinants[part, s * SIDE_SAMPLES], floor)
        code = _code(states)
        opened = starts[s]
        for n in range(change, last):
            states[changes[n, 1]] = changes[n, 3]
            following = _code(states)
            if following != code:
                if code > 0:
                    _append(out, number, rays[s], opened, roots[n], code)
                opened = roots[n]
                code = following
        if code > 0:
            _append(out, number, rays[s], opened, ends[s], code)
        change = last
    return out, number[0]


@kernel
def _trace(geometry, mode, sided, floor, origin, scale, directions, limits, determinant_count):  # type: ignore[no-untyped-def]
    steps = np.empty_like(directions)
    for ray in range(directions.shape[0]):
        for k in range(3):
            steps[ray, k] = scale[k] * directions[ray, k]
    out, count = _reachable_segments(geometry, mode, determinant_count, origin, steps, limits)
    if sided:
        out, count = _sided_segments(
            geometry, mode, determinant_count, floor, origin, steps, out, count
        )
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
