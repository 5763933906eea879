"""Means and shares of the conditioning along the segments of a ray field."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

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


@inner
def _integrate(geometry, mode, frobenius, motor, threshold, origin, scale, field, nodes):  # type: ignore[no-untyped-def]
    """Integrals of ``Averages`` over all segments of a field of the component wanted, −1: of all."""
    directions, weights, rays, starts, ends, component, wanted = field
    places, shares = nodes
    volume, total, above, least = 0.0, 0.0, 0.0, math.inf
    for s in range(rays.size):
        if wanted >= 0 and component[s] != wanted:
            continue
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


@kernel
def _two_integrals(  # type: ignore[no-untyped-def]
    geometry, mode, frobenius, motor, threshold, origin, scale, fields, nodes
):
    """As ``_integrate``, of a fine field and a coarse one, each with its nodes."""
    return (
        _integrate(geometry, mode, frobenius, motor, threshold, origin, scale, fields[0], nodes[0]),
        _integrate(geometry, mode, frobenius, motor, threshold, origin, scale, fields[1], nodes[1]),
    )


@cache
def _nodes(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places in [0, 1] and weights, crowded at both ends of a segment."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    angles = 0.5 * np.pi * (nodes + 1.0)
    return 0.5 * (1.0 - np.cos(angles)), weights * 0.25 * np.pi * np.sin(angles)


def conditioning_averages(
    geometry: object,
    signs: object,
    fields: tuple[RayField, RayField],
    *,
    largest: bool,
    frobenius: bool,
    motor: float,
    threshold: float,
    nodes: tuple[int, int],
) -> tuple[Averages, Averages]:
    """Integrals of 1/κ over the ``largest`` component of a field, or over all its segments, by ``nodes``
    along each: of a fine field and of a coarse one of the same origin and scale.

    Nodes crowd at the ends of a segment, where 1/κ goes to zero with the root of the distance.
    """
    found = _two_integrals(
        geometry,
        signs,
        frobenius,
        motor,
        threshold,
        fields[0].origin,
        fields[0].scale,
        (_chosen(fields[0], largest), _chosen(fields[1], largest)),
        (_nodes(nodes[0]), _nodes(nodes[1])),
    )
    cell = float(abs(np.prod(fields[0].scale)))
    fine, coarse = (
        Averages(cell * volume, cell * total, cell * above, least if volume > 0.0 else 0.0)
        for volume, total, above, least in found
    )
    return fine, coarse


def _chosen(field: RayField, largest: bool) -> tuple[Any, ...]:
    """A field as ``_integrate`` takes it."""
    wanted = field.largest() if largest else None
    return (
        field.rays.directions,
        field.rays.weights,
        field.segments.ray,
        field.segments.start,
        field.segments.end,
        field.component,
        -1 if wanted is None else wanted,
    )
