"""Means and shares of the conditioning along the segments of a ray field."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel
from tpm_design.workspace.aspects import RayField
from tpm_design.workspace.indices import condition_at

# along a segment, fine and coarse: 1/κ has kinks where singular values change places
GAUSS_NODES = {"region": (8, 6), "aspect": (16, 12)}


@dataclass(frozen=True)
class Averages:
    """Integrals over the chosen segments (m³): of 1, of 1/κ, of [1/κ ≥ threshold]; least 1/κ met."""

    volume: float
    conditioning: float
    above: float
    least: float


@inner
def _at(geometry, mode, frobenius, motor, origin, step, t):  # type: ignore[no-untyped-def]
    return condition_at(
        geometry,
        mode,
        frobenius,
        motor,
        origin[0] + t * step[0],
        origin[1] + t * step[1],
        origin[2] + t * step[2],
    )


@inner
def _threshold_crossing(geometry, mode, frobenius, motor, threshold, origin, step, low, high, below):  # type: ignore[no-untyped-def]
    for _ in range(40):
        t = 0.5 * (low + high)
        if (_at(geometry, mode, frobenius, motor, origin, step, t) < threshold) == below:
            low = t
        else:
            high = t
    return 0.5 * (low + high)


@kernel
def _integrate(  # type: ignore[no-untyped-def]
    geometry, mode, frobenius, motor, threshold, origin, scale, directions, weights, segments, nodes
):
    rays, starts, ends = segments
    places, shares = nodes
    volume, total, above, least = 0.0, 0.0, 0.0, math.inf
    for s in range(rays.size):
        ray = rays[s]
        step = (
            scale[0] * directions[ray, 0],
            scale[1] * directions[ray, 1],
            scale[2] * directions[ray, 2],
        )
        start, length = starts[s], ends[s] - starts[s]
        inside = 0.0
        low = start
        value = _at(geometry, mode, frobenius, motor, origin, step, start + 1e-9 * length)
        least = min(least, value)
        below = value < threshold
        # ∫ t² dt over the parts above the threshold: + t³/3 where one ends, − t³/3 where one begins
        if not below:
            above -= weights[ray] * start**3 / 3.0
        for k in range(places.size + 1):
            t = ends[s] - 1e-9 * length if k == places.size else start + length * places[k]
            value = _at(geometry, mode, frobenius, motor, origin, step, t)
            least = min(least, value)
            if k < places.size:
                inside += shares[k] * length * t * t * value
            if (value < threshold) != below:
                crossing = _threshold_crossing(
                    geometry, mode, frobenius, motor, threshold, origin, step, low, t, below
                )
                if below:
                    above -= weights[ray] * crossing**3 / 3.0
                else:
                    above += weights[ray] * crossing**3 / 3.0
                below = not below
            low = t
        total += weights[ray] * inside
        volume += weights[ray] * (ends[s] ** 3 - start**3) / 3.0
        if not below:
            above += weights[ray] * ends[s] ** 3 / 3.0
    return volume, total, above, least


@cache
def _nodes(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places in [0, 1] and weights, crowded at both ends of a segment."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    angles = 0.5 * np.pi * (nodes + 1.0)
    return 0.5 * (1.0 - np.cos(angles)), weights * 0.25 * np.pi * np.sin(angles)


def conditioning_averages(
    geometry: object,
    signs: object,
    field: RayField,
    *,
    component: int | None,
    frobenius: bool,
    motor: float,
    threshold: float,
    nodes: int,
) -> Averages:
    """Integrals of 1/κ over one component of the field, or over all its segments, by ``nodes`` along each.

    Nodes crowd at the ends of a segment, where 1/κ goes to zero with the root of the distance.
    """
    keep = slice(None) if component is None else field.component == component
    chosen = (field.segments.ray[keep], field.segments.start[keep], field.segments.end[keep])
    volume, total, above, least = _integrate(
        geometry,
        signs,
        frobenius,
        motor,
        threshold,
        field.origin,
        field.scale,
        field.rays.directions,
        field.rays.weights,
        chosen,
        _nodes(nodes),
    )
    cell = float(abs(np.prod(field.scale)))
    return Averages(cell * volume, cell * total, cell * above, least if volume > 0.0 else 0.0)
