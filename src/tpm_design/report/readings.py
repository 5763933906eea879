"""How a design stands to what was asked of it: every constraint's room, and what limits the design."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tpm_design.design_space import coordinate_of
from tpm_design.evaluation.result import Evaluation
from tpm_design.problem import Goal, Problem, Variable
from tpm_design.runs.entry import Entry
from tpm_design.runs.optimize import binding

AT_BOUND = 0.01
"""A constraint limits a design where its slack is within this share of its metric's scale."""

AT_END = 1e-6
"""A range limits a design where the quantity is this near to an end, as a share of its width."""


@dataclass(frozen=True)
class Reading:
    """One constraint at a design, SI. ``slack``: signed room to the bound, the numeric error taken off.
    ``bound``: the nearer one, ``above``: whether it is a lower bound. ``value`` is NaN where the metric has
    none."""

    goal: Goal
    value: float
    error: float
    slack: float
    bound: float
    above: bool

    @property
    def met(self) -> bool:
        return self.slack >= 0.0

    @property
    def binding(self) -> bool:
        return abs(self.slack) <= AT_BOUND * self.goal.metric.scale

    @property
    def share(self) -> float:
        """Slack as a share of the bound, of the metric's scale where the bound is 0."""
        return self.slack / (abs(self.bound) or self.goal.metric.scale)


def readings(problem: Problem, evaluation: Evaluation) -> tuple[Reading, ...]:
    """Every constraint in the study's order; none for a design that could not be evaluated."""
    return tuple(
        _reading(goal, evaluation) for goal in problem.constraints if goal.label in evaluation.slacks
    )


def _reading(goal: Goal, evaluation: Evaluation) -> Reading:
    value = evaluation.metrics.get(goal.label, math.nan)
    lower, upper = goal.minimum, goal.maximum
    above = upper is None or (lower is not None and not value - lower > upper - value)
    bound = lower if above else upper
    error = evaluation.errors.get(goal.label, math.nan)
    slack = evaluation.slacks[goal.label]
    return Reading(goal, value, error, slack, 0.0 if bound is None else bound, above)


def limiting(problem: Problem, entry: Entry) -> tuple[Goal, ...]:
    """The constraints at their bound."""
    return tuple(reading.goal for reading in readings(problem, entry.evaluation) if reading.binding)


def nearest_constraint(problem: Problem, entry: Entry) -> Reading | None:
    """The constraint of least scaled slack."""
    found = binding(problem, entry)
    if found is None:
        return None
    return next(r for r in readings(problem, entry.evaluation) if r.goal.label == found[0].label)


def at_end(problem: Problem, evaluation: Evaluation) -> tuple[Variable, ...]:
    """The continuous quantities at an end of their range."""
    continuous = [variable for variable in problem.variables if not variable.values]
    shares = [coordinate_of(variable, evaluation.design) for variable in continuous]
    return tuple(v for v, share in zip(continuous, shares, strict=True) if min(share, 1.0 - share) <= AT_END)
