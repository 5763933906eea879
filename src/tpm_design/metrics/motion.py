"""How motion and length errors are passed on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tpm_design.metrics.base import Measurement, Metric, Option
from tpm_design.metrics.context import Context
from tpm_design.workspace.indices import FASTEST, SENSITIVITY, SLOWEST, TRANSMISSION, Index

DRIVE = Option("drive", "choice", "actuators: motors or joints", default="motor", choices=("motor", "joint"))
JOINT_DRIVE = Option(
    "drive", "choice", "the index is not defined for motors", default="joint", choices=("joint",)
)


def _extreme(quantity: int, sign: float) -> Callable[[Context, Mapping[str, Any]], Measurement]:
    def compute(context: Context, options: Mapping[str, Any]) -> Measurement:
        if not context.reachable:
            return Measurement.undefined("the region is not reachable")
        if sign < 0.0 and context.side_driven_by(options["drive"]).margin <= 0.0:
            return Measurement.undefined("unbounded: a singularity cuts the region")
        motor = context.mechanism.motor_weight(options["drive"])
        found = context.least(Index(quantity, motor=motor, sign=sign))
        return Measurement(found.value, found.error, pieces=found.pieces)

    return compute


METRICS = (
    Metric(
        "velocity_min", "m/rad or -", "maximize", 1.0, "least singular value of J over the region",
        "singular values of ẋ = J q̇", _extreme(SLOWEST, 1.0), (DRIVE,),
    ),
    Metric(
        "velocity_max", "m/rad or -", "minimize", 1.0, "greatest singular value of J over the region",
        "singular values of ẋ = J q̇", _extreme(FASTEST, -1.0), (DRIVE,),
    ),
    Metric(
        "transmission_min", "-", "maximize", 1.0,
        "least input or output transmission index over the region",
        "J. Wang, C. Wu, X.-J. Liu, Performance evaluation of parallel manipulators, 2010",
        _extreme(TRANSMISSION, 1.0), (JOINT_DRIVE,),
    ),
    Metric(
        "position_sensitivity", "-", "minimize", 1.0,
        "largest ‖∂x/∂(length errors)‖ over the region, actuators locked",
        "loop closure differentiated in every length", _extreme(SENSITIVITY, -1.0), (DRIVE,),
    ),
)  # fmt: skip
