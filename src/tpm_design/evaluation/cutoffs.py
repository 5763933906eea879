"""Whether what is known of a design is enough to be worse than a cutoff."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from tpm_design.evaluation.goals import scaled_objective
from tpm_design.evaluation.result import Cutoff, Evaluation
from tpm_design.evaluation.violation import constraint_pieces, shortfalls
from tpm_design.metrics.base import Measurement
from tpm_design.problem import Problem


def is_worse(problem: Problem, evaluation: Evaluation, cutoff: Cutoff) -> bool:
    """Whether what was measured of a design is enough to be worse than a cutoff."""
    value = evaluation.metrics.get(problem.objectives[0].label, math.nan)
    return bool(_worse(problem, evaluation.violation, value, cutoff))


def why_worse(problem: Problem, measured: Mapping[str, Measurement], cutoff: Cutoff | None) -> str:
    """Why a design is worse than a cutoff, empty where that is not sure yet."""
    if cutoff is None:
        return ""
    short = shortfalls(problem, measured, constraint_pieces(problem, measured, {}))
    first = measured.get(problem.objectives[0].label)
    value = math.nan if first is None else first.value
    worse = _worse(problem, sum(short.values()), value, cutoff)
    if worse == "violation" and cutoff.violation == 0.0:
        return f"{', '.join(label for label, value in short.items() if value > 0.0)} missed"
    return problem.objectives[0].label if worse == "objective" else worse


def _worse(
    problem: Problem, violation: float, objective: float, cutoff: Cutoff
) -> Literal["", "violation", "objective"]:
    """In what a design with at least this ``violation`` is worse; ``objective`` (SI): NaN if not known."""
    if violation > cutoff.violation:
        return "violation"
    goal = problem.objectives[0]
    if cutoff.violation == 0.0 and len(problem.objectives) == 1 and math.isfinite(objective):
        return "objective" if scaled_objective(goal, objective) > cutoff.objective else ""
    return ""
