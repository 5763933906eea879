"""A search that ends with a proof: what breaks its best design becomes a sample, and a new round starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from tpm_design.certificates.settlement import Settlement
from tpm_design.certificates.verdict import Verdict, verdict
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.mechanisms.parameters import limb_tolerances
from tpm_design.optimizers import optimizer
from tpm_design.optimizers.base import BudgetSpent
from tpm_design.problem import Design, Goal, Problem, Sample
from tpm_design.runs.entry import Answers, Entry
from tpm_design.runs.executors import Executor
from tpm_design.runs.log import EvaluationLog
from tpm_design.runs.optima import distinct_optima
from tpm_design.runs.optimize import (
    Round,
    SearchPlan,
    SearchResult,
    check_plan,
    discrete_choice,
    polish_best,
    remarks_on,
    run_method,
    search_all,
    space_of,
    status_sentence,
    view_of,
)
from tpm_design.runs.ranking import best_entry, rank
from tpm_design.runs.replay import answers_in, left_over
from tpm_design.workspace.region_geometry import nearest_pose

FIRST_SHARE = 0.8
"""Part of the budget for the first round; what the last round leaves over is not spent."""

ROUND_EVALUATIONS = 20
"""Evaluations per variable that a further round has at least, where the budget has them."""

STARTS = 10
"""Entries of the round before with which a further round begins."""

LOCAL = "descent"
"""The local method of further rounds where the study names none."""

NEIGHBOURHOODS = (0.02, 0.004)
"""Half widths, as shares of each range, in which a further round polishes: tolerances ask for little."""

MARGIN, MARGIN_GROWTH = 5e-4, 2.0
"""What a requirement must have to spare at its first sample, as a share of its metric's scale, and the factor
on it each time the same requirement fails again: bounds over boxes are wider than what a search sees."""


@dataclass(frozen=True)
class Proving:
    """For which machines the best design is to be proved (name → ±, SI, each limb by itself), with how many
    boxes a statement, by how many threads: those prove wherever designs are evaluated."""

    tolerance: Mapping[str, float]
    boxes: int
    workers: int


def search_certified(
    problem: Problem,
    plan: SearchPlan,
    proving: Proving,
    *,
    executor: Executor,
    record: Callable[[Entry], None],
    stored: Sequence[Entry] = (),
) -> SearchResult:
    """Search and certify in rounds, until the best design is proved, no round can help or the budget ends.

    A feasible design of a later round holds at every counterexample found before it. Where a round finds no
    such design the best one of the round before remains, with its verdict. Raises what ``check_plan`` raises;
    Ctrl-C ends the search as "interrupted" with everything evaluated so far.

    ``stored``: the log of an earlier search for the same problem; a design that is asked for again and judged
    by the same samples is answered from it, verdicts are found anew. With another budget the rounds are
    other ones: what they do not ask for is dropped at the end. ``executor``: who evaluates.
    """
    check_plan(problem, plan)
    course = _Course(problem, plan, proving, executor, record, answers_in(stored))
    try:
        ending, detail = course.run()
    except KeyboardInterrupt:
        course.interrupted()
        ending, detail = "interrupted", "The search was interrupted."
    rest = left_over(stored, course.entries) if ending == "interrupted" else []
    entries = (*course.entries, *rest)
    best = best_entry(problem, entries)
    found = None if best is None else course.verdicts.get(best.number)
    status = status_sentence(problem, best, entries, ending, detail)
    told = " ".join([status, *_told(course.rounds, found, proving)])
    return SearchResult(
        entries,
        best,
        ending,
        told.strip(),
        remarks_on(plan, problem),
        tuple(course.rounds),
        found,
        optima=distinct_optima(problem, space_of(problem), best, entries, course.optima),
    )


class _Course:
    """The rounds so far. ``verdicts``: by the number of the entry."""

    def __init__(
        self,
        problem: Problem,
        plan: SearchPlan,
        proving: Proving,
        executor: Executor,
        record: Callable[[Entry], None],
        answers: Answers,
    ) -> None:
        self._problem, self._plan, self._proving = problem, plan, proving
        self._executor, self._record, self._answers = executor, record, answers
        self._samples: tuple[Sample, ...] = ()
        self._first = 0
        self.entries: list[Entry] = []
        self.rounds: list[Round] = []
        self.verdicts: dict[int, Verdict] = {}
        self.optima: list[Design] = []

    def run(self) -> tuple[str, str]:
        """All rounds: the ending and a sentence on it."""
        while True:
            ending, detail, best = self._round()
            if best is None or best.evaluation.status != "feasible":
                self._end_round(best, "infeasible")
                return ending, detail
            found = self._verdict(best, with_slack=False)
            if found.outcome == "proved":
                found = self._verdict(best, with_slack=True)
            self.verdicts[best.number] = found
            self._end_round(best, found.outcome)
            if found.outcome == "proved":
                return "proved", ""
            more = with_counterexamples(self._problem, found, self._samples)
            if more == self._samples:
                return "not provable", ""
            if len(self.entries) >= self._plan.budget:
                return "budget spent", "The budget was spent."
            self._samples = more

    def _verdict(self, best: Entry, *, with_slack: bool) -> Verdict:
        return verdict(
            self._problem,
            best.evaluation.design,
            self._proving.tolerance,
            boxes=self._proving.boxes,
            workers=self._proving.workers,
            with_slack=with_slack,
        )

    def interrupted(self) -> None:
        """Close the round that was cut short."""
        self._end_round(None, "interrupted")

    def _round(self) -> tuple[str, str, Entry | None]:
        """One round's search; its best entry."""
        left = self._plan.budget - self._first
        log = EvaluationLog(
            replace(self._problem, samples=self._samples),
            executor=self._executor,
            record=self._record,
            first=self._first,
            round_number=len(self.rounds) + 1,
            answers=self._answers,
        )
        try:
            if not self.rounds:
                ending, detail = search_all(log, self._plan, max(1, int(FIRST_SHARE * left)))
            else:
                least = ROUND_EVALUATIONS * len(self._problem.variables)
                limit = min(left, max(least, left // 4))
                self._start_again(log, limit)
                ending, detail = _refine(log, self._plan, limit)
            best = log.best()
            if best is not None and best.evaluation.status != "feasible" and len(log.entries) < left:
                # there is nothing to certify: what was kept for later rounds serves this one
                ending, detail = _refine(log, self._plan, left)
            return ending, detail, log.best()
        finally:
            self.entries += log.entries
            self.optima += log.optima

    def _start_again(self, log: EvaluationLog, limit: int) -> None:
        """Judge the best entries of the round before by all samples."""
        before = [entry for entry in self.entries if entry.round == len(self.rounds)]
        starts = starting_entries(self._problem, before, STARTS)
        with suppress(BudgetSpent):
            log.evaluations([entry.evaluation.design for entry in starts], limit)

    def _end_round(self, best: Entry | None, outcome: str) -> None:
        number = None if best is None else best.number
        count = len(self.entries) - self._first
        self.rounds.append(Round(len(self.rounds) + 1, self._samples, count, number, outcome))
        self._first = len(self.entries)


def starting_entries(problem: Problem, entries: Sequence[Entry], most: int) -> list[Entry]:
    """The best entry of each choice of the discrete variables, best first, then the next best of all."""
    space = space_of(problem)
    ordered = sorted(entries, key=lambda entry: rank(problem, entry))
    firsts = {discrete_choice(space, entry): entry for entry in reversed(ordered)}
    chosen = [entry for entry in ordered if firsts[discrete_choice(space, entry)] is entry]
    return [*chosen, *(entry for entry in ordered if entry not in chosen)][:most]


def _refine(log: EvaluationLog, plan: SearchPlan, limit: int) -> tuple[str, str]:
    """Search near what the log holds, by the study's local method if it names one."""
    whole = view_of(log, limit)
    method = optimizer(plan.method if plan.polish is None else plan.polish)
    count = sum(not variable.values for variable in log.problem.variables)
    if not count:
        return run_method(method, whole, plan.seed)
    local = optimizer(LOCAL) if method.abilities.whole_space else method
    return polish_best(local, whole, limit, plan.seed, neighbourhoods=NEIGHBOURHOODS, in_order=True)


def with_counterexamples(problem: Problem, found: Verdict, samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
    """The samples and what a verdict adds: for each statement that is refuted or left open its breaking or
    worst machine and pose, under the first requirement that needs it. Unchanged where nothing can help."""
    added: list[Sample] = []
    for number, settlement in enumerate(found.settlements):
        if settlement.outcome != "proved":
            goal = next(r.goal for r in found.requirements if number in r.settlements)
            added.append(_counterexample(problem, found, settlement, goal, samples))
    replaced = {_identity(sample) for sample in added}
    kept = tuple(sample for sample in samples if _identity(sample) not in replaced)
    # several statements of one requirement may break at the same machine: their hardest margin is the same
    return kept + tuple({_identity(sample): sample for sample in reversed(added)}.values())


def _identity(sample: Sample) -> tuple[object, ...]:
    return sample.label, tuple(sorted(sample.offsets.items()))


def _counterexample(
    problem: Problem, found: Verdict, settlement: Settlement, goal: Goal, samples: tuple[Sample, ...]
) -> Sample:
    breaking = settlement.breaking or settlement.worst
    pose = breaking.pose
    if pose is not None:
        region = found.context.placed
        x, y, z = nearest_pose(region, pose) if settlement.demand.kind == "locus" else pose
        pose = (x - region.centre[0], y - region.centre[1], z - region.centre[2])
    earlier = [sample.margin for sample in samples if sample.label == goal.label]
    margin = MARGIN_GROWTH * max(earlier) if earlier else MARGIN * goal.metric.scale
    offsets = _corner(problem, found.context.mechanism, breaking.parameters, found.tolerance)
    return Sample(goal.label, offsets, pose, margin)


def _corner(
    problem: Problem,
    nominal: Mechanism,
    parameters: Mapping[str, tuple[float, ...]],
    tolerance: Mapping[str, float],
) -> dict[str, tuple[float, ...]]:
    """Offsets of a machine from the nominal one, to whole tolerances: the same for every design."""
    corner: dict[str, tuple[float, ...]] = {}
    for name, bounds in limb_tolerances(problem.kind, tolerance).items():
        gaps = [a - b for a, b in zip(parameters[name], nominal.parameters[name], strict=True)]
        if any(abs(gap) > 0.5 * bound for gap, bound in zip(gaps, bounds, strict=True)):
            corner[name] = tuple(
                math.copysign(bound, gap) if abs(gap) > 0.5 * bound else 0.0
                for gap, bound in zip(gaps, bounds, strict=True)
            )
    return corner


def _told(rounds: Sequence[Round], found: Verdict | None, proving: Proving) -> list[str]:
    """Sentences on what was proved, and in which round, with a remedy where not all was."""
    if found is None:
        return ["Nothing was certified."]
    certified = next(r for r in reversed(rounds) if r.best is not None and r.outcome == found.outcome)
    lines = told_of(found, proving, where=f" in round {certified.number}")
    if found.outcome != "proved" and rounds[-1].outcome == "infeasible":
        lines.insert(1, f"Round {rounds[-1].number} found no feasible design that holds there as well.")
    return lines


def told_of(found: Verdict, proving: Proving, *, where: str = "") -> list[str]:
    """Sentences on a verdict, a remedy last where not all was proved. ``where``: in which round it was."""
    within = "within the tolerances" if any(proving.tolerance.values()) else "of exactly these dimensions"
    if found.outcome == "proved":
        return [f"Proved{where} for every machine {within}."]
    failed = [r for r in found.requirements if r.outcome == found.outcome]
    labels = ", ".join(requirement.goal.label for requirement in failed)
    lines = []
    if found.outcome == "refuted":
        verb = "breaks" if len(failed) == 1 else "break"
        lines.append(f"Refuted: {labels} {verb} for a machine {within}.")
    else:
        reasons = "; ".join(f"{r.goal.label} ({r.reason})" for r in failed)
        lines.append(f"Not proved for every machine {within}: {reasons}.")
    if not any(r.settlements for r in failed):
        return [*lines, f"Nothing here proves {labels}: record it instead of asking for it."]
    remedies = [f"raise the budget, ask for less of {labels}"]
    if any(f"{proving.boxes} boxes" in r.reason for r in failed):
        remedies.append("allow more boxes")
    if any(proving.tolerance.values()):
        remedies.append("tighten the tolerances")
    text = ", ".join(remedies[:-1]) + f" or {remedies[-1]}" if len(remedies) > 1 else remedies[0]
    return [*lines, f"{text[0].upper()}{text[1:]}."]
