"""How far a region keeps from the lines on which a limb is folded: minus the depth where one enters it.

The signed distance to a convex region is a convex function, along a line too, so that one search by sections
finds where the line is deepest inside or nearest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tpm_design.arithmetic import short_kernel
from tpm_design.mechanisms.fold_lines import FoldLine
from tpm_design.workspace.region_geometry import POINTS, PlacedRegion, nearest, signed_distance

GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
# what is left of the bracket is below the rounding of its ends
SECTIONS = 80


@dataclass(frozen=True)
class FoldClearance:
    """``value`` (m): signed distance between the region and the line, less the line's radius. ``pose`` (m) of
    the region: on the line where that enters the region, else the one nearest to it."""

    value: float
    pose: tuple[float, float, float]


@short_kernel
def _nearest_of_points(region, point, direction):  # type: ignore[no-untyped-def]
    """Distance to the line of the nearest pose, and that pose."""
    least, best = math.inf, 0
    for n in range(region.points.shape[0]):
        wx, wy, wz = (
            region.points[n, 0] - point[0],
            region.points[n, 1] - point[1],
            region.points[n, 2] - point[2],
        )
        dx, dy, dz = direction
        cx, cy, cz = wy * dz - wz * dy, wz * dx - wx * dz, wx * dy - wy * dx
        distance = math.sqrt(cx * cx + cy * cy + cz * cz)
        if distance < least:
            least, best = distance, n
    return least, (region.points[best, 0], region.points[best, 1], region.points[best, 2])


@short_kernel
def _deepest(region, point, direction):  # type: ignore[no-untyped-def]
    """Least signed distance along the line, and the region's pose there."""
    px, py, pz = point
    dx, dy, dz = direction
    cx, cy, cz = region.centre
    middle = (cx - px) * dx + (cy - py) * dy + (cz - pz) * dz
    # the nearest point of the region is no farther from its centre, along the line too
    size = math.sqrt(region.half[0] ** 2 + region.half[1] ** 2 + region.half[2] ** 2)
    low, high = middle - size, middle + size
    first, second = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_first = signed_distance(region, px + first * dx, py + first * dy, pz + first * dz)
    at_second = signed_distance(region, px + second * dx, py + second * dy, pz + second * dz)
    for _ in range(SECTIONS):
        if at_first <= at_second:
            high, second, at_second = second, first, at_first
            first = high - GOLDEN * (high - low)
            at_first = signed_distance(region, px + first * dx, py + first * dy, pz + first * dz)
        else:
            low, first, at_first = first, second, at_second
            second = low + GOLDEN * (high - low)
            at_second = signed_distance(region, px + second * dx, py + second * dy, pz + second * dz)
    t = 0.5 * (low + high)
    x, y, z = px + t * dx, py + t * dy, pz + t * dz
    return signed_distance(region, x, y, z), nearest(region, x, y, z)


def fold_clearance(region: PlacedRegion, line: FoldLine) -> FoldClearance:
    """The signed distance of a region from one line; of separate poses the plain distance."""
    found = _nearest_of_points if region.form == POINTS else _deepest
    distance, (x, y, z) = found(region, line.point, line.direction)
    return FoldClearance(float(distance) - line.radius, (float(x), float(y), float(z)))
