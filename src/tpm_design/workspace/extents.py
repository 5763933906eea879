"""Bounding box of the joint centres over an aspect."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import kernel
from tpm_design.mechanisms import equations
from tpm_design.workspace.aspects import RayField

SAMPLES = 9
# of the longest side: what is this near to the bounding box may touch it in a neighbouring design
NEARNESS = 1e-5


@kernel
def _boxes(geometry, mode, origin, scale, directions, rays, starts, ends):  # type: ignore[no-untyped-def]
    """Least and greatest coordinates (S, 3) of the joint centres on each segment."""
    low = np.full((rays.size, 3), math.inf)
    high = np.full((rays.size, 3), -math.inf)
    for s in range(rays.size):
        for k in range(SAMPLES):
            t = starts[s] + (ends[s] - starts[s]) * min(1.0 - 1e-9, max(1e-9, k / (SAMPLES - 1)))
            x = origin[0] + t * scale[0] * directions[rays[s], 0]
            y = origin[1] + t * scale[1] * directions[rays[s], 1]
            z = origin[2] + t * scale[2] * directions[rays[s], 2]
            for chain in equations.joint_centres(geometry, mode, x, y, z):
                for centre in chain:
                    for axis in range(3):
                        low[s, axis] = min(low[s, axis], centre[axis])
                        high[s, axis] = max(high[s, axis], centre[axis])
    return low, high


def field_extent(geometry: object, signs: object, field: RayField) -> float | None:
    """Longest side (m) of the bounding box of all joint centres over the largest component of a field;
    None for an empty field."""
    largest = field.largest()
    if largest is None:
        return None
    return extent_of_segments(geometry, signs, field, np.flatnonzero(field.component == largest))


def extent_of_segments(geometry: object, signs: object, field: RayField, segments: NDArray[np.intp]) -> float:
    """As ``field_extent``, over some segments of a field, by their indices."""
    low, high = _boxes_of(geometry, signs, field, segments)
    return float((high.max(axis=0) - low.min(axis=0)).max())


def outermost_segments(geometry: object, signs: object, field: RayField) -> NDArray[np.intp]:
    """Indices of the segments of a field on which joint centres touch the bounding box, or nearly so: where
    the bounding box of a neighbouring design is touched."""
    low, high = _boxes_of(geometry, signs, field, np.arange(field.segments.ray.size))
    near = NEARNESS * (high.max(axis=0) - low.min(axis=0)).max()
    touched = (low <= low.min(axis=0) + near) | (high >= high.max(axis=0) - near)
    return np.flatnonzero(touched.any(axis=1))


def _boxes_of(
    geometry: object, signs: object, field: RayField, segments: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = _boxes(
        geometry,
        signs,
        field.origin,
        field.scale,
        field.rays.directions,
        field.segments.ray[segments],
        field.segments.start[segments],
        field.segments.end[segments],
    )
    return low, high
