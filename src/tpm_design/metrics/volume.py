"""How much space the mechanism commands: volumes and coverage."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from tpm_design.metrics.base import Measurement, Metric, Option, of_positions
from tpm_design.metrics.context import Context
from tpm_design.metrics.following import reach_of, sides_of, span_measurement
from tpm_design.metrics.moving_fields import MovingFields
from tpm_design.workspace.aspects import RayField
from tpm_design.workspace.region_geometry import POINTS
from tpm_design.workspace.volume import selected_volume

RAYS = "volume by Gauss–Legendre rays, ARCHITECTURE.md"
MARGIN = Option(
    "margin", "number", "least |margin| of every determinant", default=0.0, minimum=0.0, maximum=0.999
)
HOME = Option("home", "point", "the aspect that holds this pose instead of the largest one")


def _reachable_volume(context: Context, options: Mapping[str, Any]) -> Measurement:
    fields = context.mode_rays(0.0, sided=False)
    fine, coarse = (selected_volume(field, largest_only=False) for field in fields)
    moving = MovingFields(context.mechanism, context.mode, fields, (None, None), None)
    return Measurement(fine, abs(fine - coarse), near=partial(_volume_near, moving))


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
        near = partial(_volume_near, moving)
    return Measurement(fine, abs(fine - coarse), near=near)


def _volume_near(moving: MovingFields, neighbour: Context) -> Measurement:
    fine, coarse = (float(np.sum(field.volumes)) for field in neighbour.moved(moving))
    return Measurement(fine, abs(fine - coarse))


def _workspace_ratio(context: Context, options: Mapping[str, Any]) -> Measurement:
    volume = _singularity_free_volume(context, {"margin": 0.0, "home": None})
    if not context.reachable:
        return Measurement.undefined("the region is not reachable, so the robot's size is not known")
    size = span_measurement(context, context.size)
    of_volume, of_size = volume.near, size.near
    if of_volume is None or of_size is None:
        return _ratio(volume, size)
    return replace(_ratio(volume, size), near=lambda other: _ratio(of_volume(other), of_size(other)))


def _ratio(volume: Measurement, size: Measurement) -> Measurement:
    ratio = volume.value / size.value**3
    return Measurement(ratio, volume.error / size.value**3 + 3.0 * ratio * size.error / size.value)


def _coverage(context: Context, options: Mapping[str, Any]) -> Measurement:
    length = context.mechanism.reach_radius()
    reach = tuple(piece / length for piece in context.reach.pieces)
    slacks = (*reach, *(piece for side in context.sides for piece in side.pieces))
    worst = min(slacks)
    of_reach, of_sides = reach_of(context), sides_of(context)

    def near(other: Context) -> Measurement:
        shares = of_reach(other) / other.mechanism.reach_radius()
        values = np.concatenate([shares, of_sides(other).ravel()])
        share = 1.0 if worst >= 0.0 else math.nan
        return Measurement(share, full_slacks=tuple(values.tolist()))

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
    codes = field.sides
    shared = np.flatnonzero(np.bincount(codes)[codes] > 1)
    aspects = np.zeros_like(codes)
    if shared.size:
        aspects[shared] = context.aspects_of(context.aspects[0], field.middles[shared])
        # what lies in no aspect is joined with nothing
        lost = shared[aspects[shared] < 0]
        aspects[lost] = -1 - lost
    totals: dict[tuple[int, int], float] = {}
    for key, volume in zip(zip(codes.tolist(), aspects.tolist(), strict=True), field.volumes, strict=True):
        totals[key] = totals.get(key, 0.0) + float(volume)
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
