"""One search from start to status sentence."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tpm_design.certificates.verdict import Verdict
from tpm_design.design_space import DesignSpace, octant_signs
from tpm_design.errors import RefusedError
from tpm_design.optimizers import check_pair, optimizer
from tpm_design.optimizers.base import BudgetSpent, Optimizer, Stalled
from tpm_design.problem import Goal, Problem, Sample
from tpm_design.runs.entry import Entry
from tpm_design.runs.executors import Executor
from tpm_design.runs.log import EvaluationLog
from tpm_design.runs.optima import distinct_optima
from tpm_design.runs.ranking import best_entry, front_entries
from tpm_design.runs.replay import answers_in, left_over
from tpm_design.runs.unit_search import UnitSearch
from tpm_design.synthesis.bound import ReachBound
from tpm_design.synthesis.relaxation import checked_relaxation

POLISH_SHARE = 0.25
"""Part of the budget kept for polishing. The whole-space search does not know it: a larger budget lets the
same path go on."""

POLISH_NEIGHBOURHOODS = (0.1, 0.03)
"""Half widths of the neighbourhoods that are polished, as shares of each range."""

POLISH_ROUND = 20
"""Evaluations per variable in one neighbourhood."""

POLISH_GAIN = 1e-4
"""Relative gain below which a design counts as polished."""

REMEDIES = {
    "converged": "Another seed or start may end at a better design.",
    "budget spent": "Resumed with a larger budget, the search goes on from here.",
    "stalled": "Try another seed, another method or another start.",
    "interrupted": "Resume it to go on.",
}
"""What to do about each ending where a feasible design was found."""
ENDED_EARLY = ("budget spent", "interrupted")
"""Endings of searches that would have gone on with a larger budget."""


@dataclass(frozen=True)
class SearchPlan:
    """Which method searches for how many evaluations, and which local method polishes what it found."""

    method: str
    budget: int
    seed: int
    polish: str | None


@dataclass(frozen=True)
class Round:
    """One round of a search that certifies. ``best``: the entry that was certified, or was not feasible; None
    if interrupted before. ``outcome``: the verdict's, "infeasible" or "interrupted"."""

    number: int
    samples: tuple[Sample, ...]
    evaluations: int
    best: int | None
    outcome: str


@dataclass(frozen=True)
class SearchResult:
    """The log in order, its best entry, and how it ended. ``ending``: "converged", "budget spent",
    "stalled" (the method could not go on), "interrupted" or, of a search that certifies, "proved" or
    "not provable" (no round could help).
    ``status``: one or more sentences with what to do where the result is not what was hoped for.
    ``rounds`` and ``verdict`` (on ``best``): of a search that certifies, as far as it came. ``bound``: on the
    objective, where the problem has a convex relaxation. ``optima``: the best entry and every other local
    optimum that the method noted, best first. ``front``: of several objectives, best first by the first, and
    ``best`` its knee; empty for one and where nothing is feasible."""

    entries: tuple[Entry, ...]
    best: Entry | None
    ending: str
    status: str
    remarks: tuple[str, ...]
    rounds: tuple[Round, ...] = ()
    verdict: Verdict | None = None
    bound: ReachBound | None = None
    optima: tuple[Entry, ...] = ()
    front: tuple[Entry, ...] = ()


def check_plan(problem: Problem, plan: SearchPlan) -> None:
    """Refuse what cannot work before anything runs. Raises RefusedError or UsageError."""
    if not problem.variables:
        raise RefusedError(
            "Nothing is free in this study.", remedy="Give a parameter {min, max}, or use `evaluate`."
        )
    goals = (*problem.objectives, *problem.constraints)
    rough = [goal.label for goal in goals if not goal.metric.differentiable]
    discrete = [variable.name for variable in problem.variables if variable.values]
    method = optimizer(plan.method)
    check_pair(
        method,
        dimension=len(problem.variables),
        discrete=discrete,
        nondifferentiable=rough,
        objectives=len(problem.objectives),
    )
    if method.abilities.relaxation:
        checked_relaxation(problem)
    if plan.polish is not None:
        if method.abilities.front:
            raise RefusedError(
                f"{plan.polish} improves one objective; {method.name} searches a front.",
                remedy="Remove the polish.",
            )
        polish = optimizer(plan.polish)
        if polish.abilities.whole_space:
            raise RefusedError(
                f"{polish.name} searches the whole space and cannot polish.",
                remedy="Choose a local method, such as nlopt.cobyla.",
            )
        count = len(problem.variables) - len(discrete)
        if count:
            check_pair(polish, dimension=count, discrete=[], nondifferentiable=rough)


def search(
    problem: Problem,
    plan: SearchPlan,
    *,
    executor: Executor,
    record: Callable[[Entry], None],
    stored: Sequence[Entry] = (),
) -> SearchResult:
    """Run the plan. ``executor`` evaluates, ``record`` gets each evaluation as it ends. Raises what
    ``check_plan`` raises.

    ``stored``: the log of an earlier search for the same problem; what is asked for again is answered from
    it. What is not, because the budget is another one, comes last and may be the best.
    Ctrl-C ends the search as "interrupted" with everything evaluated so far.
    """
    check_plan(problem, plan)
    log = EvaluationLog(problem, executor=executor, record=record, answers=answers_in(stored))
    try:
        ending, detail = search_all(log, plan, plan.budget)
    except KeyboardInterrupt:
        ending, detail = "interrupted", "The search was interrupted."
    entries = (*log.entries, *left_over(stored, log.entries))
    best = best_entry(problem, entries)
    status = status_sentence(problem, best, entries, ending, detail)
    optima = distinct_optima(problem, space_of(problem), best, entries, log.optima)
    front = tuple(front_entries(problem, entries)) if len(problem.objectives) > 1 else ()
    remarks = remarks_on(plan, problem)
    return SearchResult(entries, best, ending, status, remarks, optima=optima, front=front)


def space_of(problem: Problem) -> DesignSpace:
    """The whole design space."""
    return DesignSpace(problem.variables, problem.fixed, octant_signs(problem.modes), problem.ties)


def view_of(log: EvaluationLog, limit: int) -> UnitSearch:
    """The whole design space, up to ``limit`` entries in the log."""
    problem = log.problem
    space = space_of(problem)
    return UnitSearch(log, space, space.start(), limit, (1,) * len(problem.constraints))


def search_all(log: EvaluationLog, plan: SearchPlan, limit: int) -> tuple[str, str]:
    """The whole-space method, then the polish; up to ``limit`` entries. The ending and a sentence on it."""
    kept = int(POLISH_SHARE * limit) if plan.polish is not None else 0
    whole = view_of(log, max(1, limit - kept))
    ending, detail = run_method(optimizer(plan.method), whole, plan.seed)
    if plan.polish is not None:
        polished, said = polish_best(optimizer(plan.polish), whole, limit, plan.seed)
        if ending != "stalled" or polished == "budget spent":
            ending, detail = polished, said
    return ending, detail


def run_method(method: Optimizer, view: UnitSearch, seed: int) -> tuple[str, str]:
    try:
        said = method.run(view, seed)
        return "converged", said if said.startswith("Converged") else f"Converged: {said}"
    except BudgetSpent:
        return "budget spent", "The budget was spent."
    except Stalled as end:
        if all(view.levels) and len(view.log.entries) == math.prod(view.levels):
            return "converged", "Converged: every design was evaluated."
        return "stalled", f"The search stalled: {end}"


def polish_best(
    method: Optimizer,
    whole: UnitSearch,
    most: int,
    seed: int,
    *,
    neighbourhoods: Sequence[float] = POLISH_NEIGHBOURHOODS,
    in_order: bool = False,
) -> tuple[str, str]:
    """Polish the best design, then the best of every other choice of the discrete variables, up to ``most``
    entries in the log. ``in_order``: the choices in the order of the log, not by their best.

    A local method starts in ever smaller neighbourhoods: minima over a region have kinks, at which one that
    begins with a large step leaves the valley and one that begins with a small step stays in it.
    """
    log = whole.log
    polished = set()
    ending, detail = "converged", "The search converged."
    while len(log.entries) < most:
        choices: dict[tuple[object, ...], Entry] = {}
        for entry in log.entries if in_order else sorted(log.entries, key=log.rank):
            choices.setdefault(discrete_choice(whole.space, entry), entry)
        left = [(key, entry) for key, entry in choices.items() if key not in polished]
        if not left or not whole.space.holding_discrete(left[0][1].evaluation.design).variables:
            break
        key = left[0][0]
        before = min(log.rank(e) for e in log.entries if discrete_choice(whole.space, e) == key)
        for share in neighbourhoods:
            entry = min((e for e in log.entries if discrete_choice(whole.space, e) == key), key=log.rank)
            limit = min(most, len(log.entries) + POLISH_ROUND * whole.dimension)
            if limit > len(log.entries):
                ending, detail = run_method(method, whole.continuous_near(entry, share, limit), seed)
        after = min(log.rank(e) for e in log.entries if discrete_choice(whole.space, e) == key)
        if after[0] >= before[0] and after[1] >= before[1] - POLISH_GAIN * abs(before[1]):
            polished.add(key)
    if len(log.entries) >= most:
        return "budget spent", "The budget was spent."
    return "converged", detail if ending == "converged" else "The search converged."


def discrete_choice(space: DesignSpace, entry: Entry) -> tuple[object, ...]:
    """The values of the discrete variables."""
    return tuple(entry.evaluation.design[v.name] for v in space.variables if v.values)


def remarks_on(plan: SearchPlan, problem: Problem) -> tuple[str, ...]:
    """What a reader of the result should know of the method."""
    method = optimizer(plan.method)
    if problem.constraints and not method.abilities.constraints:
        return (
            f"{method.name} takes no constraints: it minimised the objective plus an exact penalty on the "
            "violation.",
        )
    return ()


def binding(problem: Problem, best: Entry) -> tuple[Goal, float] | None:
    """The constraint that limits a design: the one of least scaled slack. None without constraints."""
    scaled = [
        (best.evaluation.slacks[goal.label] / goal.metric.scale, goal)
        for goal in problem.constraints
        if goal.label in best.evaluation.slacks
    ]
    if not scaled:
        return None
    slack, goal = min(scaled, key=lambda pair: pair[0])
    return goal, slack


def status_sentence(
    problem: Problem, best: Entry | None, entries: Sequence[Entry], ending: str, detail: str
) -> str:
    """How the search ended (``detail`` first, if any) and what it found, each with what to do about it."""
    count = len(entries)
    if best is None:
        return f"{detail} No design was evaluated."
    if best.evaluation.status == "failed":
        reason = best.evaluation.reason.rstrip(".")
        return f"{detail} None of {count} designs could be evaluated: {reason}. Change the ranges."
    remedy = REMEDIES.get(ending, "")
    if best.evaluation.status == "feasible":
        found = f"Best feasible design of {count} evaluations: number {best.number}."
        if len(problem.objectives) > 1:
            front = front_entries(problem, entries)
            found = (
                f"Front of {len(front)} designs from {count} evaluations; its knee is number {best.number}."
            )
        return " ".join(filter(None, [detail, remedy, found, *_failures(entries)]))
    limit = binding(problem, best)
    label = limit[0].label if limit else "the objective"
    further = "raise the budget" if ending in ENDED_EARLY else "try another method, seed or start"
    found = (
        f"No feasible design in {count} evaluations; the closest misses {label} (violation "
        f"{best.evaluation.violation:.3g}). Widen the ranges, relax {label} or {further}."
    )
    told = [detail, remedy if ending == "interrupted" else "", found, *_failures(entries)]
    return " ".join(filter(None, told))


def _failures(entries: Sequence[Entry]) -> list[str]:
    """A sentence on designs that could not be evaluated, if there are any."""
    reasons = Counter(e.evaluation.reason.rstrip(".") for e in entries if e.evaluation.status == "failed")
    if not reasons:
        return []
    ((most, times),) = reasons.most_common(1)
    failed = sum(reasons.values())
    why = f"{most}" if times == failed else f"{times} of them: {most}"
    return [f"{failed} of {len(entries)} designs could not be evaluated ({why}); narrower ranges avoid them."]
