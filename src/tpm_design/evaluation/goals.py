"""What a measurement means for one goal."""

from __future__ import annotations

import math

from tpm_design.metrics.base import UNDEFINED, Measurement
from tpm_design.metrics.context import Context
from tpm_design.problem import Goal

UNDEFINED_VIOLATION = 1.0
"""What a goal without a value adds to the violation."""


def measure(context: Context, goal: Goal) -> Measurement:
    """A goal's metric with its options. Raises what the metric raises, and ArithmeticError where a value that
    should be defined is not finite."""
    options = {option.name: goal.options.get(option.name, option.default) for option in goal.metric.options}
    measurement = goal.metric.compute(context, options)
    value, error = measurement.value, measurement.error
    if UNDEFINED not in measurement.notes and not (math.isfinite(value) and math.isfinite(error)):
        raise ArithmeticError(f"{goal.label} is {value!r} with error {error!r}")
    return measurement


def scaled_objective(goal: Goal, value: float) -> float:
    """An objective's value (SI) over its scale, turned so that less is better."""
    return (value if goal.sense == "minimize" else -value) / goal.metric.scale


def slack_pieces(goal: Goal, measurement: Measurement) -> tuple[float, ...]:
    """Signed distances of a constraint to its bound, less the numeric error: met where all are ≥ 0. In the
    metric's unit, or as the metric defines them where its value is flat."""
    if UNDEFINED in measurement.notes:
        return (-UNDEFINED_VIOLATION * goal.metric.scale,)
    if measurement.full_slacks and goal.minimum is not None and goal.minimum >= 1.0:
        return measurement.full_slacks
    return tuple(_slack(goal, measurement, value) for value in measurement.pieces or (measurement.value,))


def _slack(goal: Goal, measurement: Measurement, value: float) -> float:
    below = math.inf if goal.minimum is None else value - measurement.error - goal.minimum
    above = math.inf if goal.maximum is None else goal.maximum - value - measurement.error
    least = min(below, above)
    return least + measurement.depth if least < 0.0 else least
