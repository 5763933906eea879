"""Gradients of the signed distance to a region: its outward normals as seen from a pose.

The signed distance to a convex region is convex. Where it has a kink, inside the region where two faces are
equally near, the gradients on all sides of it are given: its subgradients are their convex combinations.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tpm_design.workspace.region_geometry import (
    BOX,
    CYLINDER,
    POINTS,
    PlacedRegion,
    nearest_pose,
    signed_distance_at,
)

FloatArray = NDArray[np.float64]
Pose = tuple[float, float, float]

# what is nearer to a kink or to the surface than this share of the region counts as on it
NEARNESS = 1e-5
MEDIAL = 1e-3
BISECTIONS = 60
AXES = np.eye(3)


def outward_normals(region: PlacedRegion, pose: Pose) -> list[FloatArray]:
    """Unit vectors (3,): the one gradient of the signed distance at a pose, or those that meet there. None
    where they are not known: on the surface of separate poses."""
    if region.form == POINTS:
        return _away(pose, region.points[np.square(region.points - pose).sum(axis=1).argmin()])
    near = NEARNESS * max(region.half)
    if signed_distance_at(region, pose) > near:
        return _away(pose, np.array(nearest_pose(region, pose)))
    x, y, z = (p - c for p, c in zip(pose, region.centre, strict=True))
    if region.form == BOX:
        depths = [(h - abs(q), q, axis) for h, q, axis in zip(region.half, (x, y, z), AXES, strict=True)]
        least = min(depth for depth, _, _ in depths)
        return [n for depth, q, axis in depths if depth <= least + near for n in _both_ways(q, axis, near)]
    if region.form == CYLINDER:
        across = math.hypot(x, y)
        side, cap = region.half[0] - across, region.half[2] - abs(z)
        # on the axis every radial direction is one: two of them do for where they cancel out
        around = [AXES[0], -AXES[0]] if across <= near else [np.array([x / across, y / across, 0.0])]
        return [
            *(around if side <= cap + near else []),
            *(_both_ways(z, AXES[2], near) if cap <= side + near else []),
        ]
    return _ellipsoid_normals(region.half, np.array((x, y, z)), near)


def _away(pose: Pose, point: FloatArray) -> list[FloatArray]:
    way = np.array(pose) - point
    length = float(np.linalg.norm(way))
    return [way / length] if length > 0.0 else []


def _both_ways(coordinate: float, axis: FloatArray, near: float) -> list[FloatArray]:
    """The axis on the side of the coordinate, and the other one too where that is nearly 0."""
    return [sign * axis for sign in (1.0, -1.0) if sign * coordinate >= -near]


def _ellipsoid_normals(half: Pose, offset: FloatArray, near: float) -> list[FloatArray]:
    """Kinks lie across the shortest half axes a, where the feet have the coordinates h² q/(h² − a²) along the
    longer half axes h."""
    axes, shortest = np.array(half), min(half)
    short = axes <= shortest * (1.0 + NEARNESS)
    if short.all():
        size = float(np.linalg.norm(offset))
        return [offset / size] if size > near else [AXES[0], -AXES[0]]
    feet = np.zeros(3)
    feet[~short] = axes[~short] * offset[~short] / (axes[~short] ** 2 - shortest**2)
    rest = 1.0 - feet @ feet
    # the distance itself loses digits there, and poses found by it keep a little off the kink
    if rest > 0.0 and np.linalg.norm(offset[short]) <= MEDIAL * shortest:
        sides = [sign * math.sqrt(rest) * axis for axis in AXES[short] for sign in (1.0, -1.0)]
        return [_unit((feet + side) / axes) for side in sides]
    return [_unit(offset / (axes**2 + _foot_shift(axes, offset)))]


def _foot_shift(axes: FloatArray, offset: FloatArray) -> float:
    """The root −min h² < t ≤ 0 of Σ (h q/(h² + t))² = 1: the foot of a pose inside is h² q/(h² + t)."""
    low, high = -(float(axes.min()) ** 2), 0.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if np.square(axes * offset / (axes**2 + middle)).sum() > 1.0:
            low = middle
        else:
            high = middle
    return high


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))
