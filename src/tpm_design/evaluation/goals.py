"""What a measurement means for one goal."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

from tpm_design.metrics.base import UNDEFINED, FloatArray, Measurement
from tpm_design.metrics.context import Context
from tpm_design.metrics.neighbourhood import Neighbourhood
from tpm_design.problem import Goal

Number = TypeVar("Number", float, FloatArray)

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
    if measurement.full_slacks and _asks_for_all(goal):
        return measurement.full_slacks
    return tuple(
        least + measurement.depth if least < 0.0 else least
        for least in (
            min(_distances(goal, value, measurement.error))
            for value in measurement.pieces or (measurement.value,)
        )
    )


def slacks_near(goal: Goal, measurement: Measurement, designs: Neighbourhood) -> FloatArray | None:
    """As ``slack_pieces``, of N neighbouring designs (N, P); None where nothing is known of them."""
    if UNDEFINED in measurement.notes:
        return np.full((len(designs.contexts), 1), -UNDEFINED_VIOLATION * goal.metric.scale)
    if measurement.near is None:
        return None
    near = measurement.near(designs)
    if near.full_slacks is not None and _asks_for_all(goal):
        return near.full_slacks
    values = near.values[:, None] if near.pieces is None else near.pieces
    errors, depths = (np.reshape(each, (-1, 1)) for each in (near.errors, near.depths))
    least = np.minimum.reduce(_distances(goal, values, errors))
    return np.asarray(np.where(least < 0.0, least + depths, least))


def _asks_for_all(goal: Goal) -> bool:
    return goal.minimum is not None and goal.minimum >= 1.0


def _distances(goal: Goal, value: Number, error: Number) -> list[Number]:
    """To each bound, less the error."""
    below = [] if goal.minimum is None else [value - error - goal.minimum]
    above = [] if goal.maximum is None else [goal.maximum - value - error]
    return below + above
