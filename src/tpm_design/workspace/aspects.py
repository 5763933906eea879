"""Aspects: connected sets of poses of a mode where no determinant changes sign."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel, short_kernel
from tpm_design.computed_once import computed_once
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.directions import ALL_OCTANTS, Octant, RaySet, ray_set
from tpm_design.workspace.joined_sets import find, join
from tpm_design.workspace.poses import aspect_code
from tpm_design.workspace.rays import Segments, step_of, traced
from tpm_design.workspace.region_geometry import BOX, CYLINDER, PlacedRegion

# beside rays that are asked for alone
NO_RAYS = RaySet(np.empty((0, 3)), np.empty(0), np.empty(0), np.empty((0, 2), np.int64))


@dataclass(frozen=True)
class RayField:
    """Rays through space and the parts of them that lie in the workspace.

    ``origin``, ``scale``: pose = origin + t · scale · direction. ``component`` (S,): which connected set
    a segment belongs to. Of these sets: ``volumes`` (C,) in m³, ``sides`` (C,) the code of their segments,
    ``middles`` (C, 3) the pose (m) in the middle of the longest one. ``limits`` (N,): t at which rays end.
    """

    origin: tuple[float, float, float]
    scale: tuple[float, float, float]
    rays: RaySet
    segments: Segments
    component: NDArray[np.int64]
    volumes: NDArray[np.float64]
    sides: NDArray[np.int64]
    middles: NDArray[np.float64]
    limits: NDArray[np.float64]

    @computed_once
    def whole(self) -> float:
        """Volume of all the rays (m³)."""
        a, b, c = self.scale
        return abs(a * b * c) * float(self.rays.weights @ self.limits**3) / 3.0

    def largest(self) -> int | None:
        """Index of the component of greatest volume."""
        return int(np.argmax(self.volumes)) if self.volumes.size else None


@inner
def _components(rays, start, end, code, neighbours, weights):  # type: ignore[no-untyped-def]
    """Join segments of neighbouring rays that have one code and overlap; number the sets in order.

    Returns the set of each segment and, per set, Σ weight ∫ t² dt.
    """
    first = np.zeros(weights.size + 1, np.int64)
    for item in range(start.size):
        first[rays[item] + 1] += 1
    for ray in range(weights.size):
        first[ray + 1] += first[ray]
    parent = np.arange(start.size)
    for pair in range(neighbours.shape[0]):
        a, b = neighbours[pair, 0], neighbours[pair, 1]
        for i in range(first[a], first[a + 1]):
            for j in range(first[b], first[b + 1]):
                if code[i] == code[j] and max(start[i], start[j]) <= min(end[i], end[j]):
                    join(parent, i, j)
    component = np.full(start.size, -1, np.int64)
    volumes = np.zeros(start.size)
    count = 0
    for item in range(start.size):
        root = find(parent, item)
        if component[root] < 0:
            component[root] = count
            count += 1
        number = component[root]
        component[item] = number
        volumes[number] += weights[rays[item]] * (end[item] ** 3 - start[item] ** 3) / 3.0
    return component, volumes[:count]


@inner
def _longest(segments, component, count, origin, steps):  # type: ignore[no-untyped-def]
    """Code (C,) of each set's segments, and the pose (C, 3) in the middle of the longest one."""
    rays, start, end, code = segments
    sides, middles = np.empty(count, np.int64), np.empty((count, 3))
    longest = np.full(count, -1.0)
    for s in range(rays.size):
        number = component[s]
        if end[s] - start[s] > longest[number]:
            longest[number] = end[s] - start[s]
            sides[number] = code[s]
            t = 0.5 * (start[s] + end[s])
            for axis in range(3):
                middles[number, axis] = origin[axis] + t * steps[rays[s], axis]
    return sides, middles


@inner
def _traced_and_joined(geometry, mode, sided, part_count, floor, origin, scale, rays):  # type: ignore[no-untyped-def]
    """Segments of the rays, the set of each, volumes, sides and middles of the sets, volume of all rays."""
    directions, limits, neighbours, weights = rays
    steps = np.empty(directions.shape)
    for n in range(weights.size):
        for axis in range(3):
            steps[n, axis] = directions[n, axis] * scale[axis]
    segments = traced(geometry, mode, sided, part_count, floor, origin, steps, limits)
    ray, start, end, code = segments
    component, volumes = _components(ray, start, end, code, neighbours, weights)
    cell = abs(scale[0] * scale[1] * scale[2])
    for number in range(volumes.size):
        volumes[number] *= cell
    sides, middles = _longest(segments, component, volumes.size, origin, steps)
    return segments, component, volumes, sides, middles


@kernel
def _two_fields(geometry, mode, sided, part_count, floor, origin, scale, fine, coarse):  # type: ignore[no-untyped-def]
    """As ``_traced_and_joined``, of two sets of rays."""
    return (
        _traced_and_joined(geometry, mode, sided, part_count, floor, origin, scale, fine),
        _traced_and_joined(geometry, mode, sided, part_count, floor, origin, scale, coarse),
    )


def _fields(
    mechanism: Mechanism,
    mode: Mode,
    rays: tuple[RaySet, RaySet],
    limits: tuple[NDArray[np.float64], NDArray[np.float64]],
    *,
    sided: bool,
    floor: float = 0.0,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    scale: tuple[float, float, float],
) -> tuple[RayField, RayField]:
    """Trace the rays and join what is connected. ``sided``: cut where a determinant changes side or falls to
    ``floor``; otherwise reach alone. ``limits`` (N,): ray parameters at which the rays end."""
    fine, coarse = (
        (each.directions, ends, each.neighbours, each.weights)
        for each, ends in zip(rays, limits, strict=True)
    )
    count = len(mechanism.kind.determinants)
    found = _two_fields(mechanism.geometry, mode.signs, sided, count, floor, origin, scale, fine, coarse)
    one, other = (
        RayField(
            origin=origin,
            scale=scale,
            rays=each,
            segments=Segments(*segments),
            component=component,
            volumes=volumes,
            sides=sides,
            middles=middles,
            limits=ends,
        )
        for each, ends, (segments, component, volumes, sides, middles) in zip(
            rays, limits, found, strict=True
        )
    )
    return one, other


def mode_fields(
    mechanism: Mechanism, mode: Mode, *, orders: tuple[int, int], sided: bool, floor: float = 0.0
) -> tuple[RayField, RayField]:
    """The whole workspace of the mode, by the square of each order of rays per square from the origin."""
    octants = mode_octants(mode)
    rays = ray_set(octants, orders[0]), ray_set(octants, orders[1])
    return _from_origin(mechanism, mode, rays, sided=sided, floor=floor)


def mode_field(mechanism: Mechanism, mode: Mode, *, order: int, sided: bool, floor: float = 0.0) -> RayField:
    """As ``mode_fields``, of one order."""
    rays = ray_set(mode_octants(mode), order), NO_RAYS
    return _from_origin(mechanism, mode, rays, sided=sided, floor=floor)[0]


def _from_origin(
    mechanism: Mechanism, mode: Mode, rays: tuple[RaySet, RaySet], *, sided: bool, floor: float
) -> tuple[RayField, RayField]:
    radius = max(mechanism.reach_half_axes())
    limits = _limits(radius, rays[0].lengths), _limits(radius, rays[1].lengths)
    return _fields(mechanism, mode, rays, limits, sided=sided, floor=floor, scale=mode_scale(mechanism))


@short_kernel
def _limits(radius, lengths):  # type: ignore[no-untyped-def]
    """Where rays of such lengths (N,) leave a ball."""
    out = np.empty(lengths.size)
    for n in range(lengths.size):
        out[n] = radius / lengths[n]
    return out


def mode_scale(mechanism: Mechanism) -> tuple[float, float, float]:
    """``scale`` of the rays through a whole mode: the longest half axis of reach is 1."""
    a, b, c = mechanism.reach_half_axes()
    radius = max(a, b, c)
    return a / radius, b / radius, c / radius


def reach_parts(mechanism: Mechanism, mode: Mode, rays: RaySet) -> Segments:
    """The parts of rays from the origin that are within reach in the mode."""
    limits = _limits(mechanism.reach_radius(), rays.lengths), np.empty(0)
    return _fields(mechanism, mode, (rays, NO_RAYS), limits, sided=False, scale=(1.0, 1.0, 1.0))[0].segments


def ball_field(
    mechanism: Mechanism,
    mode: Mode,
    *,
    centre: tuple[float, float, float],
    radius: float,
    order: int,
    floor: float = 0.0,
) -> RayField:
    """Rays every way from ``centre``, as far as ``radius`` (m), cut as sided ones of ``mode_fields``."""
    rays = ray_set(ALL_OCTANTS, order)
    limits, scale = (1.0 / rays.lengths, np.empty(0)), (radius, radius, radius)
    both = (rays, NO_RAYS), limits
    return _fields(mechanism, mode, *both, sided=True, floor=floor, origin=centre, scale=scale)[0]


def mode_octants(mode: Mode) -> tuple[Octant, ...]:
    """The octants the mode may lie in: its own, or all."""
    return _octants_of(getattr(mode.signs, "octant", (0.0, 0.0, 0.0)))


@lru_cache
def _octants_of(signs: tuple[float, float, float]) -> tuple[Octant, ...]:
    return tuple(o for o in ALL_OCTANTS if all(s in (0.0, float(k)) for s, k in zip(signs, o, strict=True)))


def region_fields(
    mechanism: Mechanism, mode: Mode, region: PlacedRegion, *, orders: tuple[int, int]
) -> tuple[RayField, RayField]:
    """The parts of a solid region in each aspect, by the square of each order of rays per square from its
    centre."""
    fine, coarse = ray_set(ALL_OCTANTS, orders[0]), ray_set(ALL_OCTANTS, orders[1])
    limits = _region_limits(region.form, orders[0]), _region_limits(region.form, orders[1])
    return _fields(
        mechanism, mode, (fine, coarse), limits, sided=True, origin=region.centre, scale=region.half
    )


@lru_cache(maxsize=64)
def _region_limits(form: int, order: int) -> NDArray[np.float64]:
    rays = ray_set(ALL_OCTANTS, order)
    if form == BOX:
        return np.ones(rays.weights.size)
    if form == CYLINDER:
        across = np.linalg.norm(rays.directions[:, :2], axis=1)
        return np.minimum(1.0 / across, 1.0 / np.abs(rays.directions[:, 2]))
    return 1.0 / rays.lengths


@kernel
def _located(geometry, mode, origin, scale, directions, segments, component, poses):  # type: ignore[no-untyped-def]
    """As ``located``."""
    rays, start, end, codes = segments
    found = np.full(poses.shape[0], -1, np.int64)
    for n in range(poses.shape[0]):
        x, y, z = poses[n, 0], poses[n, 1], poses[n, 2]
        code = aspect_code(geometry, mode, x, y, z)
        if code == 0:
            continue
        x, y, z = x - origin[0], y - origin[1], z - origin[2]
        least = math.inf
        for s in range(codes.size):
            if codes[s] == code:
                ray = rays[s]
                u, v, w = step_of(scale, directions[ray])
                along = (u * x + v * y + w * z) / (u * u + v * v + w * w)
                along = min(end[s], max(start[s], along))
                distance = math.sqrt((along * u - x) ** 2 + (along * v - y) ** 2 + (along * w - z) ** 2)
                if distance < least:
                    least = distance
                    found[n] = component[s]
    return found


def located(
    mechanism: Mechanism, mode: Mode, field: RayField, poses: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Components (N,) of the field that hold poses (N, 3): of the segment of a pose's sides on the nearest
    ray that overlaps its radius, −1 where the pose lies in no aspect."""
    parts = field.segments
    found: NDArray[np.int64] = _located(
        mechanism.geometry,
        mode.signs,
        field.origin,
        field.scale,
        field.rays.directions,
        (parts.ray, parts.start, parts.end, parts.code),
        field.component,
        np.ascontiguousarray(poses, dtype=np.float64),
    )
    return found


def locate(mechanism: Mechanism, mode: Mode, field: RayField, pose: tuple[float, float, float]) -> int | None:
    """Component of the field that holds one pose, or None; as ``located``."""
    component = int(located(mechanism, mode, field, np.array([pose]))[0])
    return None if component < 0 else component
