"""How the segments of a ray field move with the machine, to first order.

A segment ends where a margin m is zero: t moves by −m(machine, end) / (∂m/∂t) when the machine changes, with
the slope along the ray of the machine whose segments they are. Moved ends give volumes and averages of
neighbouring machines without tracing: exact to first order as long as no segment appears, vanishes or joins
another set. An end where no margin is zero, such as the ray's own, stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import Dual, fast_kernel, inner, kernel, short_kernel
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.aspects import RayField, mode_scale
from tpm_design.workspace.rays import Segments

Triple = tuple[float, float, float]

# of its ray parameter: how far from an end the zero of the margin that ended it may be. Ends are found to
# 1e-12, and a determinant's are at least 1e-9 of the segment away from those of reach
NEAREST = 1e-10
# how near the zero of a leg margin must be to carry a determinant's end along
CARRIED = 0.03
BY_REACH, BY_DETERMINANTS = 1, 2


class MovingEnds(NamedTuple):
    """E ends that margins move. ``place`` (E,): index among the starts and then the ends of S segments;
    ``t`` (E,): ray parameter; ``directions`` (3, E) of the rays; ``reach`` and ``determinants`` (M, E): gains,
    how far the end moves back along its ray per unit of each margin, 0 where that does not count.

    What reach moves has gains of reach alone. What determinants move has gains of determinants at a point
    that moves with the bound of reach nearest to it, if one is near: determinants go with the root of the
    distance to it, and with that distance kept, their change is as good as linear.
    """

    place: NDArray[np.int64]
    t: NDArray[np.float64]
    directions: NDArray[np.float64]
    reach: NDArray[np.float64]
    determinants: NDArray[np.float64]


@dataclass(frozen=True)
class MovingBoundary:
    """Segments of a ray field in a mode of ``signs``, and what moves their ends. ``rest``: the sums of gain ·
    margin of the machine itself, of reach and of determinants, what is left of zero there."""

    field: RayField
    signs: Any
    ends: tuple[MovingEnds, MovingEnds]
    rest: tuple[NDArray[np.float64], ...]


@inner
def _ends_here(value, slope, t, closing):  # type: ignore[no-untyped-def]
    """Whether a margin of this value and slope ends (``closing``) or begins a segment at ``t``."""
    inward = -slope if closing else slope
    return 0.0 < inward < math.inf and abs(value) <= NEAREST * t * inward


@inner
def _reach_gains(geometry, mode, pose, t, closing, gains):  # type: ignore[no-untyped-def]
    """Write 1/slope of each margin of reach that ends the segment here, 0 of the others, or, where none does,
    1/slope of the leg margin whose zero is nearest if that is near; how many end it."""
    count, row = 0, 0
    nearest, least, gain = 0, CARRIED * t, 0.0
    for margin in equations.leg_margins(geometry, mode, *pose):
        slope = margin.derivatives[0]
        if _ends_here(margin.value, slope, t, closing):
            gains[row] = 1.0 / slope
            count += 1
        elif abs(margin.value) < least * abs(slope):
            nearest, least, gain = row, abs(margin.value / slope), 1.0 / slope
        row += 1
    for margin in equations.mode_margins(geometry, mode, *pose):
        slope = margin.derivatives[0]
        if _ends_here(margin.value, slope, t, closing):
            gains[row] = 1.0 / slope
            count += 1
        row += 1
    if count == 0:
        gains[nearest] = gain
    return count


@inner
def _determinant_gains(geometry, mode, floor, code, pose, t, closing, gains):  # type: ignore[no-untyped-def]
    """Write 1/slope of the determinants that fall to ``floor`` here on the sides of ``code``; how many."""
    count, row = 0, 0
    bits = code - 1
    for margin in equations.singularity_margins(geometry, mode, *pose):
        sign = 1.0 if bits % 2 == 1 else -1.0
        bits //= 2
        slope = margin.derivatives[0]
        if _ends_here(sign * margin.value - floor, sign * slope, t, closing):
            gains[row] = 1.0 / slope
            count += 1
        row += 1
    return count


@inner
def _ray_pose(origin, scale, direction, t):  # type: ignore[no-untyped-def]
    """A pose on a ray as Duals over the ray's parameter."""
    u, v, w = scale[0] * direction[0], scale[1] * direction[1], scale[2] * direction[2]
    return (
        Dual(origin[0] + t * u, (u,)),
        Dual(origin[1] + t * v, (v,)),
        Dual(origin[2] + t * w, (w,)),
    )


@kernel
def _moving_ends(geometry, mode, sided, floor, origin, scale, directions, segments):  # type: ignore[no-untyped-def]
    """Of the 2 S starts and ends, in this order: the gains (2 S, M) of the margins of reach, those of the
    determinants, and what moves each: 1 reach, 2 determinants, 0 nothing."""
    rays, start, end, codes = segments
    size = rays.size
    pose = _ray_pose(origin, scale, directions[0], 1.0)
    leg_count = len(equations.leg_margins(geometry, mode, *pose))
    reach = np.zeros((2 * size, leg_count + len(equations.mode_margins(geometry, mode, *pose))))
    determinants = np.zeros((2 * size, len(equations.singularity_margins(geometry, mode, *pose))))
    reasons = np.zeros(2 * size, np.int64)
    for place in range(2 * size):
        closing = place >= size
        s = place - size if closing else place
        t = end[s] if closing else start[s]
        if t == 0.0:
            continue
        pose = _ray_pose(origin, scale, directions[rays[s]], t)
        # first: on the shell of reach determinants have no finite slope
        gains = reach[place]
        count = _reach_gains(geometry, mode, pose, t, closing, gains)
        if count > 0:
            reasons[place] = BY_REACH
        elif sided:
            gains = determinants[place]
            count = _determinant_gains(geometry, mode, floor, codes[s], pose, t, closing, gains)
            reasons[place] = BY_DETERMINANTS if count > 0 else 0
        # several margins at once, as on a plane of symmetry: each moves half of what is around the ray
        for k in range(gains.size):
            gains[k] /= max(1, count)
    return reach, determinants, reasons


def moving_boundary(
    mechanism: Mechanism, mode: Mode, field: RayField, component: int | None, floor: float | None
) -> MovingBoundary:
    """Segments of one ``component`` of a field, or of all (None), ready to be moved. ``floor``: as the field
    was traced with, None where reach alone was looked at."""
    parts = _part(field, component)
    ray, start, end = parts.segments.ray, parts.segments.start, parts.segments.end
    reach, determinants, reasons = _moving_ends(
        mechanism.geometry,
        mode.signs,
        floor is not None,
        0.0 if floor is None else floor,
        field.origin,
        field.scale,
        field.rays.directions,
        (ray, start, end, parts.segments.code),
    )
    t = np.concatenate([start, end])
    directions = np.concatenate([field.rays.directions[ray]] * 2)
    by_reach, by_determinants = (
        MovingEnds(
            place,
            t[place],
            *(np.ascontiguousarray(rows[place].T) for rows in (directions, reach, determinants)),
        )
        for place in (np.flatnonzero(reasons == reason) for reason in (BY_REACH, BY_DETERMINANTS))
    )
    ends = by_reach, by_determinants
    own = (mechanism.geometry, mode.signs, field.origin, field.scale, ends)
    still = tuple(np.zeros(group.place.size) for group in (by_reach, by_determinants, by_determinants))
    first = _sums(*own, still)
    # the determinants' own sums are those at ends that are not carried along
    rest = _sums(*own, (*first[:2], still[2]))
    return MovingBoundary(parts, mode.signs, ends, rest)


def _part(field: RayField, component: int | None) -> RayField:
    """A field with the segments of one component alone."""
    if component is None:
        return field
    kept = field.component == component
    segments = field.segments
    return replace(
        field,
        segments=Segments(segments.ray[kept], segments.start[kept], segments.end[kept], segments.code[kept]),
        component=np.zeros(int(kept.sum()), np.int64),
        volumes=field.volumes[component : component + 1],
        sides=field.sides[component : component + 1],
        middles=field.middles[component : component + 1],
    )


@fast_kernel
def _reach_levels(geometry, mode, x, y, z, gains, out):  # type: ignore[no-untyped-def]
    """Σ gain · margin of reach (E,), written in place."""
    for n in range(x.size):
        total, row = 0.0, 0
        for margin in equations.leg_margins(geometry, mode, x[n], y[n], z[n]):
            total += gains[row, n] * margin if gains[row, n] != 0.0 else 0.0
            row += 1
        for margin in equations.mode_margins(geometry, mode, x[n], y[n], z[n]):
            total += gains[row, n] * margin if gains[row, n] != 0.0 else 0.0
            row += 1
        out[n] = total


@fast_kernel
def _determinant_levels(geometry, mode, x, y, z, gains, out):  # type: ignore[no-untyped-def]
    """As ``_reach_levels``, of the determinants."""
    for n in range(x.size):
        total, row = 0.0, 0
        for margin in equations.singularity_margins(geometry, mode, x[n], y[n], z[n]):
            total += gains[row, n] * margin if gains[row, n] != 0.0 else 0.0
            row += 1
        out[n] = total


@inner
def _poses(origin, scale, t, directions):  # type: ignore[no-untyped-def]
    x, y, z = np.empty(t.size), np.empty(t.size), np.empty(t.size)
    for n in range(t.size):
        x[n] = origin[0] + scale[0] * (t[n] * directions[0, n])
        y[n] = origin[1] + scale[1] * (t[n] * directions[1, n])
        z[n] = origin[2] + scale[2] * (t[n] * directions[2, n])
    return x, y, z


@short_kernel
def _sums(geometry, mode, origin, scale, ends, rest):  # type: ignore[no-untyped-def]
    """Σ gain · margin: of reach at the ends it moves, of reach at those that determinants move, and of the
    determinants there, carried along by what the second sums differ from ``rest``."""
    by_reach, by_determinants = ends
    ended = np.empty(by_reach.t.size)
    x, y, z = _poses(origin, scale, by_reach.t, by_reach.directions)
    _reach_levels(geometry, mode, x, y, z, by_reach.reach, ended)
    carrying, carried = np.empty(by_determinants.t.size), np.empty(by_determinants.t.size)
    x, y, z = _poses(origin, scale, by_determinants.t, by_determinants.directions)
    _reach_levels(geometry, mode, x, y, z, by_determinants.reach, carrying)
    t = by_determinants.t + (rest[1] - carrying)
    x, y, z = _poses(origin, scale, t, by_determinants.directions)
    _determinant_levels(geometry, mode, x, y, z, by_determinants.determinants, carried)
    return ended, carrying, carried


@short_kernel
def _moved(ends, rest, sums, rays, start, end, weights, component, count):  # type: ignore[no-untyped-def]
    """Starts and ends (S,) of the neighbour's segments, and Σ weight ∫ t² dt of its ``count`` sets."""
    both = np.concatenate((start, end))
    by_reach, by_determinants = ends
    for n in range(by_reach.t.size):
        both[by_reach.place[n]] += rest[0][n] - sums[0][n]
    for n in range(by_determinants.t.size):
        both[by_determinants.place[n]] += (rest[1][n] - sums[1][n]) + (rest[2][n] - sums[2][n])
    volumes = np.zeros(count)
    for s in range(rays.size):
        volumes[component[s]] += weights[rays[s]] * (both[start.size + s] ** 3 - both[s] ** 3) / 3.0
    return both[: start.size], both[start.size :], volumes


def field_near(boundary: MovingBoundary, mechanism: Mechanism, origin: Triple, scale: Triple) -> RayField:
    """The boundary's segments where a neighbouring machine has them, to first order, on rays of its ``origin``
    and ``scale`` (m): those of a mode (``mode_scale``), or of a placed region."""
    field = boundary.field
    sums = _sums(mechanism.geometry, boundary.signs, origin, scale, boundary.ends, boundary.rest)
    start, end, volumes = _moved(
        boundary.ends,
        boundary.rest,
        sums,
        field.segments.ray,
        field.segments.start,
        field.segments.end,
        field.rays.weights,
        field.component,
        field.volumes.size,
    )
    cell = abs(scale[0] * scale[1] * scale[2])
    return replace(
        field,
        origin=origin,
        scale=scale,
        segments=replace(field.segments, start=start, end=end),
        volumes=cell * volumes,
        whole=field.whole * cell / abs(math.prod(field.scale)),
    )


def mode_field_near(boundary: MovingBoundary, mechanism: Mechanism) -> RayField:
    """``field_near`` of a field of a whole mode."""
    return field_near(boundary, mechanism, (0.0, 0.0, 0.0), mode_scale(mechanism))


def volume_near(boundary: MovingBoundary, mechanism: Mechanism) -> float:
    """Volume (m³), to first order, of the boundary's part of the mode for a neighbouring machine; of the
    boundary's own machine, the volume of its segments."""
    return float(np.sum(mode_field_near(boundary, mechanism).volumes))
