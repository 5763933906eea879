"""How big the machine is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tpm_design.computed_once import computed_once
from tpm_design.metrics.base import Measurement, Metric, Nearby, Option
from tpm_design.metrics.context import Context
from tpm_design.metrics.following import by_two_orders, span_measurement
from tpm_design.metrics.moving_fields import MovingFields
from tpm_design.workspace.extents import extent_of_segments, field_extent, outermost_segments
from tpm_design.workspace.indices import ACTUATOR, Index

OVER = Option("over", "choice", "poses considered", default="region", choices=("region", "aspect"))
DRIVE = Option("drive", "choice", "actuators: motors or joints", default="motor", choices=("motor", "joint"))
SOURCE = "by definition"


def _total_link_length(context: Context, options: Mapping[str, Any]) -> Measurement:
    return Measurement(_links(context), near=lambda others: Nearby(others.each(_links)))


def _links(context: Context) -> float:
    return context.mechanism.total_link_length()


def _robot_size(context: Context, options: Mapping[str, Any]) -> Measurement:
    if options["over"] == "aspect":
        return _size_over_aspect(context)
    if not context.reachable:
        return Measurement.undefined("the region is not reachable")
    return span_measurement(context, context.size)


def _size_over_aspect(context: Context) -> Measurement:
    geometry, signs = context.mechanism.geometry, context.mode.signs
    fine, coarse = (field_extent(geometry, signs, field) for field in context.aspects)
    if fine is None:
        return Measurement.undefined("the mode has no reachable pose")
    if coarse is None or context.moving_aspects is None:
        return Measurement(fine, fine)
    moving = _MovingExtent(context.moving_aspects)
    return Measurement(fine, abs(fine - coarse), near=by_two_orders(moving.fine_and_coarse))


@dataclass(frozen=True)
class _MovingExtent:
    """The bounding boxes of ``moving`` fields for neighbouring designs: by the segments that touch them,
    which are found when a neighbour first asks."""

    moving: MovingFields

    @computed_once
    def _outermost(self) -> tuple[NDArray[np.intp], ...]:
        machine, mode = self.moving.mechanism, self.moving.mode
        return tuple(
            outermost_segments(machine.geometry, mode.signs, b.field) for b in self.moving.boundaries
        )

    def fine_and_coarse(self, neighbour: Context) -> tuple[float, float]:
        geometry, signs = neighbour.mechanism.geometry, neighbour.mode.signs
        fine, coarse = (
            extent_of_segments(geometry, signs, field, segments)
            for field, segments in zip(neighbour.moved(self.moving), self._outermost, strict=True)
        )
        return fine, coarse


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
