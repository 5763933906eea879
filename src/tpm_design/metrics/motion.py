"""How motion and length errors are passed on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tpm_design.mechanisms.base import MechanismKind
from tpm_design.metrics.base import Measurement, Metric, Option, of_positions
from tpm_design.metrics.context import Context
from tpm_design.metrics.following import extreme_measurement
from tpm_design.workspace.indices import FASTEST, SENSITIVITY, SLOWEST, TRANSMISSION, Index

DRIVE = Option("drive", "choice", "actuators: motors or joints", default="motor", choices=("motor", "joint"))


def _pushing(kind: MechanismKind) -> tuple[str, ...]:
    """The drive for which each limb pushes along its row."""
    return () if kind.transmission_drive is None else (kind.transmission_drive,)


def _no_transmission(kind: MechanismKind, limits: Mapping[str, Any]) -> str | None:
    if kind.transmission_drive is not None:
        return None
    return f"the limbs of {kind.name} do not each push along a row of A"


def _transmission(context: Context, options: Mapping[str, Any]) -> Measurement:
    if not context.reachable:
        return Measurement.undefined("the region is not reachable")
    return extreme_measurement(context, Index(TRANSMISSION))


def _extreme(quantity: int, sign: float) -> Callable[[Context, Mapping[str, Any]], Measurement]:
    def compute(context: Context, options: Mapping[str, Any]) -> Measurement:
        if not context.reachable:
            return Measurement.undefined("the region is not reachable")
        if sign < 0.0 and context.side_driven_by(options["drive"]).margin <= 0.0:
            return Measurement.undefined("unbounded: a singularity cuts the region")
        motor = context.mechanism.motor_weight(options["drive"])
        return extreme_measurement(context, Index(quantity, motor=motor, sign=sign))

    return compute


METRICS = (
    Metric(
        "velocity_min", "m/rad or -", "maximize", 1.0, "least singular value of J over the region",
        "singular values of ẋ = J q̇", _extreme(SLOWEST, 1.0), (DRIVE,), refusal=of_positions,
    ),
    Metric(
        "velocity_max", "m/rad or -", "minimize", 1.0, "greatest singular value of J over the region",
        "singular values of ẋ = J q̇", _extreme(FASTEST, -1.0), (DRIVE,), refusal=of_positions,
    ),
    Metric(
        "transmission_min", "-", "maximize", 1.0,
        "least input or output transmission index over the region",
        "J. Wang, C. Wu, X.-J. Liu, Performance evaluation of parallel manipulators, 2010",
        _transmission, (DRIVE,), refusal=_no_transmission, drives=_pushing, greatest=1.0,
    ),
    Metric(
        "position_sensitivity", "-", "minimize", 1.0,
        "largest ‖∂x/∂(length errors)‖ over the region, actuators locked",
        "loop closure differentiated in every length", _extreme(SENSITIVITY, -1.0), (DRIVE,),
        refusal=of_positions,
    ),
)  # fmt: skip
