"""By how much a design misses its goals."""

from __future__ import annotations

from collections.abc import Mapping

from tpm_design.evaluation.goals import UNDEFINED_VIOLATION, slack_pieces
from tpm_design.metrics.base import UNDEFINED, Measurement
from tpm_design.problem import Problem


def constraint_pieces(
    problem: Problem, measured: Mapping[str, Measurement], sampled: Mapping[str, tuple[float, ...]]
) -> dict[str, tuple[float, ...]]:
    """Of each constraint that was measured, those of the samples included."""
    return {
        goal.label: slack_pieces(goal, measured[goal.label]) + sampled.get(goal.label, ())
        for goal in problem.constraints
        if goal.label in measured
    }


def objective_pieces(problem: Problem, measured: Mapping[str, Measurement]) -> dict[str, tuple[float, ...]]:
    """Of each of several objectives that was measured: a search for a front bounds objectives too."""
    if len(problem.objectives) == 1:
        return {}
    return {g.label: measured[g.label].pieces for g in problem.objectives if g.label in measured}


def shortfalls(
    problem: Problem, measured: Mapping[str, Measurement], pieces: Mapping[str, tuple[float, ...]]
) -> dict[str, float]:
    """What each goal that was measured adds to the violation. ``pieces``: of the constraints."""
    scales = {goal.label: goal.metric.scale for goal in problem.constraints}
    short = {label: max(0.0, -min(values)) / scales[label] for label, values in pieces.items()}
    for goal in problem.objectives:
        if goal.label in measured and UNDEFINED in measured[goal.label].notes:
            short[goal.label] = UNDEFINED_VIOLATION
    return short
