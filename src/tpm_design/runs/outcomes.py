"""Evaluations as an optimiser gets to see them: scaled, in pieces, finite everywhere."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tpm_design.evaluation.goals import scaled_objective
from tpm_design.evaluation.result import Evaluation
from tpm_design.optimizers.base import FloatArray, Outcomes, Slopes
from tpm_design.problem import Goal, Problem
from tpm_design.runs.ranking import FAILED, minimised_value, scaled_objectives

PENALTY = 1e3
"""Weight of the violation in the merit of methods without constraints: above the multipliers that
scaled objectives and constraints have, so that the penalised optimum is the constrained one."""

BACKOFF = 1e-6
"""Share of its metric's scale by which an optimiser sees each constraint tightened: active-set methods end
a rounding outside their constraints, and a result must lie inside."""


def outcomes(
    problem: Problem,
    results: Sequence[Evaluation],
    sizes: Sequence[int],
    objective_sizes: Sequence[int] = (),
) -> Outcomes:
    """What an optimiser gets to see, finite everywhere. ``sizes``: number of pieces of each constraint; a
    constraint of fewer pieces repeats its least. ``objective_sizes``: of each objective, by default one.
    Constraints that were not measured, of aborted evaluations, are 0, and the merit is behind that of the
    cutoff."""
    objectives = np.array([scaled_objectives(problem, result) for result in results])
    objectives = objectives.reshape(len(results), len(problem.objectives))
    objective = objectives[:, 0]
    constraints = np.array(
        [
            [
                piece / goal.metric.scale - BACKOFF
                for goal, size in zip(problem.constraints, sizes, strict=True)
                for piece in _pieces(goal, result, size)
            ]
            for result in results
        ]
    ).reshape(len(results), sum(sizes))
    violation = np.array(
        [result.violation if math.isfinite(result.violation) else FAILED for result in results]
    )
    pieces = tuple(
        np.array([_objective_pieces(goal, result, size) for result in results]).reshape(len(results), size)
        for goal, size in zip(
            problem.objectives, objective_sizes or (1,) * len(problem.objectives), strict=True
        )
    )
    aborted = np.array([result.cutoff is not None for result in results], dtype=np.bool_)
    merit = np.where(aborted, FAILED, objective) + PENALTY * violation
    return Outcomes(objective, constraints, merit, aborted, objectives=objectives, objective_pieces=pieces)


def slopes_of(problem: Problem, result: Evaluation, sizes: Sequence[int], rates: FloatArray) -> Slopes | None:
    """Of the objective and of constraints in so many pieces, as ``outcomes`` gives them; None where one is
    not known. ``rates`` (n,): by which variables grow with their coordinates, 0 for discrete ones."""
    goal, known = problem.objectives[0], result.slopes
    labels = (goal.label, *(constraint.label for constraint in problem.constraints))
    if known is None or any(label not in known for label in labels):
        return None
    rows = [[scaled_objective(goal, slope) for slope in known[goal.label][0]]]
    for constraint, size in zip(problem.constraints, sizes, strict=True):
        slopes, pieces = known[constraint.label], result.pieces[constraint.label]
        if len(pieces) != size:
            slopes = (slopes[pieces.index(min(pieces))],) * size
        rows += [[slope / constraint.metric.scale for slope in row] for row in slopes]
    table = np.zeros((len(rows), len(rates)))
    table[:, np.flatnonzero(rates)] = rows
    table *= rates
    return Slopes(table[0], table[1:])


def _objective_pieces(goal: Goal, result: Evaluation, size: int) -> tuple[float, ...]:
    """Values of which the greatest is the objective; its own one ``size`` times where there are no such."""
    value = minimised_value(goal, result)
    unit = scaled_objective(goal, 1.0)
    pieces = tuple(unit * piece for piece in result.pieces.get(goal.label, ()))
    return pieces if len(pieces) == size and max(pieces) == value else (value,) * size


def _pieces(goal: Goal, result: Evaluation, size: int) -> tuple[float, ...]:
    unknown = BACKOFF if result.cutoff is not None else -FAILED
    pieces = result.pieces.get(goal.label, (unknown * goal.metric.scale,))
    return pieces if len(pieces) == size else (min(pieces),) * size
