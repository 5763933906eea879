"""Means and shares of the conditioning along the segments of a ray field."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel
from tpm_design.workspace.aspects import RayField
from tpm_design.workspace.indices import condition_at
from tpm_design.workspace.rays import MOST_STEPS, next_share, step_of

# along a segment, fine and coarse: 1/κ has kinks where singular values change places
GAUSS_NODES = {"region": (8, 6), "aspect": (16, 12)}


class Crossings(NamedTuple):
    """Of S segments: whether 1/κ is above the threshold where they begin and end (S,). Of the K places where
    it passes the threshold: the index ``segment`` (K,) among these, ray parameter ``t`` (K,), and ``sign``
    (K,) +1 where a part above ends, −1 where one begins."""

    begins_above: NDArray[np.bool_]
    ends_above: NDArray[np.bool_]
    segment: NDArray[np.int64]
    t: NDArray[np.float64]
    sign: NDArray[np.float64]


@dataclass(frozen=True)
class Averages:
    """Integrals over the chosen segments (m³): of 1, of 1/κ, of [1/κ ≥ threshold]; least 1/κ met; where it
    passes the threshold."""

    volume: float
    conditioning: float
    above: float
    least: float
    crossings: Crossings


@inner
def condition_along(geometry, mode, frobenius, motor, origin, step, t):  # type: ignore[no-untyped-def]
    """1/κ on a ray."""
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
def _crossing(geometry, mode, frobenius, motor, threshold, origin, step, a, b, fa, fb):  # type: ignore[no-untyped-def]
    """Ray parameter between ``a`` and ``b`` where 1/κ is the threshold; ``fa``, ``fb``: how far above."""
    t = 0.5 * (a + b)
    for _ in range(MOST_STEPS):
        value = condition_along(geometry, mode, frobenius, motor, origin, step, t) - threshold
        c, fc = a, fa
        if (value >= 0.0) != (fa >= 0.0):
            c, fc, b, fb = b, fb, a, fa
        a, fa = t, value
        tolerance = 1e-14 * max(abs(a), abs(b))
        if fa == 0.0 or abs(b - a) <= tolerance:
            break
        t = a + next_share(a, fa, b, fb, c, fc, tolerance) * (b - a)
    return a


@inner
def _scanned(  # type: ignore[no-untyped-def]
    geometry, mode, frobenius, motor, threshold, origin, step, start, end, places, values, crossings
):
    """Write 1/κ just inside the start of a segment, at the places along it and just inside its end (P + 2),
    and the ray parameters between these where it passes the threshold (up to P + 1), in order; how many."""
    length = end - start
    count, low = 0, start
    for k in range(values.size):
        if k == 0:
            t = start + 1e-9 * length
        elif k == values.size - 1:
            t = end - 1e-9 * length
        else:
            t = start + length * places[k - 1]
        values[k] = condition_along(geometry, mode, frobenius, motor, origin, step, t)
        if k > 0 and (values[k] < threshold) != (values[k - 1] < threshold):
            below, here = values[k - 1] - threshold, values[k] - threshold
            crossings[count] = _crossing(
                geometry, mode, frobenius, motor, threshold, origin, step, low, t, below, here
            )
            count += 1
        low = t
    return count


@inner
def _integrate(geometry, mode, frobenius, motor, threshold, origin, scale, field, nodes):  # type: ignore[no-untyped-def]
    """Integrals of ``Averages`` over all segments of a field of the component wanted, −1: of all; and the
    members of ``Crossings``."""
    directions, weights, rays, starts, ends, component, wanted = field
    places, shares = nodes
    values, crossings = np.empty(places.size + 2), np.empty(places.size + 1)
    volume, total, above, least = 0.0, 0.0, 0.0, math.inf
    begins_above, ends_above = np.empty(rays.size, np.bool_), np.empty(rays.size, np.bool_)
    most = rays.size * crossings.size
    segment, t_passed, sign = np.empty(most, np.int64), np.empty(most), np.empty(most)
    chosen, passed = 0, 0
    for s in range(rays.size):
        if wanted >= 0 and component[s] != wanted:
            continue
        ray, start, end = rays[s], starts[s], ends[s]
        step = step_of(scale, directions[ray])
        count = _scanned(
            geometry, mode, frobenius, motor, threshold, origin, step, start, end, places, values, crossings
        )
        for value in values:
            least = min(least, value)
        inside = 0.0
        for k in range(places.size):
            t = start + (end - start) * places[k]
            inside += shares[k] * (end - start) * t * t * values[k + 1]
        total += weights[ray] * inside
        volume += weights[ray] * (end**3 - start**3) / 3.0
        # ∫ t² dt over the parts above the threshold: + t³/3 where one ends, − t³/3 where one begins
        is_above = values[0] >= threshold
        begins_above[chosen] = is_above
        part = -(start**3) if is_above else 0.0
        for k in range(count):
            segment[passed], t_passed[passed] = chosen, crossings[k]
            sign[passed] = 1.0 if is_above else -1.0
            passed += 1
            part += crossings[k] ** 3 if is_above else -(crossings[k] ** 3)
            is_above = not is_above
        ends_above[chosen] = is_above
        chosen += 1
        above += weights[ray] * (part + (end**3 if is_above else 0.0)) / 3.0
    found = begins_above[:chosen], ends_above[:chosen], segment[:passed], t_passed[:passed], sign[:passed]
    return volume, total, above, least, found


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
def ray_nodes(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
        (ray_nodes(nodes[0]), ray_nodes(nodes[1])),
    )
    cell = float(abs(np.prod(fields[0].scale)))
    fine, coarse = (
        Averages(
            cell * volume, cell * total, cell * above, least if volume > 0.0 else 0.0, Crossings(*crossings)
        )
        for volume, total, above, least, crossings in found
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
