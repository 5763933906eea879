"""Samples of a placed region: a lattice of poses through it, and feelers that leave its surface."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import short_kernel
from tpm_design.workspace.directions import ALL_OCTANTS, ray_set
from tpm_design.workspace.region_geometry import BOX, CYLINDER, POINTS, PlacedRegion

FloatArray = NDArray[np.float64]


def lattice(region: PlacedRegion, samples: int) -> FloatArray:
    """Poses (I, J, K, 3) of the region, its surface included, ``samples`` along the longest edge; next to
    each other in the array where they are in space. Points: (N, 1, 1, 3) as they are."""
    if region.form == POINTS:
        return region.points.reshape(-1, 1, 1, 3)
    about_centre = _lattice_about_centre(region.form, region.half, samples)
    moved: FloatArray = _moved(about_centre.reshape(-1, 3), region.centre)
    return moved.reshape(about_centre.shape)


@short_kernel
def _moved(points, centre):  # type: ignore[no-untyped-def]
    """Points (N, 3) about a centre that was the origin."""
    out = np.empty(points.shape)
    for n in range(points.shape[0]):
        for axis in range(3):
            out[n, axis] = points[n, axis] + centre[axis]
    return out


@lru_cache(maxsize=16)
def _lattice_about_centre(form: int, half_edges: tuple[float, float, float], samples: int) -> FloatArray:
    half = np.asarray(half_edges)
    # odd, so that every second pose in order is a chequerboard
    counts = np.where(half > 0.0, 2 * np.rint(0.5 * samples * half / half.max()) + 1, 1).astype(int)
    counts = np.where(half > 0.0, np.maximum(3, np.minimum(counts, samples | 1)), 1)
    ticks = [np.linspace(-1.0, 1.0, count) if count > 1 else np.zeros(1) for count in counts]
    unit = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1)
    if form == CYLINDER:
        unit[..., :2] = _to_ball(unit[..., :2])
    elif form != BOX:
        unit = _to_ball(unit)
    return np.asarray(unit * half)


def _to_ball(cube: FloatArray) -> FloatArray:
    """Each shell of the cube [−1, 1]^n pressed onto the sphere of the same size."""
    size = np.linalg.norm(cube, axis=-1, keepdims=True)
    shell = np.abs(cube).max(axis=-1, keepdims=True)
    return np.asarray(np.where(size > 0.0, cube * shell / np.where(size > 0.0, size, 1.0), 0.0))


def feelers(region: PlacedRegion, samples: int) -> tuple[FloatArray, FloatArray]:
    """Points (N, 3) of the region's surface and unit outward normals (N, 3) there.

    Every pose outside a convex region is reached by exactly one of its normals, at a distance equal to
    the way along it. ``samples`` along an edge; fans of normals at edges, vertices and points.
    """
    if region.form == POINTS:
        fan = _sphere(3)
        return np.repeat(region.points, len(fan), axis=0), np.tile(fan, (len(region.points), 1))
    points, normals = _feelers_about_centre(region.form, region.half, samples)
    return _moved(points, region.centre), normals


@lru_cache(maxsize=16)
def _feelers_about_centre(
    form: int, half_edges: tuple[float, float, float], samples: int
) -> tuple[FloatArray, FloatArray]:
    half = np.asarray(half_edges)
    if form in (BOX, CYLINDER):
        points, normals = _box_feelers(samples) if form == BOX else _cylinder_feelers(samples)
        return half * points, normals
    # between even normals and even points: both matter on a flat ellipsoid
    normals = _sphere(max(3, samples // 2)) / np.sqrt(half)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    support = half * half * normals
    return support / np.sqrt((support * normals).sum(axis=1, keepdims=True)), normals


@lru_cache(maxsize=16)
def _sphere(order: int) -> FloatArray:
    directions = ray_set(ALL_OCTANTS, order).directions
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


@lru_cache(maxsize=16)
def _box_feelers(samples: int) -> tuple[FloatArray, FloatArray]:
    edge = np.linspace(-1.0, 1.0, samples)
    points, normals = [], []
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            for u in edge:
                for v in edge:
                    point, normal = np.zeros(3), np.zeros(3)
                    point[[axis, one, two]] = sign, u, v
                    normal[axis] = sign
                    points.append(point)
                    normals.append(normal)
    quarter = np.linspace(0.0, 0.5 * np.pi, samples)[1:-1]
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        for first in (-1.0, 1.0):
            for second in (-1.0, 1.0):
                for u in edge:
                    for angle in quarter:
                        point, normal = np.zeros(3), np.zeros(3)
                        point[[axis, one, two]] = u, first, second
                        normal[[one, two]] = first * np.cos(angle), second * np.sin(angle)
                        points.append(point)
                        normals.append(normal)
    for octant in ALL_OCTANTS:
        directions = ray_set((octant,), max(2, samples // 2)).directions
        for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
            points.append(np.asarray(octant, dtype=np.float64))
            normals.append(direction)
    return np.asarray(points), np.asarray(normals)


@lru_cache(maxsize=16)
def _cylinder_feelers(samples: int) -> tuple[FloatArray, FloatArray]:
    around = np.linspace(0.0, 2.0 * np.pi, 4 * samples, endpoint=False)
    points, normals = [], []
    for angle in around:
        c, s = np.cos(angle), np.sin(angle)
        for z in np.linspace(-1.0, 1.0, samples):
            points.append((c, s, z))
            normals.append((c, s, 0.0))
        for sign in (-1.0, 1.0):
            for radius in np.linspace(0.0, 1.0, samples):
                points.append((radius * c, radius * s, sign))
                normals.append((0.0, 0.0, sign))
            for lift in np.linspace(0.0, 0.5 * np.pi, samples)[1:-1]:
                points.append((c, s, sign))
                normals.append((np.cos(lift) * c, np.cos(lift) * s, sign * np.sin(lift)))
    return np.asarray(points), np.asarray(normals)
