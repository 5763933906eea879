"""Which of several evaluated designs is better."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from tpm_design.evaluation.goals import scaled_objective
from tpm_design.evaluation.result import Cutoff, Evaluation
from tpm_design.problem import Goal, Problem
from tpm_design.runs.entry import Entry, design_key
from tpm_design.runs.front import knee, non_dominated

FAILED = 1e6
"""Objective and shortfall given to an optimiser for a design that could not be measured."""


def rank(problem: Problem, entry: Entry) -> tuple[float, float, int]:
    """Sorts entries: feasible ones first by objective, then by violation; ties by number. Aborted ones, whose
    violation is not known, come after those."""
    objective = minimised(problem, entry.evaluation)
    if entry.evaluation.status == "feasible":
        return (0.0, objective, entry.number)
    behind = FAILED if entry.evaluation.status == "aborted" else 1.0
    return (behind + entry.evaluation.violation, objective, entry.number)


def best_entry(problem: Problem, entries: Iterable[Entry]) -> Entry | None:
    """The feasible entry of least objective in the last round that has one, of several objectives the knee of
    the front; else the one of least violation. None if there is none."""
    if len(problem.objectives) > 1:
        entries = tuple(entries)
        front = front_entries(problem, entries)
        if front:
            return front[knee(np.array([scaled_objectives(problem, e.evaluation) for e in front]))]

    def key(entry: Entry) -> tuple[int, tuple[float, float, int]]:
        feasible = entry.evaluation.status == "feasible"
        return (-entry.round if feasible else 0, rank(problem, entry))

    return min(entries, key=key, default=None)


def front_entries(problem: Problem, entries: Iterable[Entry]) -> list[Entry]:
    """The feasible entries that no other one betters in all objectives, best first by the first objective. Of
    entries that are equal in all of them the first."""
    feasible = [entry for entry in entries if entry.evaluation.status == "feasible"]
    if not feasible:
        return []
    values = np.array([scaled_objectives(problem, entry.evaluation) for entry in feasible])
    return [feasible[row] for row in non_dominated(values)]


def cutoff_at(problem: Problem, results: Sequence[Evaluation], keep: int) -> Cutoff | None:
    """That of the ``keep``-th best of the designs that were measured to the end; None where there are fewer
    or it failed."""
    measured = {design_key(result.design): result for result in results if result.cutoff is None}
    ranks = sorted((result.violation, minimised(problem, result)) for result in measured.values())
    if len(ranks) < keep or not math.isfinite(ranks[keep - 1][0]):
        return None
    return Cutoff(*ranks[keep - 1])


def minimised(problem: Problem, evaluation: Evaluation) -> float:
    """The first objective over its scale, turned so that less is better; FAILED where there is none."""
    return scaled_objectives(problem, evaluation)[0]


def scaled_objectives(problem: Problem, evaluation: Evaluation) -> tuple[float, ...]:
    """Every objective over its scale, turned so that less is better; FAILED where there is none."""
    return tuple(minimised_value(goal, evaluation) for goal in problem.objectives)


def minimised_value(goal: Goal, evaluation: Evaluation) -> float:
    """One objective as ``scaled_objectives`` gives it."""
    value = evaluation.metrics.get(goal.label, math.nan)
    if not math.isfinite(value):
        return FAILED
    return scaled_objective(goal, value)
