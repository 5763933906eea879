"""Signed distance to a placed region and the nearest of its points, for compiled code."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, short_kernel
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Points, Shape, Sphere, Tilt

BOX, CYLINDER, ELLIPSOID, POINTS = 0, 1, 2, 3


class PlacedRegion(NamedTuple):
    """A region at its place. ``half``: half edges, (radius, radius, half height) or half axes (m). A range
    of tilts is a cylinder of the coordinates (a, b, d) of ``mechanisms/tilts.py``."""

    form: int
    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    points: NDArray[np.float64]


def place(shape: Shape, centre: tuple[float, float, float]) -> PlacedRegion:
    """The region ``shape`` with its centre at ``centre`` (m)."""
    points = np.empty((0, 3))
    if isinstance(shape, Points):
        points = np.asarray(shape.points, dtype=np.float64).reshape(-1, 3)
    form, (a, b, c) = _form_and_half(shape, points)
    x, y, z = centre
    at = float(x), float(y), float(z)
    return PlacedRegion(form, at, (float(a), float(b), float(c)), points + at if points.size else points)


def _form_and_half(shape: Shape, points: NDArray[np.float64]) -> tuple[int, Sequence[float]]:
    if isinstance(shape, Box):
        return BOX, [0.5 * edge for edge in shape.size]
    if isinstance(shape, Cylinder):
        return CYLINDER, (shape.radius, shape.radius, 0.5 * shape.height)
    if isinstance(shape, Tilt):
        tangent = _half_tangent(shape.tilt)
        return CYLINDER, (tangent, tangent, 0.5 * shape.height)
    if isinstance(shape, Sphere):
        return ELLIPSOID, (shape.radius,) * 3
    if isinstance(shape, Ellipsoid):
        return ELLIPSOID, shape.semi_axes
    return POINTS, np.abs(points).max(axis=0).tolist()


def _half_tangent(tilt: float) -> float:
    """tan(tilt/2), not rounded below it."""
    return math.nextafter(math.nextafter(math.tan(0.5 * tilt), math.inf), math.inf)


@inner
def _ellipsoid_foot(half, x, y, z):  # type: ignore[no-untyped-def]
    """Nearest point of the ellipsoid's surface to a point (about its centre).

    The foot is half²·p/(half² + t) for the root t > −min half² of Σ (half·p/(half² + t))² = 1.
    """
    a, b, c = half[0] * half[0], half[1] * half[1], half[2] * half[2]
    least = min(a, b, c)
    size = math.sqrt(x * x + y * y + z * z)
    if size <= 1e-14 * math.sqrt(least):
        # the centre: the end of the shortest half axis
        if least == a:
            return half[0], 0.0, 0.0
        return (0.0, half[1], 0.0) if least == b else (0.0, 0.0, half[2])
    if a == b and b == c:
        return half[0] * x / size, half[0] * y / size, half[0] * z / size
    # convex and decreasing in t: Newton from the left never overshoots, bisection guards the rest
    low, high = -least * (1.0 - 1e-14), math.sqrt(max(a, b, c)) * size
    t = 0.0
    for _ in range(100):
        u, v, w = half[0] * x / (a + t), half[1] * y / (b + t), half[2] * z / (c + t)
        value = u * u + v * v + w * w - 1.0
        if value > 0.0:
            low = t
        else:
            high = t
        slope = -2.0 * (u * u / (a + t) + v * v / (b + t) + w * w / (c + t))
        following = t - value / slope
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - t) <= 1e-16 * least or high - low <= 1e-16 * least:
            break
        t = following
    u, v, w = half[0] * x / (a + t), half[1] * y / (b + t), half[2] * z / (c + t)
    missing = 1.0 - u * u - v * v - w * w
    if missing > 1e-12:
        # in the plane across the shortest axis, too deep for a root: the foot lies off the plane
        if least == a:
            u = math.sqrt(u * u + missing)
        elif least == b:
            v = math.sqrt(v * v + missing)
        else:
            w = math.sqrt(w * w + missing)
    return half[0] * u, half[1] * v, half[2] * w


@inner
def _nearest_index(points, x, y, z):  # type: ignore[no-untyped-def]
    best, least = 0, math.inf
    for n in range(points.shape[0]):
        square = (points[n, 0] - x) ** 2 + (points[n, 1] - y) ** 2 + (points[n, 2] - z) ** 2
        if square < least:
            best, least = n, square
    return best, math.sqrt(least)


@inner
def signed_distance(region, x, y, z):  # type: ignore[no-untyped-def]
    """Distance (m) to the region's surface, negative inside."""
    if region.form == POINTS:
        _, distance = _nearest_index(region.points, x, y, z)
        return distance
    dx, dy, dz = x - region.centre[0], y - region.centre[1], z - region.centre[2]
    half = region.half
    if region.form == ELLIPSOID:
        u, v, w = _ellipsoid_foot(half, dx, dy, dz)
        distance = math.sqrt((dx - u) ** 2 + (dy - v) ** 2 + (dz - w) ** 2)
        inside = (dx / half[0]) ** 2 + (dy / half[1]) ** 2 + (dz / half[2]) ** 2 <= 1.0
        return -distance if inside else distance
    if region.form == CYLINDER:
        ex, ey = math.sqrt(dx * dx + dy * dy) - half[0], abs(dz) - half[2]
        outside = math.sqrt(max(ex, 0.0) ** 2 + max(ey, 0.0) ** 2)
        return outside if outside > 0.0 else max(ex, ey)
    ex, ey, ez = abs(dx) - half[0], abs(dy) - half[1], abs(dz) - half[2]
    outside = math.sqrt(max(ex, 0.0) ** 2 + max(ey, 0.0) ** 2 + max(ez, 0.0) ** 2)
    return outside if outside > 0.0 else max(ex, ey, ez)


@inner
def nearest(region, x, y, z):  # type: ignore[no-untyped-def]
    """The region's point nearest to a pose; the pose itself inside."""
    if region.form == POINTS:
        n, _ = _nearest_index(region.points, x, y, z)
        return region.points[n, 0], region.points[n, 1], region.points[n, 2]
    cx, cy, cz = region.centre
    dx, dy, dz = x - cx, y - cy, z - cz
    half = region.half
    if region.form == ELLIPSOID:
        if (dx / half[0]) ** 2 + (dy / half[1]) ** 2 + (dz / half[2]) ** 2 <= 1.0:
            return x, y, z
        u, v, w = _ellipsoid_foot(half, dx, dy, dz)
        return cx + u, cy + v, cz + w
    if region.form == CYLINDER:
        size = math.sqrt(dx * dx + dy * dy)
        shrink = half[0] / size if size > half[0] else 1.0
        return cx + shrink * dx, cy + shrink * dy, cz + min(half[2], max(-half[2], dz))
    return (
        cx + min(half[0], max(-half[0], dx)),
        cy + min(half[1], max(-half[1], dy)),
        cz + min(half[2], max(-half[2], dz)),
    )


@short_kernel
def _nearest_at(region, x, y, z):  # type: ignore[no-untyped-def]
    return nearest(region, x, y, z)


def nearest_pose(region: PlacedRegion, pose: tuple[float, float, float]) -> tuple[float, float, float]:
    """The region's pose (m) nearest to one pose; that pose itself inside."""
    x, y, z = _nearest_at(region, *pose)
    return float(x), float(y), float(z)


@inner
def perpendicular(normal):  # type: ignore[no-untyped-def]
    """A unit vector perpendicular to a unit vector."""
    nx, ny, nz = normal
    if abs(nx) <= abs(ny) and abs(nx) <= abs(nz):
        size = math.sqrt(ny * ny + nz * nz)
        return 0.0, -nz / size, ny / size
    if abs(ny) <= abs(nz):
        size = math.sqrt(nx * nx + nz * nz)
        return nz / size, 0.0, -nx / size
    size = math.sqrt(nx * nx + ny * ny)
    return -ny / size, nx / size, 0.0


@inner
def surface_frame(region, x, y, z):  # type: ignore[no-untyped-def]
    """Three unit vectors, of which all but those that lead out lie in the faces of the region at a pose of
    its surface, or along its edges."""
    dx, dy, dz = x - region.centre[0], y - region.centre[1], z - region.centre[2]
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    if region.form == CYLINDER:
        size = math.sqrt(dx * dx + dy * dy)
        if size == 0.0:
            return axes
        c, s = dx / size, dy / size
        return (c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)
    if region.form == ELLIPSOID:
        u, v, w = dx / region.half[0] ** 2, dy / region.half[1] ** 2, dz / region.half[2] ** 2
        size = math.sqrt(u * u + v * v + w * w)
        if size == 0.0:
            return axes
        n = (u / size, v / size, w / size)
        a = perpendicular(n)
        return n, a, (n[1] * a[2] - n[2] * a[1], n[2] * a[0] - n[0] * a[2], n[0] * a[1] - n[1] * a[0])
    return axes


@short_kernel
def _signed_distance_at(region, x, y, z):  # type: ignore[no-untyped-def]
    return signed_distance(region, x, y, z)


def signed_distance_at(region: PlacedRegion, pose: tuple[float, float, float]) -> float:
    """Distance (m) of one pose to the region's surface, negative inside."""
    return float(_signed_distance_at(region, *pose))
