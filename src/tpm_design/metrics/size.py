"""How big the machine is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from tpm_design.metrics.base import Measurement, Metric, Option
from tpm_design.metrics.context import Context
from tpm_design.metrics.following import span_measurement
from tpm_design.metrics.moving_fields import MovingFields
from tpm_design.workspace.aspects import RayField
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
        return _size_over_aspect(context)
    if not context.reachable:
        return Measurement.undefined("the region is not reachable")
    return span_measurement(context, context.size)


def _size_over_aspect(context: Context) -> Measurement:
    one, other = (field.largest() for field in context.aspects)
    if one is None:
        return Measurement.undefined("the mode has no reachable pose")
    measured = _extent(context, context.aspects)
    if other is None:
        return measured
    moving = MovingFields(context.mechanism, context.mode, context.aspects, (one, other), 0.0)
    return replace(measured, near=partial(_extent_near, moving))


def _extent(context: Context, fields: tuple[RayField, RayField]) -> Measurement:
    fine, coarse = (field_extent(context.mechanism.geometry, context.mode.signs, field) for field in fields)
    if fine is None:
        raise ValueError("the fine field is empty")
    return Measurement(fine, abs(fine - coarse) if coarse is not None else fine)


def _extent_near(moving: MovingFields, neighbour: Context) -> Measurement:
    return _extent(neighbour, moving.near(neighbour))


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
