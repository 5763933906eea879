"""Design → Evaluation: the only place that evaluates a design."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Literal

from tpm_design.errors import ParameterError
from tpm_design.evaluation.contexts import design_context
from tpm_design.evaluation.cutoffs import why_worse
from tpm_design.evaluation.goals import measure, slack_pieces
from tpm_design.evaluation.result import Cutoff, Evaluation
from tpm_design.evaluation.samples import Sampled, sampled_machines
from tpm_design.evaluation.slopes import Neighbours, Slopes, slopes_along
from tpm_design.evaluation.violation import constraint_pieces, objective_pieces, shortfalls
from tpm_design.metrics.base import COSTS, UNDEFINED, Measurement
from tpm_design.problem import Design, Goal, Problem


def evaluate(
    problem: Problem,
    design: Design,
    cutoff: Cutoff | None = None,
    neighbours: Neighbours | None = None,
) -> Evaluation:
    """Every objective, constraint and recorded metric of one design, the cheap ones first.

    A constraint is met only on the unfavourable side of its metric's numeric error, and where the problem's
    samples meet it too. A design that cannot be built or measured gets status "failed" and its reason;
    nothing is raised. With a ``cutoff`` the evaluation ends as "aborted" as soon as the design is sure to be
    worse: measured to the end it would be. With ``neighbours`` come slopes.
    """
    began = time.perf_counter()
    measured: dict[str, Measurement] = {}
    try:
        context = design_context(problem, design)
        for goal in _by_cost(problem):
            why = why_worse(problem, measured, cutoff)
            if why:
                return _judged(problem, design, measured, began, cutoff=cutoff, why=why)
            measured[goal.label] = measure(context, goal)
        if problem.samples:
            why = why_worse(problem, measured, cutoff)
            if why:
                return _judged(problem, design, measured, began, cutoff=cutoff, why=why)
        sampled = sampled_machines(problem, context, measured)
        slopes = None
        if neighbours is not None:
            slopes = slopes_along(problem, design, context, measured, sampled, neighbours)
    except (ParameterError, ArithmeticError) as error:
        reason = error.what if isinstance(error, ParameterError) else str(error)
        return Evaluation(
            design=dict(design),
            metrics={},
            errors={},
            slacks={},
            pieces={},
            notes={},
            violation=math.inf,
            status="failed",
            reason=reason,
            seconds=time.perf_counter() - began,
            slopes=None if neighbours is None else {},
        )
    return _judged(problem, design, measured, began, sampled=sampled, slopes=slopes)


def _by_cost(problem: Problem) -> list[Goal]:
    """What decides on a design, cheap metrics first, then what is only recorded."""
    deciding = (*problem.objectives, *problem.constraints)
    return [*sorted(deciding, key=lambda goal: COSTS.index(goal.metric.cost)), *problem.record]


def _judged(
    problem: Problem,
    design: Design,
    measured: Mapping[str, Measurement],
    began: float,
    *,
    sampled: Sampled | None = None,
    cutoff: Cutoff | None = None,
    why: str = "",
    slopes: Slopes | None = None,
) -> Evaluation:
    """The evaluation of what was measured: everything, or enough to be worse than a cutoff."""
    sampled = sampled or Sampled({}, {})
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    found = {goal.label: measured[goal.label] for goal in goals if goal.label in measured}
    pieces = constraint_pieces(problem, measured, sampled.pieces)
    short = shortfalls(problem, measured, pieces)
    missed = [label for label, value in short.items() if value > 0.0]
    status: Literal["feasible", "infeasible", "aborted"] = "infeasible" if missed else "feasible"
    if cutoff is not None:
        status = "aborted"
        left = ", ".join(goal.label for goal in goals if goal.label not in measured) or "samples"
        reason = f"not measured further: {left}; already worse than the best known ({why})"
    else:
        reason = "; ".join(_why_missed(label, problem, measured, sampled) for label in missed)
    return Evaluation(
        design=dict(design),
        metrics={label: m.value for label, m in found.items()},
        errors={label: m.error for label, m in found.items()},
        slacks={label: min(values) for label, values in pieces.items()},
        pieces={**pieces, **objective_pieces(problem, measured)},
        notes={
            f"{label}_{key}": note
            for label, m in found.items()
            for key, note in m.notes.items()
            if key != UNDEFINED
        },
        violation=sum(short.values()),
        status=status,
        reason=reason,
        seconds=time.perf_counter() - began,
        cutoff=cutoff,
        slopes=slopes,
    )


def _why_missed(label: str, problem: Problem, measured: Mapping[str, Measurement], sampled: Sampled) -> str:
    if UNDEFINED in measured[label].notes:
        return f"{label}: {measured[label].notes[UNDEFINED]}"
    goal = next(goal for goal in problem.constraints if goal.label == label)
    by_itself = min(slack_pieces(goal, measured[label])) >= 0.0
    return f"{label} missed{sampled.why(label) if by_itself else ''}"
