"""Aspects: connected sets of poses of a mode where no determinant changes sign."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import kernel
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.directions import ALL_OCTANTS, Octant, RaySet, ray_set
from tpm_design.workspace.joined_sets import find, join
from tpm_design.workspace.poses import aspect_code
from tpm_design.workspace.rays import Segments, trace
from tpm_design.workspace.region_geometry import BOX, CYLINDER, PlacedRegion


@dataclass(frozen=True)
class RayField:
    """Rays through space and the parts of them that lie in the workspace.

    ``origin``, ``scale``: pose = origin + t · scale · direction. ``component`` (S,): which connected set
    a segment belongs to. ``volumes`` (C,): their volumes (m³). ``whole`` (m³): volume of all the rays.
    """

    origin: tuple[float, float, float]
    scale: tuple[float, float, float]
    rays: RaySet
    segments: Segments
    component: NDArray[np.int64]
    volumes: NDArray[np.float64]
    whole: float

    def largest(self) -> int | None:
        """Index of the component of greatest volume."""
        return int(np.argmax(self.volumes)) if self.volumes.size else None


@kernel
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


def ray_field(
    mechanism: Mechanism,
    mode: Mode,
    *,
    rays: RaySet,
    limits: NDArray[np.float64],
    sided: bool,
    floor: float = 0.0,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> RayField:
    """Trace the rays and join what is connected."""
    segments = trace(
        mechanism.geometry,
        mode.signs,
        determinant_count=len(mechanism.kind.determinants),
        sided=sided,
        floor=floor,
        origin=origin,
        scale=scale,
        directions=rays.directions,
        limits=limits,
    )
    component, volumes = _components(
        segments.ray, segments.start, segments.end, segments.code, rays.neighbours, rays.weights
    )
    cell = abs(scale[0] * scale[1] * scale[2])
    volumes *= cell
    whole = cell * float(rays.weights @ limits**3) / 3.0
    return RayField(origin, scale, rays, segments, component, volumes, whole)


def mode_field(mechanism: Mechanism, mode: Mode, *, order: int, sided: bool, floor: float = 0.0) -> RayField:
    """The whole workspace of the mode, by ``order``² rays per square from the origin."""
    rays = ray_set(mode_octants(mode), order)
    half = np.asarray(mechanism.reach_half_axes())
    radius = float(half.max())
    x, y, z = (half / radius).tolist()
    limits = radius / rays.lengths
    return ray_field(mechanism, mode, rays=rays, limits=limits, sided=sided, floor=floor, scale=(x, y, z))


def mode_octants(mode: Mode) -> tuple[Octant, ...]:
    """The octants the mode may lie in: its own, or all."""
    return _octants_of(getattr(mode.signs, "octant", (0.0, 0.0, 0.0)))


@lru_cache
def _octants_of(signs: tuple[float, float, float]) -> tuple[Octant, ...]:
    return tuple(o for o in ALL_OCTANTS if all(s in (0.0, float(k)) for s, k in zip(signs, o, strict=True)))


def region_field(mechanism: Mechanism, mode: Mode, region: PlacedRegion, *, order: int) -> RayField:
    """The parts of a solid region in each aspect, by ``order``² rays per square from its centre."""
    rays = ray_set(ALL_OCTANTS, order)
    if region.form == BOX:
        limits = np.ones(rays.weights.size)
    elif region.form == CYLINDER:
        across = np.linalg.norm(rays.directions[:, :2], axis=1)
        limits = np.minimum(1.0 / across, 1.0 / np.abs(rays.directions[:, 2]))
    else:
        limits = 1.0 / rays.lengths
    return ray_field(
        mechanism, mode, rays=rays, limits=limits, sided=True, origin=region.centre, scale=region.half
    )


def locate(mechanism: Mechanism, mode: Mode, field: RayField, pose: tuple[float, float, float]) -> int | None:
    """Component of the field that holds a pose: the segment of its sides on the nearest ray that overlaps
    its radius, or None where the pose lies in no aspect."""
    x, y, z = pose
    code = aspect_code(mechanism.geometry, mode.signs, x, y, z)
    candidates = np.flatnonzero(field.segments.code == code)
    if code == 0 or not candidates.size:
        return None
    steps = field.rays.directions * np.asarray(field.scale)
    offset = np.asarray(pose) - np.asarray(field.origin)
    chosen = steps[field.segments.ray[candidates]]
    along = np.clip(
        (chosen @ offset) / (chosen**2).sum(axis=1),
        field.segments.start[candidates],
        field.segments.end[candidates],
    )
    distances = np.linalg.norm(along[:, None] * chosen - offset, axis=1)
    return int(field.component[candidates[np.argmin(distances)]])
