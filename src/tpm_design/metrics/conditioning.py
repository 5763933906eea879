"""Local and global conditioning indices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tpm_design.mechanisms.base import MechanismKind
from tpm_design.metrics.base import Measurement, Metric, Option
from tpm_design.metrics.context import Context
from tpm_design.metrics.following import extreme_measurement, out_of_reach, singular
from tpm_design.workspace.averages import GAUSS_NODES, Averages, conditioning_averages
from tpm_design.workspace.indices import CONDITION_2, CONDITION_FROBENIUS, Index, index_values
from tpm_design.workspace.region_geometry import POINTS

SOURCE = "C. Gosselin, J. Angeles, A global performance index for the kinematic optimization, 1991"
NORM = Option("norm", "choice", "norm of the condition number", default="2", choices=("2", "frobenius"))
DRIVE = Option("drive", "choice", "actuators: motors or joints", default="motor", choices=("motor", "joint"))
OVER = Option("over", "choice", "domain", default="region", choices=("region", "aspect"))
THRESHOLD = Option("threshold", "number", "1/κ asked for", minimum=0.0, maximum=1.0, required=True)


def _incomparable(kind: MechanismKind, limits: Mapping[str, Any]) -> str | None:
    """A condition number compares motions of one unit, or made to be of one by a length."""
    if kind.translational or "characteristic_length" in limits:
        return None
    return (
        f"J of {kind.name} mixes rotations and translations: with `characteristic_length` among the limits, "
        "by which rotations are multiplied, κ is defined"
    )


def _no_volume(kind: MechanismKind, limits: Mapping[str, Any]) -> str | None:
    """A mean needs a measure of sets of poses."""
    return None if kind.translational else f"sets of poses of {kind.name} have no volume to average over"


def _index(context: Context, options: Mapping[str, Any]) -> Index:
    quantity = CONDITION_FROBENIUS if options["norm"] == "frobenius" else CONDITION_2
    return Index(quantity, motor=context.mechanism.motor_weight(options["drive"]))


def _averages(context: Context, options: Mapping[str, Any], threshold: float) -> tuple[Averages, Averages]:
    over_aspect = options["over"] == "aspect"
    return conditioning_averages(
        context.mechanism.geometry,
        context.mode.signs,
        context.aspects if over_aspect else context.region_aspects,
        largest=over_aspect,
        frobenius=options["norm"] == "frobenius",
        motor=context.mechanism.motor_weight(options["drive"]),
        threshold=threshold,
        nodes=GAUSS_NODES[options["over"]],
    )


def _minimum(context: Context, options: Mapping[str, Any]) -> Measurement:
    if options["over"] == "aspect":
        fine, coarse = _averages(context, options, 0.5)
        return Measurement(fine.least, abs(fine.least - coarse.least))
    if not context.reachable:
        # unreachable poses count as singular; the reach shortfall guides a search back
        return out_of_reach(context)
    worst = context.side_driven_by(options["drive"])
    if worst.margin <= 0.0:
        return singular(context, worst)
    return extreme_measurement(context, _index(context, options))


def _at_points(context: Context, options: Mapping[str, Any]) -> np.ndarray:
    values = index_values(
        context.mechanism.geometry, context.mode.signs, _index(context, options), context.poses
    )
    usable = context.mechanism.margins_at(context.poses, context.mode)["reach"] >= 0.0
    return np.where(usable, values, 0.0)


def _mean(context: Context, options: Mapping[str, Any]) -> Measurement:
    if options["over"] == "region" and context.placed.form == POINTS:
        return Measurement(float(_at_points(context, options).mean()))
    fine, coarse = (
        _share_of(context, options, averages, averages.conditioning, coarse)
        for coarse, averages in enumerate(_averages(context, options, 0.5))
    )
    return Measurement(fine, abs(fine - coarse))


def _share(context: Context, options: Mapping[str, Any]) -> Measurement:
    threshold = options["threshold"]
    if options["over"] == "region" and context.placed.form == POINTS:
        return Measurement(float((_at_points(context, options) >= threshold).mean()))
    fine, coarse = (
        _share_of(context, options, averages, averages.above, coarse)
        for coarse, averages in enumerate(_averages(context, options, threshold))
    )
    return Measurement(fine, abs(fine - coarse))


def _share_of(
    context: Context, options: Mapping[str, Any], averages: Averages, integral: float, coarse: int
) -> float:
    """Integral over the domain's whole volume: poses of the region out of reach count as 0."""
    over_region = options["over"] == "region"
    whole = context.region_aspects[coarse].whole if over_region else averages.volume
    # a domain that is whole may differ from its parts by rounding
    return min(1.0, integral / whole) if whole > 0.0 else 0.0


METRICS = (
    Metric(
        "conditioning_min", "-", "maximize", 1.0, "least 1/κ over the domain", SOURCE, _minimum,
        (NORM, DRIVE, OVER), refusal=_incomparable,
    ),
    Metric(
        "conditioning_mean", "-", "maximize", 1.0, "volume mean of 1/κ (GCI)", SOURCE, _mean,
        (NORM, DRIVE, OVER), refusal=_no_volume, cost="rays",
    ),
    Metric(
        "conditioning_share", "-", "maximize", 1.0, "share of the domain with 1/κ ≥ threshold", SOURCE,
        _share, (NORM, DRIVE, OVER, THRESHOLD), refusal=_no_volume, cost="rays",
    ),
)  # fmt: skip
