"""Bounding box of the joint centres over an aspect."""

from __future__ import annotations

import math

import numpy as np

from tpm_design.arithmetic import kernel
from tpm_design.mechanisms import equations
from tpm_design.workspace.aspects import RayField

SAMPLES = 9


@kernel
def _box(geometry, mode, origin, scale, directions, rays, starts, ends):  # type: ignore[no-untyped-def]
    low = np.full(3, math.inf)
    high = np.full(3, -math.inf)
    for s in range(rays.size):
        for k in range(SAMPLES):
            t = starts[s] + (ends[s] - starts[s]) * min(1.0 - 1e-9, max(1e-9, k / (SAMPLES - 1)))
            x = origin[0] + t * scale[0] * directions[rays[s], 0]
            y = origin[1] + t * scale[1] * directions[rays[s], 1]
            z = origin[2] + t * scale[2] * directions[rays[s], 2]
            for chain in equations.joint_centres(geometry, mode, x, y, z):
                for centre in chain:
                    for axis in range(3):
                        low[axis] = min(low[axis], centre[axis])
                        high[axis] = max(high[axis], centre[axis])
    return low, high


def field_extent(geometry: object, signs: object, field: RayField) -> float | None:
    """Longest side (m) of the bounding box of all joint centres over the largest component of a field;
    None for an empty field."""
    largest = field.largest()
    if largest is None:
        return None
    keep = field.component == largest
    low, high = _box(
        geometry,
        signs,
        field.origin,
        field.scale,
        field.rays.directions,
        field.segments.ray[keep],
        field.segments.start[keep],
        field.segments.end[keep],
    )
    return float((high - low).max())
