"""Segments of rays that lie in one aspect: brackets on a few samples, ends polished.

A ray is origin + t · step, t from 0 to its end. It is cut twice: where reach begins and ends,
then where a determinant changes sides. Between the samples of all rays, all changes are polished together,
so that margins are computed in vectorised rows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner
from tpm_design.mechanisms.pointwise import reach_row, singularity_row

REACH_SAMPLES = np.linspace(0.0, 1.0, 24)
REACH_SAMPLES[0] = 1e-12
# crowded at both ends, where determinants have infinite slope (the elbow term goes with the root of the
# distance to the shell)
SIDE_SAMPLES = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 20))
SIDE_SAMPLES[0], SIDE_SAMPLES[-1] = 1e-9, 1.0 - 1e-9
MOST_STEPS = 80


@dataclass(frozen=True)
class Segments:
    """S segments: ``ray`` (S,) index, ``start`` and ``end`` (S,) ray parameters, ``code`` (S,) sides."""

    ray: NDArray[np.int64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    code: NDArray[np.int64]


@inner
def step_of(scale, direction):  # type: ignore[no-untyped-def]
    """What a unit of a ray's parameter is in metres."""
    return scale[0] * direction[0], scale[1] * direction[1], scale[2] * direction[2]


@inner
def _place(origin, steps, ray, t, poses, n):  # type: ignore[no-untyped-def]
    """Write the pose at a ray parameter as the n-th column of poses (3, N)."""
    for axis in range(3):
        poses[axis, n] = origin[axis] + t * steps[ray, axis]


@inner
def _margins(geometry, mode, sided, poses, count, out):  # type: ignore[no-untyped-def]
    """Margins (P, N) of the first ``count`` poses, in place: determinants, or in the first row the reach."""
    x, y, z = poses[0, :count], poses[1, :count], poses[2, :count]
    if sided:
        singularity_row(geometry, mode, x, y, z, out)
    else:
        reach_row(geometry, mode, x, y, z, out[0], out[1])
        for n in range(count):
            out[0, n] = min(out[0, n], out[1, n])


@inner
def next_share(a, fa, b, fb, c, fc, tolerance):  # type: ignore[no-untyped-def]
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
def _roots(geometry, mode, sided, origin, steps, changes, brackets, size, part_count):  # type: ignore[no-untyped-def]
    """Ray parameters where margins change sign, on the side where they are ≥ 0.

    Of the first ``size`` ``changes`` (N, 2+): ray and part, and ``brackets`` (N, 5): two ray parameters, the
    part's margins there less the level that is passed, the level.
    """
    margins = np.empty((part_count + 1, size))
    t, poses, unfinished = np.empty(size), np.empty((3, size)), np.arange(size)
    for i in range(size):
        a, b, fa, fb = brackets[i, 0], brackets[i, 1], brackets[i, 2], brackets[i, 3]
        share = fa / (fa - fb)
        t[i] = a + (share if 0.05 < share < 0.95 else 0.5) * (b - a)
    count = size
    for _ in range(MOST_STEPS):
        for n in range(count):
            _place(origin, steps, changes[unfinished[n], 0], t[unfinished[n]], poses, n)
        _margins(geometry, mode, sided, poses, count, margins)
        kept = 0
        for n in range(count):
            i = unfinished[n]
            a, b, fa, fb = brackets[i, 0], brackets[i, 1], brackets[i, 2], brackets[i, 3]
            value = margins[changes[i, 1], n] - brackets[i, 4]
            c, fc = a, fa
            if (value >= 0.0) != (fa >= 0.0):
                c, fc, b, fb = b, fb, a, fa
            a, fa = t[i], value
            brackets[i, 0], brackets[i, 1], brackets[i, 2], brackets[i, 3] = a, b, fa, fb
            tolerance = 1e-12 * max(abs(a), abs(b))
            if fa != 0.0 and abs(b - a) > tolerance:
                t[i] = a + next_share(a, fa, b, fb, c, fc, tolerance) * (b - a)
                unfinished[kept] = i
                kept += 1
            else:
                t[i] = a if fa >= 0.0 else b
        count = kept
        if count == 0:
            break
    return t


@inner
def _state(margin, floor):  # type: ignore[no-untyped-def]
    """+1 or −1 on a side of the locus, 0 within ``floor`` of it or where undefined."""
    if margin > floor:
        return 1
    return -1 if margin < -floor else 0


@inner
def _code(states):  # type: ignore[no-untyped-def]
    """0 where a state is 0, else 1 + one bit per positive state."""
    code = 1
    for k in range(states.size):
        if states[k] == 0:
            return 0
        if states[k] > 0:
            code += 1 << k
    return code


@inner
def _most_changes(margins, part_count, size, floor):  # type: ignore[no-untyped-def]
    """At least as many as ``_find_changes`` finds."""
    most = 0
    for part in range(part_count):
        for n in range(1, size):
            if _state(margins[part, n - 1], floor) != _state(margins[part, n], floor):
                most += 2
    return most


@inner
def _find_changes(margins, part_count, parameters, rays, samples, floor, changes, brackets, first):  # type: ignore[no-untyped-def]
    """Find all changes of state between samples.

    ``changes`` (N, 3): ray, part, state afterwards. ``brackets`` as in ``_roots``. ``first`` (S + 1,): a
    segment's first change, and where the last one's end.
    """
    count = 0
    for s in range(rays.size):
        first[s] = count
        for n in range(s * samples + 1, (s + 1) * samples):
            for part in range(part_count):
                before, here = margins[part, n - 1], margins[part, n]
                state, after = _state(before, floor), _state(here, floor)
                while state != after:
                    level = floor * (state if state != 0 else after)
                    # without a floor the two sides touch
                    state = after if floor == 0.0 or state == 0 else 0
                    changes[count, 0], changes[count, 1], changes[count, 2] = rays[s], part, state
                    brackets[count, 0], brackets[count, 1] = parameters[n - 1], parameters[n]
                    brackets[count, 2], brackets[count, 3] = before - level, here - level
                    brackets[count, 4] = level
                    count += 1
    first[rays.size] = count


@inner
def _sort(keys, rows, first, last):  # type: ignore[no-untyped-def]
    """Sort keys and their rows from ``first`` to before ``last``; few and nearly in order."""
    for end in range(first + 1, last):
        n = end
        while n > first and keys[n - 1] > keys[n]:
            keys[n - 1], keys[n] = keys[n], keys[n - 1]
            for k in range(rows.shape[1]):
                rows[n - 1, k], rows[n, k] = rows[n, k], rows[n - 1, k]
            n -= 1


@inner
def _cut(geometry, mode, sided, part_count, floor, origin, steps, segments, shape, lowest):  # type: ignore[no-untyped-def]
    """Segments (ray, start, end) cut where a margin changes sides: the same and the code of what has at
    least the ``lowest`` code."""
    rays, starts, ends = segments
    samples = shape.size
    size = rays.size * samples
    parameters, poses = np.empty(size), np.empty((3, size))
    for s in range(rays.size):
        for k in range(samples):
            n = s * samples + k
            parameters[n] = starts[s] + (ends[s] - starts[s]) * shape[k]
            _place(origin, steps, rays[s], parameters[n], poses, n)
    # reach_row needs a second row
    margins = np.empty((part_count + 1, size))
    _margins(geometry, mode, sided, poses, size, margins)
    most = _most_changes(margins, part_count, size, floor)
    changes, brackets = np.empty((most, 3), np.int64), np.empty((most, 5))
    first = np.empty(rays.size + 1, np.int64)
    _find_changes(margins, part_count, parameters, rays, samples, floor, changes, brackets, first)
    total = first[rays.size]
    roots = _roots(geometry, mode, sided, origin, steps, changes, brackets, total, part_count)
    most = rays.size + total
    ray, codes = np.empty(most, np.int64), np.empty(most, np.int64)
    start, end = np.empty(most), np.empty(most)
    states = np.empty(part_count, np.int64)
    found = 0
    for s in range(rays.size):
        for n in range(first[s] + 1, first[s + 1]):
            # through both ends of the floor in order, even where the way between two samples is crooked
            if changes[n, 1] == changes[n - 1, 1]:
                roots[n] = max(roots[n], roots[n - 1])
        _sort(roots, changes, first[s], first[s + 1])
        for part in range(part_count):
            states[part] = _state(margins[part, s * samples], floor)
        code = _code(states)
        opened = starts[s]
        for n in range(first[s], first[s + 1] + 1):
            last = n == first[s + 1]
            closed = ends[s] if last else roots[n]
            following = code
            if not last:
                states[changes[n, 1]] = changes[n, 2]
                following = _code(states)
            if last or following != code:
                if code >= lowest and closed > opened:
                    ray[found], start[found], end[found], codes[found] = rays[s], opened, closed, code
                    found += 1
                opened = closed
                code = following
    return ray[:found], start[:found], end[:found], codes[:found]


@inner
def traced(geometry, mode, sided, part_count, floor, origin, steps, limits):  # type: ignore[no-untyped-def]
    """Segments (ray, start, end, code) of each ray in order along it, ``steps`` (N, 3) a unit of its
    parameter, ``limits`` (N,) where it ends. ``sided``: cut where a determinant changes side or falls to
    ``floor``; otherwise reach alone, and every code is 1.
    """
    ray, start, end = np.arange(limits.size), np.zeros(limits.size), limits
    code = np.empty(0, np.int64)
    for cut in range(2 if sided else 1):
        at_sides = cut == 1
        ray, start, end, code = _cut(
            geometry,
            mode,
            at_sides,
            part_count if at_sides else 1,
            floor if at_sides else 0.0,
            origin,
            steps,
            (ray, start, end),
            SIDE_SAMPLES if at_sides else REACH_SAMPLES,
            # of reach, code 2 is inside, code 1 outside
            1 if at_sides else 2,
        )
    if not sided:
        for n in range(code.size):
            code[n] = 1
    return ray, start, end, code
