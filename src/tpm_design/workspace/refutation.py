"""Proofs that a statement fails at one pose of one machine."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpm_design.arithmetic import Interval, inner, kernel
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace import statements
from tpm_design.workspace.fold_clearance import fold_clearance
from tpm_design.workspace.region_geometry import PlacedRegion, signed_distance_at

Pose = tuple[float, float, float]

# a determinant of unit rows that is proved to be smaller counts as zero
SINGULAR = 1e-12
# share of the reach that a line must enter a region by to be called inside
FOLD_DEPTH = 1e-9
# half lengths, as shares of the reach, of the segments on which a determinant is shown to change its sign
SEGMENTS = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5)


@kernel
def _refuting_at(statement, geometry, nominal, mode, x, y, z):  # type: ignore[no-untyped-def]
    guide = statements.guide(statement, nominal, mode, (x, y, z), (0.0, 0.0, 0.0))
    return statements.diagonals(
        statement, geometry, mode, guide, Interval(x, x), Interval(y, y), Interval(z, z)
    )


@inner
def _within_reach(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Whether every pose of a box is proved to be within reach, up to rounding at its bound."""
    inside = True
    for margin in equations.leg_margins(geometry, mode, x, y, z):
        inside = inside and margin.lo >= -SINGULAR
    for margin in equations.mode_margins(geometry, mode, x, y, z):
        inside = inside and margin.lo >= -SINGULAR
    return inside


@kernel
def _sign_at(geometry, mode, part, x, y, z):  # type: ignore[no-untyped-def]
    """+1 or −1 where the determinant at a pose is proved to have that sign, 2 where it is proved to be as
    good as zero, else 0."""
    margin = equations.singularity_margins(geometry, mode, Interval(x, x), Interval(y, y), Interval(z, z))[
        part
    ]
    if margin.lo >= -SINGULAR and margin.hi <= SINGULAR:
        return 2
    if margin.lo > 0.0:
        return 1
    return -1 if margin.hi < 0.0 else 0


@kernel
def _box_within_reach(geometry, mode, box):  # type: ignore[no-untyped-def]
    x, y, z = Interval(box[0][0], box[0][1]), Interval(box[1][0], box[1][1]), Interval(box[2][0], box[2][1])
    return _within_reach(geometry, mode, x, y, z)


def fails_at(statement: Any, mechanism: Mechanism, mode: Mode, pose: Pose) -> bool:
    """Whether ``statement`` is proved to be false at a pose (m) of this machine."""
    values = _refuting_at(
        statement, mechanism.enclosed_geometry({}), mechanism.geometry, mode.signs, *map(float, pose)
    )
    negative = [value.hi < 0.0 for value in values]
    if isinstance(statement, statements.Condition):
        # both matrices fail at one scale: a larger one leaves the first, a smaller one the second negative
        return any(negative[:3]) and any(negative[3:])
    return any(negative)


def folded_inside(mechanism: Mechanism, region: PlacedRegion) -> Pose | None:
    """A pose in the interior of the region at which a limb of this machine is folded, to rounding: farther
    from the region's surface than any rounding of it and of the line; None where there is no such line."""
    depth = FOLD_DEPTH * mechanism.reach_radius()
    for line in mechanism.fold_lines():
        found = fold_clearance(region, line)
        if found.value + line.radius < -depth:
            return found.pose
    return None


def singular_near(
    mechanism: Mechanism, mode: Mode, part: int, pose: Pose, region: PlacedRegion, distance: float
) -> Pose | None:
    """A pose within reach and nearer than ``distance`` (m) to the region, ``pose`` or very near, where
    determinant ``part`` is proved to be zero (to 1e-12), or within 1e-5 of the reach radius of which it is
    proved to change its sign within reach and that distance; else None."""
    geometry = mechanism.enclosed_geometry({})
    radius = mechanism.reach_radius()
    snapped = tuple(0.0 if abs(value) < 1e-9 * radius else float(value) for value in pose)
    at = (snapped[0], snapped[1], snapped[2])
    degenerate = tuple((value, value) for value in at)
    zero = _sign_at(geometry, mode.signs, part, *at) == 2
    within = signed_distance_at(region, at) < distance
    if zero and within and _box_within_reach(geometry, mode.signs, degenerate):
        return at
    x, y, z = map(float, pose)
    for share in SEGMENTS:
        half = share * radius
        for dx, dy, dz in _directions(mechanism, mode, part, (x, y, z), half):
            first = (x + dx, y + dy, z + dz)
            second = (x - dx, y - dy, z - dz)
            # the distance to a convex region is greatest at an end
            if not all(signed_distance_at(region, end) < distance for end in (first, second)):
                continue
            signs = [_sign_at(geometry, mode.signs, part, *end) for end in (first, second)]
            hull = tuple((min(u, v), max(u, v)) for u, v in zip(first, second, strict=True))
            if sorted(signs) == [-1, 1] and _box_within_reach(geometry, mode.signs, hull):
                return x, y, z
    return None


def _directions(
    mechanism: Mechanism, mode: Mode, part: int, pose: Pose, half: float
) -> list[tuple[float, float, float]]:
    """Steps (m) of length ``half`` across the locus, along the determinant's gradient, and along the axes."""
    axes = [(half, 0.0, 0.0), (0.0, half, 0.0), (0.0, 0.0, half)]
    poses = [tuple(p + s * d for p, d in zip(pose, axis, strict=True)) for axis in axes for s in (1.0, -1.0)]
    values = mechanism.determinants_at(np.array(poses), mode)[part]
    slopes = [float(values[2 * k] - values[2 * k + 1]) for k in range(3)]
    size = sum(slope * slope for slope in slopes) ** 0.5
    if size == 0.0:
        return axes
    return [(half * slopes[0] / size, half * slopes[1] / size, half * slopes[2] / size), *axes]
