"""All requirements of a study at one design, settled."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace

from tpm_design.arithmetic.rounding import check_rounding
from tpm_design.certificates.demands import REACH, Demand, NoProofError, demands, refutable
from tpm_design.certificates.settlement import Breaking, Outcome, Settlement, settle
from tpm_design.errors import ParameterError
from tpm_design.evaluation.contexts import design_context
from tpm_design.mechanisms.base import within
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.mechanisms.parameters import limb_tolerances
from tpm_design.metrics.context import Context
from tpm_design.problem import Design, Goal, Problem
from tpm_design.worker_threads import WorkerThreads, in_order

Box = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Requirement:
    """One constraint of the study. ``settlements``: numbers of what it needs, in ``Verdict.settlements``.
    ``slack`` (SI): the proved one, the least of the demands that carry the bound; None unless proved.
    ``worst``: the worst value (SI) that a search found over the region and the machines within tolerance, so
    that the true one lies between what is proved and it; None where the requirement is not on one value,
    infinite where there is no locus. ``open_box``: sides (m) of a box of poses where the proof of an
    undecided one failed."""

    goal: Goal
    outcome: Outcome
    slack: float | None
    settlements: tuple[int, ...]
    breaking: Breaking | None
    reason: str
    worst: float | None = None
    open_box: Box | None = None


@dataclass(frozen=True)
class Verdict:
    """``outcome``: "proved" if every requirement is, "refuted" if one is, else "undecided"."""

    context: Context
    design: Design
    tolerance: Mapping[str, float]
    settlements: tuple[Settlement, ...]
    requirements: tuple[Requirement, ...]
    outcome: Outcome
    seconds: float

    @property
    def boxes(self) -> int:
        """Boxes looked at in all proofs."""
        return sum(settlement.boxes for settlement in self.settlements)


def verdict(
    problem: Problem,
    design: Design,
    tolerance: Mapping[str, float],
    *,
    boxes: int,
    workers: int = 1,
    with_slack: bool = True,
    least_determinant: float = 0.0,
) -> Verdict:
    """Settle every constraint of the problem for all machines within ``tolerance`` (name → ±, SI, each limb
    by itself), with at most ``boxes`` boxes for each proof. The result is the same for any number of workers.
    Determinants whose sides matter must keep ``least_determinant`` from 0.

    Raises ParameterError where the design cannot be built, or a tolerance is not smaller than what it is on.
    """
    began = time.perf_counter()
    check_rounding()
    context = design_context(problem, design)
    check_tolerances(context.mechanism, tolerance)
    needs = [_needs(goal, context, least_determinant) for goal in problem.constraints]
    # each statement once, however many requirements need it
    distinct = list(dict.fromkeys(demand for need in needs if not isinstance(need, str) for demand in need))
    if context.region is not None and distinct:
        # what the threads share is computed before they start
        _ = context.poses, context.lattice_sides

    def settled(demand: Demand) -> Settlement:
        return settle(problem, demand, context, tolerance, boxes=boxes, with_slack=with_slack)

    with closing(WorkerThreads(workers)) as pool, closing(pool.as_they_end(settled, distinct)) as ending:
        settlements = tuple(in_order(ending))
    numbers = {demand: number for number, demand in enumerate(distinct)}
    requirements = tuple(
        Requirement(goal, "undecided", None, (), None, need)
        if isinstance(need, str)
        else _requirement(goal, [numbers[demand] for demand in need], settlements)
        for goal, need in zip(problem.constraints, needs, strict=True)
    )
    outcome = worst_outcome([requirement.outcome for requirement in requirements])
    return Verdict(
        context, design, tolerance, settlements, requirements, outcome, time.perf_counter() - began
    )


def check_tolerances(mechanism: Mechanism, tolerance: Mapping[str, float]) -> None:
    """Raises ParameterError where a machine within ``tolerance`` (SI) would have a dimension that none can
    have."""
    for name, bounds in limb_tolerances(mechanism.kind, tolerance).items():
        parameter = mechanism.kind.parameter(name)
        for value, bound in zip(mechanism.parameters[name], bounds, strict=True):
            if parameter and bound > 0.0 and not within(parameter.domain, value - bound, value + bound):
                raise ParameterError(
                    f"The tolerance of {name}, {bound:g} m, is not smaller than {name} itself, {value:g} m."
                    if parameter.dimension == "length"
                    else f"The tolerance of {name}, {bound:g}, is not smaller than {name} itself, {value:g}.",
                    remedy="Tolerances are ± and in the study's units, as its parameters are.",
                )


def worst_outcome(outcomes: list[Outcome]) -> Outcome:
    """Refuted if any is, proved only if all are."""
    if "refuted" in outcomes:
        return "refuted"
    return "undecided" if "undecided" in outcomes else "proved"


def _needs(goal: Goal, context: Context, least_determinant: float) -> tuple[Demand, ...] | str:
    kind = context.mechanism.kind
    placed = context.region
    if goal.metric.name == "coverage" and placed is not None and len(placed.points) > 1:
        return "that separate poses lie in one aspect has no proof here"
    signs = (1.0,) * len(kind.determinants) if context.region is None else context.lattice_sides
    try:
        needed = demands(goal, kind, signs)
    except NoProofError as reason:
        return str(reason)
    return tuple(
        replace(demand, bound=max(demand.bound, least_determinant))
        if demand.kind == "determinant"
        else demand
        for demand in needed
    )


def _requirement(goal: Goal, numbers: list[int], settlements: tuple[Settlement, ...]) -> Requirement:
    needed = [settlements[number] for number in numbers]
    outcome = worst_outcome([settlement.outcome for settlement in needed])
    last = needed[-1]
    worst = last.demand.bound + last.demand.sense * last.found if last.demand.kind != "determinant" else None
    if outcome == "proved":
        return Requirement(goal, outcome, _slack(needed), tuple(numbers), None, "", worst)
    first = next(settlement for settlement in needed if settlement.outcome == outcome)
    reason = f"{_named(first.demand)}: {first.reason}"
    if outcome == "refuted" and not refutable(goal):
        reason = f"{reason}; how much of the region is left has no proof here"
        return Requirement(goal, "undecided", None, tuple(numbers), None, reason, worst)
    return Requirement(goal, outcome, None, tuple(numbers), first.breaking, reason, worst, first.open_box)


def _slack(needed: list[Settlement]) -> float:
    """The least of those demands that carry the bound: one, or one for each margin."""
    bound = needed[-1].demand.bound
    carrying = [s.slack for s in needed if s.demand != REACH and s.demand.bound == bound]
    return min(carrying, default=needed[-1].slack)


WORDS = {
    "determinant": "singularity",
    "serial": "limb stretched or folded",
    "frobenius": "1/κ_F",
    "condition": "1/κ₂",
    "slowest": "least velocity factor",
    "fastest": "greatest velocity factor",
    "locus": "distance to the singularity",
    "length": "length of the links",
}


def _named(demand: Demand) -> str:
    words = WORDS.get(demand.kind, demand.kind)
    return f"{demand.name} {words}" if demand.name else words
