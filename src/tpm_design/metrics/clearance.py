"""How far the region stays from singularities, from the reach boundary, and limb from limb."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpm_design.computed_once import computed_once
from tpm_design.metrics.base import Measurement, Metric, Nearby, of_positions
from tpm_design.metrics.context import Context
from tpm_design.metrics.following import (
    extreme_measurement,
    in_one_piece,
    in_pieces,
    out_of_reach,
    pieces_of,
    reach_shortfall,
    sides_of,
    span_measurement,
)
from tpm_design.metrics.neighbourhood import Neighbourhood
from tpm_design.workspace.indices import CLEARANCE, LEGS, SERIAL, Index
from tpm_design.workspace.loci import LocusDistance
from tpm_design.workspace.locus_motion import LocusMotion, locus_motion

CROSSED = 1e-6
"""Distance between the middles of links, as a share of the machine's radius, up to which they cross."""

SEARCH = "search along the region's normals, then sliding along the locus, ARCHITECTURE.md"


def _locus_distance(name: str) -> Callable[[Context, Mapping[str, Any]], Measurement]:
    def compute(context: Context, options: Mapping[str, Any]) -> Measurement:
        if not context.reachable:
            # without pieces: distances to a locus have none
            return replace(in_one_piece(reach_shortfall(context)), notes={"locus": "out of reach"})
        if name not in context.mechanism.kind.determinants:
            return replace(span_measurement(context, context.size), notes={"locus": "none"})
        part = context.mechanism.kind.determinants.index(name)
        found = context.locus_distance(part)
        if found.pose is None:
            return replace(span_measurement(context, context.size), notes={"locus": "none"})
        here = Measurement(found.value, found.error, notes={"locus": name})
        return replace(here, near=_MovingLocus(context, part, found).near)

    return compute


@dataclass(frozen=True)
class _MovingLocus:
    """The distance to a locus, as it was ``found`` in a context, for neighbouring designs. How the locus
    moves is found when one first asks."""

    context: Context
    part: int
    found: LocusDistance

    @computed_once
    def _motion(self) -> LocusMotion | None:
        own = self.context
        return locus_motion(own.mechanism, own.mode, own.placed, self.part, self.found)

    def near(self, neighbours: Neighbourhood) -> Nearby:
        return Nearby(neighbours.each(self._distance), errors=self.found.error)

    def _distance(self, neighbour: Context) -> float:
        motion = self._motion
        return math.nan if motion is None else motion.distance(neighbour.mechanism, neighbour.placed)


def _boundary_distance(context: Context, options: Mapping[str, Any]) -> Measurement:
    if not context.reachable:
        return reach_shortfall(context)
    # the leg margins are the distances to the shells, so their least value is the distance to the nearest
    return extreme_measurement(context, Index(LEGS))


def _singularity_margin_min(context: Context, options: Mapping[str, Any]) -> Measurement:
    if not context.reachable:
        return out_of_reach(context)
    serial = context.least(Index(SERIAL))
    margins = [(serial.value, serial.error), *((side.margin, side.error) for side in context.sides)]
    value, error = min(margins)
    of_serial, of_sides = pieces_of(context, Index(SERIAL), serial), sides_of(context)

    def near(others: Neighbourhood) -> Nearby:
        values = np.minimum(of_serial(others).min(axis=1), of_sides(others).min(axis=(1, 2)))
        return Nearby(np.maximum(0.0, values), errors=error, depths=np.minimum(0.0, values))

    return Measurement(max(0.0, value), error, depth=min(0.0, value), near=near)


def _link_clearance(context: Context, options: Mapping[str, Any]) -> Measurement:
    if not context.reachable:
        return Measurement.undefined("the region is not reachable")
    index = Index(CLEARANCE)
    found = context.least(index)
    moving = pieces_of(context, index, found)
    # links that cross are 0 apart, and so they are in every neighbouring design
    apart = np.array(found.pieces) + 2.0 * context.mechanism.geometry.link_radius
    crossed = apart < CROSSED * context.mechanism.reach_radius()
    return in_pieces(found, 1.0, lambda others: np.where(crossed, found.pieces, moving(others)))


def _distance(name: str, condition: str) -> Metric:
    return Metric(
        f"{name}_singularity_distance", "m", "maximize", 0.1,
        f"least Euclidean distance from the region to {condition}; minus the depth where it cuts in",
        SEARCH, _locus_distance(name), differentiable=False, notes=("locus",), refusal=of_positions,
        cost="locus",
    )  # fmt: skip


METRICS = (
    _distance("translation", "det V = 0"),
    _distance("actuation", "det W = 0"),
    _distance("rotation", "det H = 0"),
    Metric(
        "boundary_distance", "m", "maximize", 0.1,
        "least Euclidean distance from the region to the reach boundary", SEARCH, _boundary_distance,
        refusal=of_positions,
    ),
    Metric(
        "singularity_margin_min", "-", "maximize", 1.0,
        "least dimensionless margin over the region, serial singularities included", SEARCH,
        _singularity_margin_min,
    ),
    Metric(
        "link_clearance", "m", "maximize", 0.1,
        "least distance between links of different limbs, less the link diameters, over the region",
        "links as capsules", _link_clearance,
    ),
)  # fmt: skip
