"""Local and global conditioning indices."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from tpm_design.computed_once import computed_once
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.metrics.base import Measurement, Metric, Nearby, Option
from tpm_design.metrics.context import Context
from tpm_design.metrics.following import by_two_orders, extreme_measurement, out_of_reach, singular
from tpm_design.metrics.moving_fields import MovingFields
from tpm_design.workspace.aspects import RayField
from tpm_design.workspace.averages import GAUSS_NODES, Averages, conditioning_averages
from tpm_design.workspace.indices import CONDITION_2, CONDITION_FROBENIUS, Index, index_values
from tpm_design.workspace.moving_level import MovingLevel, moving_level, volume_above_near
from tpm_design.workspace.moving_mean import MovingMean, integral_near, moving_mean
from tpm_design.workspace.region_geometry import POINTS

Moving = TypeVar("Moving", MovingMean, MovingLevel)

SOURCE = "C. Gosselin, J. Angeles, A global performance index for the kinematic optimization, 1991"
NORM = Option("norm", "choice", "norm of the condition number", default="2", choices=("2", "frobenius"))
DRIVE = Option("drive", "choice", "actuators: motors or joints", default="motor", choices=("motor", "joint"))
OVER = Option("over", "choice", "domain", default="region", choices=("region", "aspect"))
THRESHOLD = Option("threshold", "number", "1/κ asked for", minimum=0.0, maximum=1.0, required=True)


# nothing is below it: no crossings are looked for
NO_THRESHOLD = 0.0


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


def _averages(
    context: Context,
    options: Mapping[str, Any],
    fields: tuple[RayField, RayField],
    threshold: float = NO_THRESHOLD,
) -> tuple[Averages, Averages]:
    return conditioning_averages(
        context.mechanism.geometry,
        context.mode.signs,
        fields,
        largest=options["over"] == "aspect",
        frobenius=options["norm"] == "frobenius",
        motor=context.mechanism.motor_weight(options["drive"]),
        threshold=threshold,
        nodes=GAUSS_NODES[options["over"]],
    )


def _minimum(context: Context, options: Mapping[str, Any]) -> Measurement:
    if options["over"] == "aspect":
        fine, coarse = _averages(context, options, context.aspects)
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
        mean = partial(_mean_at_points, options)
        return Measurement(mean(context), near=lambda others: Nearby(others.each(mean)))
    fields = _fields(context, options)
    found = _averages(context, options, fields)
    fine, coarse = (
        _share_of(options, each.conditioning, each.volume, field)
        for each, field in zip(found, fields, strict=True)
    )
    moving = _moving(context, options)
    near = None if moving is None else by_two_orders(MovingConditioning(moving, options, found).means_near)
    return Measurement(fine, abs(fine - coarse), near=near)


def _mean_at_points(options: Mapping[str, Any], context: Context) -> float:
    return float(_at_points(context, options).mean())


def _share(context: Context, options: Mapping[str, Any]) -> Measurement:
    threshold = options["threshold"]
    if options["over"] == "region" and context.placed.form == POINTS:
        return Measurement(float((_at_points(context, options) >= threshold).mean()))
    fields = _fields(context, options)
    found = _averages(context, options, fields, threshold)
    fine, coarse = (
        _share_of(options, each.above, each.volume, field) for each, field in zip(found, fields, strict=True)
    )
    moving = _moving(context, options)
    near = None if moving is None else by_two_orders(MovingConditioning(moving, options, found).shares_near)
    return Measurement(fine, abs(fine - coarse), near=near)


@dataclass(frozen=True)
class MovingConditioning:
    """1/κ in the ``moving`` fields of a design, for its neighbours. Singular vectors, and how 1/κ goes where
    it passes the threshold, are found when one first asks."""

    moving: MovingFields
    options: Mapping[str, Any]
    averages: tuple[Averages, Averages]

    @computed_once
    def _means(self) -> tuple[MovingMean, ...]:
        machine, mode, frobenius, motor = self._measured_by
        nodes = GAUSS_NODES[self.options["over"]]
        return tuple(
            moving_mean(machine, mode, boundary.field, frobenius=frobenius, motor=motor, nodes=count)
            for boundary, count in zip(self.moving.boundaries, nodes, strict=True)
        )

    @computed_once
    def _levels(self) -> tuple[MovingLevel, ...]:
        machine, mode, frobenius, motor = self._measured_by
        return tuple(
            moving_level(machine, mode, boundary.field, found.crossings, frobenius=frobenius, motor=motor)
            for boundary, found in zip(self.moving.boundaries, self.averages, strict=True)
        )

    @property
    def _measured_by(self) -> tuple[Mechanism, Mode, bool, float]:
        """Machine, mode, whether by the Frobenius norm, and the motors' weight."""
        machine = self.moving.mechanism
        motor = machine.motor_weight(self.options["drive"])
        return machine, self.moving.mode, self.options["norm"] == "frobenius", motor

    def means_near(self, neighbour: Context) -> tuple[float, float]:
        return self._shares(integral_near, self._means, neighbour)

    def shares_near(self, neighbour: Context) -> tuple[float, float]:
        return self._shares(volume_above_near, self._levels, neighbour)

    def _shares(
        self,
        integral: Callable[[Moving, Mechanism, RayField], float],
        moving: Sequence[Moving],
        neighbour: Context,
    ) -> tuple[float, float]:
        fine, coarse = (
            _share_of(
                self.options, integral(one, neighbour.mechanism, field), float(np.sum(field.volumes)), field
            )
            for one, field in zip(moving, neighbour.moved(self.moving), strict=True)
        )
        return fine, coarse


def _fields(context: Context, options: Mapping[str, Any]) -> tuple[RayField, RayField]:
    return context.aspects if options["over"] == "aspect" else context.region_aspects


def _moving(context: Context, options: Mapping[str, Any]) -> MovingFields | None:
    """The fields that integrals are taken over, ready to be moved; None where one of them is empty."""
    return context.moving_aspects if options["over"] == "aspect" else context.moving_region_aspects


def _share_of(options: Mapping[str, Any], integral: float, volume: float, field: RayField) -> float:
    """Integral over the domain's whole volume: poses of the region out of reach count as 0."""
    whole = field.whole if options["over"] == "region" else volume
    # a domain that is whole may differ from its parts by rounding
    return min(1.0, integral / whole) if whole > 0.0 else 0.0


METRICS = (
    Metric(
        "conditioning_min", "-", "maximize", 1.0, "least 1/κ over the domain", SOURCE, _minimum,
        (NORM, DRIVE, OVER), refusal=_incomparable, greatest=1.0,
    ),
    Metric(
        "conditioning_mean", "-", "maximize", 1.0, "volume mean of 1/κ (GCI)", SOURCE, _mean,
        (NORM, DRIVE, OVER), refusal=_no_volume, cost="rays", greatest=1.0,
    ),
    Metric(
        "conditioning_share", "-", "maximize", 1.0, "share of the domain with 1/κ ≥ threshold", SOURCE,
        _share, (NORM, DRIVE, OVER, THRESHOLD), refusal=_no_volume, cost="rays", greatest=1.0,
    ),
)  # fmt: skip
