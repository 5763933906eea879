"""How much space the mechanism commands: volumes and coverage."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping
from functools import partial
from typing import Any, TypeVar

import numpy as np

from tpm_design.metrics.base import FloatArray, Measurement, Metric, Nearby, Option, of_positions
from tpm_design.metrics.context import Context
from tpm_design.metrics.following import by_two_orders, reach_of, sides_of, span_measurement
from tpm_design.metrics.moving_fields import MovingFields
from tpm_design.metrics.neighbourhood import Neighbourhood
from tpm_design.workspace.aspects import RayField
from tpm_design.workspace.region_geometry import POINTS
from tpm_design.workspace.volume import selected_volume

Number = TypeVar("Number", float, FloatArray | float)

RAYS = "volume by Gauss–Legendre rays, ARCHITECTURE.md"
MARGIN = Option(
    "margin", "number", "least |margin| of every determinant", default=0.0, minimum=0.0, maximum=0.999
)
HOME = Option("home", "point", "the aspect that holds this pose instead of the largest one")


def _reachable_volume(context: Context, options: Mapping[str, Any]) -> Measurement:
    fields = context.mode_rays(0.0, sided=False)
    fine, coarse = (selected_volume(field, largest_only=False) for field in fields)
    moving = MovingFields(context.mechanism, context.mode, fields, (None, None), None)
    return Measurement(fine, abs(fine - coarse), near=by_two_orders(partial(_volumes_near, moving)))


def _singularity_free_volume(context: Context, options: Mapping[str, Any]) -> Measurement:
    margin, home = options["margin"], options["home"]
    fields = context.aspects if margin == 0.0 else context.mode_rays(margin, sided=True)
    one, other = (field.largest() if home is None else context.aspect_of(field, home) for field in fields)
    fine, coarse = (
        0.0 if chosen is None else float(field.volumes[chosen])
        for field, chosen in zip(fields, (one, other), strict=True)
    )
    near = None
    if one is not None and other is not None:
        moving = context.moving_aspects if margin == 0.0 and home is None else None
        if moving is None:
            moving = MovingFields(context.mechanism, context.mode, fields, (one, other), margin)
        near = by_two_orders(partial(_volumes_near, moving))
    return Measurement(fine, abs(fine - coarse), near=near)


def _volumes_near(moving: MovingFields, neighbour: Context) -> tuple[float, float]:
    fine, coarse = (float(np.sum(field.volumes)) for field in neighbour.moved(moving))
    return fine, coarse


def _workspace_ratio(context: Context, options: Mapping[str, Any]) -> Measurement:
    volume = _singularity_free_volume(context, {"margin": 0.0, "home": None})
    if not context.reachable:
        return Measurement.undefined("the region is not reachable, so the robot's size is not known")
    size = span_measurement(context, context.size)
    of_volume, of_size = volume.near, size.near
    ratio = volume.value / size.value**3
    error = _ratio_error(ratio, volume.error, size.value, size.error)
    if of_volume is None or of_size is None:
        return Measurement(ratio, error)

    def near(others: Neighbourhood) -> Nearby:
        volumes, sizes = of_volume(others), of_size(others)
        ratios = volumes.values / sizes.values**3
        return Nearby(ratios, errors=_ratio_error(ratios, volumes.errors, sizes.values, sizes.errors))

    return Measurement(ratio, error, near=near)


def _ratio_error(ratio: Number, volume_error: Number, size: Number, size_error: Number) -> Number:
    return volume_error / size**3 + 3.0 * ratio * size_error / size


def _coverage(context: Context, options: Mapping[str, Any]) -> Measurement:
    length = context.mechanism.reach_radius()
    reach = tuple(piece / length for piece in context.reach.pieces)
    slacks = (*reach, *(piece for side in context.sides for piece in side.pieces))
    worst = min(slacks)
    of_reach, of_sides = reach_of(context), sides_of(context)

    def near(others: Neighbourhood) -> Nearby:
        shares, sides = of_reach(others) / others.radii[:, None], of_sides(others)
        values = np.full(len(shares), 1.0 if worst >= 0.0 else math.nan)
        return Nearby(values, full_slacks=np.hstack([shares, sides.reshape(len(sides), -1)]))

    if worst >= 0.0:
        return Measurement(1.0, 0.0, full_slacks=slacks, near=near)
    fine, coarse = _point_shares(context) if context.placed.form == POINTS else _solid_shares(context)
    # what the samples' polish found outside is smaller than the rays resolve
    share = min(fine, 1.0 - RESOLUTION)
    error = max(abs(fine - coarse), RESOLUTION)
    return Measurement(share, error, full_slacks=slacks, near=near)


RESOLUTION = 1e-6


def _solid_shares(context: Context) -> tuple[float, float]:
    fine, coarse = (_largest_share(context, field) for field in context.region_aspects)
    return fine, coarse


def _largest_share(context: Context, field: RayField) -> float:
    """Share of the region in one aspect; parts of equal sides may be joined outside the region."""
    if not field.volumes.size:
        return 0.0
    codes = field.sides.tolist()
    times = Counter(codes)
    shared = [part for part, code in enumerate(codes) if times[code] > 1]
    aspects = [0] * len(codes)
    if shared:
        found = context.aspects_of(context.aspects[0], field.middles[shared])
        for part, aspect in zip(shared, found.tolist(), strict=True):
            # what lies in no aspect is joined with nothing
            aspects[part] = aspect if aspect >= 0 else -1 - part
    totals: dict[tuple[int, int], float] = defaultdict(float)
    for key, volume in zip(zip(codes, aspects, strict=True), field.volumes.tolist(), strict=True):
        totals[key] += volume
    return max(totals.values()) / field.whole


def _point_shares(context: Context) -> tuple[float, float]:
    found = context.aspects_of(context.aspects[0], context.poses)
    share = int(np.bincount(found[found >= 0]).max(initial=0)) / found.size
    return share, share


METRICS = (
    Metric(
        "reachable_volume", "m³", "maximize", 0.1, "volume of the mode's reachable poses", RAYS,
        _reachable_volume, needs_region=False, refusal=of_positions, cost="rays",
    ),
    Metric(
        "singularity_free_volume", "m³", "maximize", 0.1,
        "volume of the largest aspect, or of the one that holds `home`", RAYS,
        _singularity_free_volume, (MARGIN, HOME), needs_region=False, refusal=of_positions, cost="rays",
    ),
    Metric(
        "coverage", "-", "maximize", 1.0,
        "largest share of the region that lies in one aspect; 1 when all of it does", RAYS, _coverage,
        cost="rays", greatest=1.0,
    ),
    Metric(
        "workspace_ratio", "-", "maximize", 1.0, "singularity-free volume over robot_size³", RAYS,
        _workspace_ratio, refusal=of_positions, cost="rays",
    ),
)  # fmt: skip
