"""How big the machine is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tpm_design.metrics.base import Measurement, Metric, Option
from tpm_design.metrics.context import Context
from tpm_design.metrics.following import span_measurement
from tpm_design.workspace.extents import field_extent
from tpm_design.workspace.indices import ACTUATOR, Index

OVER = Option("over", "choice", "poses considered", default="region", choices=("region", "aspect"))
DRIVE = Option("drive", "choice", "actuators: motors or joints", default="motor", choices=("motor", "joint"))
SOURCE = "by definition"


def _total_link_length(context: Context, options: Mapping[str, Any]) -> Measurement:
    return Measurement(
        context.mechanism.total_link_length(), near=lambda other: _total_link_length(other, options)
    )


def _robot_size(context: Context, options: Mapping[str, Any]) -> Measurement:
    if options["over"] == "aspect":
        fine, coarse = (
            field_extent(context.mechanism.geometry, context.mode.signs, field) for field in context.aspects
        )
        if fine is None:
            return Measurement.undefined("the mode has no reachable pose")
        return Measurement(fine, abs(fine - coarse) if coarse is not None else fine)
    if not context.reachable:
        return Measurement.undefined("the region is not reachable")
    return span_measurement(context, context.size)


def _actuator_range(context: Context, options: Mapping[str, Any]) -> Measurement:
    if not context.reachable:
        return Measurement.undefined("the region is not reachable")
    motor = context.mechanism.motor_weight(options["drive"])
    count = context.mechanism.kind.limb_count
    travel = context.widest([Index(ACTUATOR, part=part, motor=motor) for part in range(count)])
    return span_measurement(context, travel)


METRICS = (
    Metric(
        "total_link_length", "m", "minimize", 0.1, "sum over the limbs of the moving links", SOURCE,
        _total_link_length, needs_region=False, cost="closed form",
    ),
    Metric(
        "robot_size", "m", "minimize", 0.1,
        "longest side of the bounding box of every joint centre", SOURCE, _robot_size, (OVER,),
    ),
    Metric(
        "actuator_range", "rad or m", "minimize", 1.0, "longest actuator travel over the region", SOURCE,
        _actuator_range, (DRIVE,),
    ),
)  # fmt: skip
