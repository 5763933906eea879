"""How far the result of a search can be from the shortest links at all."""

from __future__ import annotations

from dataclasses import replace

from tpm_design.errors import RefusedError
from tpm_design.optimizers import optimizer
from tpm_design.problem import Problem
from tpm_design.runs.optimize import SearchPlan, SearchResult
from tpm_design.synthesis.bound import reach_bound

OPTIMAL = 1e-5
"""Gap up to which a design of the relaxation counts as the optimum: it keeps a little off the bounds."""


def with_bound(problem: Problem, plan: SearchPlan, result: SearchResult) -> SearchResult:
    """The result with a lower bound on its objective where there is one; the status says what of the
    relaxation is left, where that was the method."""
    try:
        bound = reach_bound(problem)
    except RefusedError as error:
        return replace(result, remarks=(*result.remarks, f"No lower bound: {error.what}"))
    if bound is None:
        return result
    result = replace(result, bound=bound)
    said = [result.status]
    if not bound.reachable:
        said.append("No design within the ranges reaches the region: its convex relaxation has no point.")
    elif optimizer(plan.method).abilities.relaxation:
        said += _of_relaxation(result)
    return replace(result, status=" ".join(said))


def _of_relaxation(result: SearchResult) -> list[str]:
    gap, best = gap_of(result), result.best
    if best is None or best.evaluation.status == "failed" or (gap is not None and gap > OPTIMAL):
        return []
    lower = "The relaxation gives a lower bound, not a design: its own"
    if gap is None:
        missed = [label for label, slack in best.evaluation.slacks.items() if slack < 0.0]
        return [f"{lower} misses {', '.join(missed)}."]
    if result.rounds and (result.verdict is None or result.verdict.outcome != "proved"):
        return [f"{lower} is not proved."]
    return ["Optimal: no design within the ranges that reaches the region has shorter links."]


def gap_of(result: SearchResult) -> float | None:
    """By which share the best feasible design may be above the optimum; None without a bound or a design."""
    best, bound = result.best, result.bound
    if bound is None or not bound.reachable or best is None or best.evaluation.status != "feasible":
        return None
    return bound.gap(best.evaluation.metrics[bound.goal])
