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
from tpm_design.workspace.rays import Segments, step_of

Triple = tuple[float, float, float]

# of its ray parameter: how far from an end the zero of the margin that ended it may be. Ends are found to
# 1e-12, and a determinant's are at least 1e-9 of the segment away from those of reach
NEAREST = 1e-10
# of an end's distance from the origin: margins of reach that differ by less are both zero there
TIED = 1e-9
# how near the zero of a leg margin must be to carry a determinant's end along
CARRIED = 0.03
BY_REACH, BY_DETERMINANTS = 1, 2


class MovingEnds(NamedTuple):
    """E ends that margins move. ``place`` (E,): index among the starts and then the ends of S segments;
    ``t`` (E,): ray parameter; ``directions`` (3, E) of the rays; ``reach`` and ``determinants`` (M, E): gains
    in ray parameter per unit of each margin by which the end moves back, 0 of those that do not move it.

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
def _least_ending(margins, t, closing):  # type: ignore[no-untyped-def]
    """Least |margin| (m) of those that may end the segment here."""
    least = math.inf
    for margin in margins:
        if _ends_here(margin.value, margin.derivatives[0], t, closing):
            least = min(least, abs(margin.value))
    return least


@inner
def _reach_gains(margins, most, t, closing, gains):  # type: ignore[no-untyped-def]
    """Write 1/slope of each margin of reach that ends the segment here and is at most ``most`` (m), 0 of the
    others; how many do."""
    count = 0
    for row, margin in enumerate(margins):
        slope = margin.derivatives[0]
        if abs(margin.value) <= most and _ends_here(margin.value, slope, t, closing):
            gains[row] = 1.0 / slope
            count += 1
    return count


@inner
def _carrying_gain(margins, t, gains):  # type: ignore[no-untyped-def]
    """Write 1/slope of the margin whose zero is nearest, if that is near."""
    nearest, least, gain = 0, CARRIED * t, 0.0
    for row, margin in enumerate(margins):
        slope = margin.derivatives[0]
        if abs(margin.value) < least * abs(slope):
            nearest, least, gain = row, abs(margin.value / slope), 1.0 / slope
    gains[nearest] = gain


@inner
def _slopes(margins, slopes):  # type: ignore[no-untyped-def]
    """Write the margins' slopes along the ray; whether all are finite."""
    finite = True
    for row, margin in enumerate(margins):
        slopes[row] = margin.derivatives[0]
        finite = finite and math.isfinite(slopes[row])
    return finite


@inner
def _slopes_across(geometry, mode, origin, step, t, slopes):  # type: ignore[no-untyped-def]
    """Difference quotients of the determinants along a ray, in place: where rays passed a hole of reach
    without noticing, the elbow's root is clamped and has no slope, while determinants go on."""
    h = 1e-6 * t
    slopes[:] = 0.0
    for side in (-1.0, 1.0):
        x, y, z = _at(origin, step, t + side * h)
        for row, value in enumerate(equations.singularity_margins(geometry, mode, x, y, z)):
            slopes[row] += 0.5 * side * value / h


@inner
def _determinant_gains(margins, slopes, floor, code, t, closing, gains):  # type: ignore[no-untyped-def]
    """Write 1/slope of the determinants that fall to ``floor`` here on the sides of ``code``; how many."""
    count, bits = 0, code - 1
    for row, margin in enumerate(margins):
        sign = 1.0 if bits % 2 == 1 else -1.0
        bits //= 2
        if _ends_here(sign * margin.value - floor, sign * slopes[row], t, closing):
            gains[row] = 1.0 / slopes[row]
            count += 1
    return count


@inner
def _at(origin, step, t):  # type: ignore[no-untyped-def]
    return origin[0] + t * step[0], origin[1] + t * step[1], origin[2] + t * step[2]


@inner
def _ray_pose(origin, step, t):  # type: ignore[no-untyped-def]
    """A pose on a ray as Duals over the ray's parameter."""
    x, y, z = _at(origin, step, t)
    return Dual(x, (step[0],)), Dual(y, (step[1],)), Dual(z, (step[2],))


@kernel
def _moving_ends(geometry, mode, sided, floor, origin, scale, directions, segments):  # type: ignore[no-untyped-def]
    """Of the 2 S starts and ends, in this order: the gains (2 S, M) of the margins of reach, those of the
    determinants, and what moves each: 1 reach, 2 determinants, 0 nothing."""
    rays, start, end, codes = segments
    size = rays.size
    x, y, z = origin
    leg_count = len(equations.leg_margins(geometry, mode, x, y, z))
    reach = np.zeros((2 * size, leg_count + len(equations.mode_margins(geometry, mode, x, y, z))))
    determinants = np.zeros((2 * size, len(equations.singularity_margins(geometry, mode, x, y, z))))
    slopes = np.empty(determinants.shape[1])
    reasons = np.zeros(2 * size, np.int64)
    for place in range(2 * size):
        closing = place >= size
        s = place - size if closing else place
        t = end[s] if closing else start[s]
        if t == 0.0:
            continue
        step = step_of(scale, directions[rays[s]])
        pose = _ray_pose(origin, step, t)
        length = t * math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        # first: on the shell of reach determinants have no finite slope
        legs = equations.leg_margins(geometry, mode, *pose)
        limits = equations.mode_margins(geometry, mode, *pose)
        # a stroke has infinite slope where its strut is square to the rail: near zero by slope, not by value
        most = min(_least_ending(legs, t, closing), _least_ending(limits, t, closing)) + TIED * length
        gains = reach[place]
        count = _reach_gains(legs, most, t, closing, gains)
        count += _reach_gains(limits, most, t, closing, gains[leg_count:])
        if count > 0:
            reasons[place] = BY_REACH
        elif sided:
            margins = equations.singularity_margins(geometry, mode, *pose)
            if not _slopes(margins, slopes):
                _slopes_across(geometry, mode, origin, step, t, slopes)
            gains = determinants[place]
            count = _determinant_gains(margins, slopes, floor, codes[s], t, closing, gains)
            if count > 0:
                reasons[place] = BY_DETERMINANTS
                _carrying_gain(legs, t, reach[place])
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
    still = tuple(np.zeros(group.place.size) for group in (by_reach, by_determinants, by_determinants))
    own = mechanism.geometry, mode.signs, field.origin, field.scale, ends
    (ended, carrying, _), *_ = _near(*own, still, _segments_of(parts))
    # where nothing is carried anywhere
    rest, *_ = _near(*own, (ended, carrying, still[2]), _segments_of(parts))
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
def _reach_sums(geometry, mode, x, y, z, gains, out):  # type: ignore[no-untyped-def]
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
def _determinant_sums(geometry, mode, x, y, z, gains, out):  # type: ignore[no-untyped-def]
    """As ``_reach_sums``, of the determinants."""
    for n in range(x.size):
        total = 0.0
        for row, margin in enumerate(equations.singularity_margins(geometry, mode, x[n], y[n], z[n])):
            total += gains[row, n] * margin if gains[row, n] != 0.0 else 0.0
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
def _near(geometry, mode, origin, scale, ends, rest, parts):  # type: ignore[no-untyped-def]
    """Of a machine near the one whose segments (S) they are:

    Σ gain · margin of reach at the ends it moves, of reach at those that determinants move, and of the
    determinants there, carried along by what the second sums differ from ``rest``; starts and ends (S,),
    moved by what all of them differ from it; and per connected set Σ weight ∫ t² dt.
    """
    by_reach, by_determinants = ends
    rays, start, end, weights, component, count = parts
    ended = np.empty(by_reach.t.size)
    x, y, z = _poses(origin, scale, by_reach.t, by_reach.directions)
    _reach_sums(geometry, mode, x, y, z, by_reach.reach, ended)
    carrying, carried = np.empty(by_determinants.t.size), np.empty(by_determinants.t.size)
    x, y, z = _poses(origin, scale, by_determinants.t, by_determinants.directions)
    _reach_sums(geometry, mode, x, y, z, by_determinants.reach, carrying)
    t = by_determinants.t + (rest[1] - carrying)
    x, y, z = _poses(origin, scale, t, by_determinants.directions)
    _determinant_sums(geometry, mode, x, y, z, by_determinants.determinants, carried)
    starts_ends = np.concatenate((start, end))
    for n in range(ended.size):
        starts_ends[by_reach.place[n]] += rest[0][n] - ended[n]
    for n in range(carried.size):
        starts_ends[by_determinants.place[n]] += (rest[1][n] - carrying[n]) + (rest[2][n] - carried[n])
    start, end = starts_ends[: rays.size], starts_ends[rays.size :]
    volumes = np.zeros(count)
    for s in range(rays.size):
        volumes[component[s]] += weights[rays[s]] * (end[s] ** 3 - start[s] ** 3) / 3.0
    return (ended, carrying, carried), start, end, volumes


def _segments_of(field: RayField) -> tuple[Any, ...]:
    """As ``_near`` takes them."""
    segments = field.segments
    return (
        segments.ray,
        segments.start,
        segments.end,
        field.rays.weights,
        field.component,
        field.volumes.size,
    )


def field_near(boundary: MovingBoundary, mechanism: Mechanism, origin: Triple, scale: Triple) -> RayField:
    """The boundary's segments where a neighbouring machine has them, to first order, on rays of its
    ``origin`` and ``scale`` (m): those of a mode (``mode_scale``), or of a placed region."""
    field = boundary.field
    _, start, end, volumes = _near(
        mechanism.geometry,
        boundary.signs,
        origin,
        scale,
        boundary.ends,
        boundary.rest,
        _segments_of(field),
    )
    cell = abs(scale[0] * scale[1] * scale[2])
    return replace(
        field,
        origin=origin,
        scale=scale,
        segments=replace(field.segments, start=start, end=end),
        volumes=cell * volumes,
    )


def mode_field_near(boundary: MovingBoundary, mechanism: Mechanism) -> RayField:
    """``field_near`` of a field of a whole mode."""
    return field_near(boundary, mechanism, (0.0, 0.0, 0.0), mode_scale(mechanism))
