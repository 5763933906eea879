"""The problem as an optimiser sees it: budgeted, memoised, logged, evaluated by several workers."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tpm_design.design_space import DesignSpace
from tpm_design.evaluation.cutoffs import is_worse
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.goals import scaled_objective
from tpm_design.evaluation.result import Cutoff, Evaluation
from tpm_design.evaluation.slopes import Neighbour, Neighbours
from tpm_design.optimizers.base import BudgetSpent, Outcomes, Slopes
from tpm_design.problem import Design, Goal, Problem, Sample
from tpm_design.runs.executors import Executor, Threads, in_order
from tpm_design.runs.front import knee, non_dominated
from tpm_design.synthesis.bound import relaxed_designs

FloatArray = NDArray[np.float64]
Key = tuple[float | str, ...]

AnswerKey = tuple[str, Key, Cutoff | None]
Answers = Mapping[AnswerKey, Evaluation]
"""Evaluations by what a design was judged by (as in ``Entry``), the design's key, and the cutoff at which it
was aborted, None where it was measured to the end."""

SCREENED = 32
"""Points that are screened by one cutoff: fixed, so that the log does not depend on the number of workers."""

PENALTY = 1e3
"""Weight of the violation in the merit of methods without constraints: above the multipliers that
scaled objectives and constraints have, so that the penalised optimum is the constrained one."""

BACKOFF = 1e-6
"""Share of its metric's scale by which an optimiser sees each constraint tightened: active-set methods end
a rounding outside their constraints, and a result must lie inside."""

SLOPE_STEP = 1e-7
"""Share of each range that slopes are differences over: of smooth functions, so that it may be small."""

FAILED = 1e6
"""Objective and shortfall given to an optimiser for a design that could not be measured."""


@dataclass(frozen=True)
class Entry:
    """One evaluation in the log, numbered from 0 in the order in which points were asked for. ``round``: from
    1; each further one judges designs by more samples than those before. ``judged_by``: ``samples_digest``
    of these samples."""

    number: int
    evaluation: Evaluation
    round: int = 1
    judged_by: str = ""


class EvaluationLog:
    """Every distinct design evaluated so far in one round. The one place that counts evaluations.

    ``record`` is called with each entry, in order, as soon as it is there. ``first``: number of the first.
    ``answers``: evaluations that need not be repeated; they count like others. ``executor``: who evaluates,
    ``workers`` threads of its own if None. ``optima``: designs that the method noted as local optima.
    ``most_pieces``: in how many pieces each constraint came, at most.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        workers: int,
        record: Callable[[Entry], None] = lambda entry: None,
        first: int = 0,
        round_number: int = 1,
        answers: Answers = MappingProxyType({}),
        executor: Executor | None = None,
    ) -> None:
        self.problem = problem
        self.judged_by = samples_digest(problem.samples)
        self._answers = answers
        self.first = first
        self.round_number = round_number
        self.entries: list[Entry] = []
        self.optima: tuple[Design, ...] = ()
        self.most_pieces: dict[str, int] = {}
        self._places: dict[Key, int] = {}
        self._record = record
        self._executor: Executor = Threads(workers) if executor is None else executor
        self._is_own = executor is None

    def close(self) -> None:
        """End the log's own threads; evaluations not begun are dropped."""
        if self._is_own:
            self._executor.close()

    def evaluations(
        self,
        designs: Sequence[Design],
        limit: int,
        cutoff: Cutoff | None = None,
        neighbours: Sequence[Neighbours | None] = (),
    ) -> list[Evaluation]:
        """Evaluations of the designs, in order; repeated ones are answered from the log, an aborted one only
        where ``cutoff`` would abort it as well: else it becomes another entry. ``neighbours``: those of each
        design, None where its slopes are not asked for; slopes alone make no other entry.

        Raises BudgetSpent once the log holds ``limit`` entries and another is needed; what fits is
        evaluated and logged first.
        """
        keys = [design_key(design) for design in designs]
        asked = {key: around for key, around in zip(keys, neighbours, strict=False) if around is not None}
        fresh: dict[Key, Design] = {}
        unsloped: dict[Key, Design] = {}
        for key, design in zip(keys, designs, strict=True):
            if not self._is_known(key, cutoff):
                fresh.setdefault(key, design)
            elif key in asked and self.entries[self._places[key]].evaluation.slopes is None:
                unsloped[key] = design
        allowed = max(0, limit - len(self.entries))
        wanted = list(fresh.items())[:allowed]
        answers = [self._answer(key, cutoff, sloped=key in asked) for key, _ in wanted]
        questions = [
            _Question(design, asked.get(key))
            for (key, design), answer in zip(wanted, answers, strict=True)
            if answer is None
        ] + [_Question(design, asked[key]) for key, design in unsloped.items()]
        measured = partial(_answered, cutoff=cutoff)
        with closing(self._executor.as_they_end(measured, self.problem, questions)) as evaluated:
            results = in_order(evaluated)
            for (key, _), answer in zip(wanted, answers, strict=True):
                self._append(key, answer or next(results))
            for key, result in zip(unsloped, results, strict=True):
                place = self._places[key]
                self.entries[place] = replace(self.entries[place], evaluation=result)
        if len(wanted) < len(fresh):
            raise BudgetSpent
        return [self.entries[self._places[key]].evaluation for key in keys]

    def _append(self, key: Key, result: Evaluation) -> None:
        self._places[key] = len(self.entries)
        entry = Entry(self.first + len(self.entries), result, self.round_number, self.judged_by)
        self.entries.append(entry)
        for label, pieces in result.pieces.items():
            self.most_pieces[label] = max(len(pieces), self.most_pieces.get(label, 1))
        self._record(entry)

    def _is_known(self, key: Key, cutoff: Cutoff | None) -> bool:
        if key not in self._places:
            return False
        known = self.entries[self._places[key]].evaluation
        return known.cutoff is None or (cutoff is not None and is_worse(self.problem, known, cutoff))

    def _answer(self, key: Key, cutoff: Cutoff | None, *, sloped: bool) -> Evaluation | None:
        """What an evaluation would give, if it is stored."""
        whole = self._answers.get((self.judged_by, key, None))
        if cutoff is None:
            return None if whole is not None and sloped and whole.slopes is None else whole
        # one that is worse may have been measured to the end for other reasons
        sure = whole is not None and not is_worse(self.problem, whole, cutoff)
        return whole if sure else self._answers.get((self.judged_by, key, cutoff))

    def best(self) -> Entry | None:
        """As ``best_entry``."""
        return best_entry(self.problem, self.entries)

    def rank(self, entry: Entry) -> tuple[float, float, int]:
        """As ``rank``."""
        return rank(self.problem, entry)


@dataclass(frozen=True)
class _Question:
    """A design, and the neighbours along which its slopes are asked for, None for none."""

    design: Design
    neighbours: Neighbours | None


def _answered(problem: Problem, question: _Question, cutoff: Cutoff | None) -> Evaluation:
    return evaluate(problem, question.design, cutoff, question.neighbours)


@dataclass(frozen=True)
class UnitSearch:
    """A ``Search`` over a design space, up to ``limit`` entries in the log. ``sizes``: in how many smooth
    pieces each constraint is given to the optimiser; ``objective_sizes``: each objective, empty for one."""

    log: EvaluationLog
    space: DesignSpace
    start: FloatArray
    limit: int
    sizes: tuple[int, ...]
    objective_sizes: tuple[int, ...] = ()

    @property
    def dimension(self) -> int:
        return len(self.space.variables)

    @property
    def levels(self) -> tuple[int, ...]:
        return self.space.levels

    @property
    def constraint_count(self) -> int:
        return sum(self.sizes)

    @property
    def objective_count(self) -> int:
        return len(self.log.problem.objectives)

    def evaluate(self, points: FloatArray) -> Outcomes:
        """Values at ``points`` (N, n). Raises BudgetSpent."""
        table = np.atleast_2d(np.asarray(points, dtype=np.float64))
        results = self.log.evaluations([self.space.design(point) for point in table], self.limit)
        return outcomes(self.log.problem, results, self.sizes, self.objective_sizes)

    def evaluate_sloped(self, points: FloatArray, sloped: NDArray[np.bool_]) -> Outcomes:
        """As ``SlopedSearch``."""
        table = np.atleast_2d(np.asarray(points, dtype=np.float64))
        designs = [self.space.design(point) for point in table]
        around = [
            self._neighbours(point) if asked else None for point, asked in zip(table, sloped, strict=True)
        ]
        results = self.log.evaluations(designs, self.limit, neighbours=around)
        found = outcomes(self.log.problem, results, self.sizes, self.objective_sizes)
        continuous = [number for number, count in enumerate(self.levels) if count == 0]
        return replace(
            found,
            slopes=tuple(
                slopes_of(self.log.problem, result, self.sizes, continuous, self.dimension) if asked else None
                for result, asked in zip(results, sloped, strict=True)
            ),
        )

    def _neighbours(self, point: FloatArray) -> Neighbours:
        """One along each continuous variable, towards the middle of the cube."""
        found = []
        for number, count in enumerate(self.levels):
            if count == 0:
                moved = point.copy()
                moved[number] += -SLOPE_STEP if point[number] > 0.5 else SLOPE_STEP
                found.append(Neighbour(self.space.design(moved), float(moved[number] - point[number])))
        return tuple(found)

    def screen(self, points: FloatArray, keep: int) -> Outcomes:
        """As ``ScreeningSearch``. The cutoff of each ``SCREENED`` points is the best ``keep``-th of those
        before them."""
        table = np.atleast_2d(np.asarray(points, dtype=np.float64))
        designs = [self.space.design(point) for point in table]
        results: list[Evaluation] = []
        for first in range(0, len(designs), SCREENED):
            cutoff = cutoff_at(self.log.problem, results, keep)
            results += self.log.evaluations(designs[first : first + SCREENED], self.limit, cutoff)
        return outcomes(self.log.problem, results, self.sizes)

    def in_pieces(self) -> UnitSearch:
        """The same search, each constraint and objective in as many smooth pieces as a design in the log
        had."""
        most, problem = self.log.most_pieces, self.log.problem
        return replace(
            self,
            sizes=tuple(most.get(goal.label, 1) for goal in problem.constraints),
            objective_sizes=tuple(most.get(goal.label, 1) for goal in problem.objectives),
        )

    def note_optima(self, points: FloatArray) -> None:
        """The local optima (N, n) that the method knows by now."""
        self.log.optima = tuple(self.space.design(point) for point in points)

    def relaxed_optima(self) -> FloatArray:
        """Points (N, n) of the convex relaxation's designs, see ``synthesis``. Raises RefusedError where the
        solver fails."""
        # one more than can be evaluated: so what is left out ends as a spent budget
        designs = relaxed_designs(self.log.problem, self.space.design(self.start), self.limit + 1)
        points = [self.space.point(design) for design in designs]
        return np.array(points, dtype=np.float64).reshape(-1, self.dimension)

    def continuous_near(self, entry: Entry, share: float, limit: int) -> UnitSearch:
        """The search of the continuous variables alone, within ``share`` of their ranges around a design
        already evaluated; its constraints in pieces."""
        evaluation = entry.evaluation
        space = self.space.holding_discrete(evaluation.design).near(evaluation.design, share)
        sizes = tuple(len(evaluation.pieces.get(goal.label, (0.0,))) for goal in self.log.problem.constraints)
        return replace(self, space=space, start=space.point(evaluation.design), limit=limit, sizes=sizes)


def rank(problem: Problem, entry: Entry) -> tuple[float, float, int]:
    """Sorts entries: feasible ones first by objective, then by violation; ties by number. Aborted ones, whose
    violation is not known, come after those."""
    objective = minimised(problem, entry.evaluation)
    if entry.evaluation.status == "feasible":
        return (0.0, objective, entry.number)
    behind = FAILED if entry.evaluation.status == "aborted" else 1.0
    return (behind + entry.evaluation.violation, objective, entry.number)


def cutoff_at(problem: Problem, results: Sequence[Evaluation], keep: int) -> Cutoff | None:
    """That of the ``keep``-th best of the designs that were measured to the end; None where there are fewer
    or it failed."""
    measured = {design_key(result.design): result for result in results if result.cutoff is None}
    ranks = sorted((result.violation, minimised(problem, result)) for result in measured.values())
    if len(ranks) < keep or not math.isfinite(ranks[keep - 1][0]):
        return None
    return Cutoff(*ranks[keep - 1])


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


def answer_key(entry: Entry) -> AnswerKey:
    """What an entry answers."""
    return entry.judged_by, design_key(entry.evaluation.design), entry.evaluation.cutoff


def front_entries(problem: Problem, entries: Iterable[Entry]) -> list[Entry]:
    """The feasible entries that no other one betters in all objectives, best first by the first objective. Of
    entries that are equal in all of them the first."""
    feasible = [entry for entry in entries if entry.evaluation.status == "feasible"]
    if not feasible:
        return []
    values = np.array([scaled_objectives(problem, entry.evaluation) for entry in feasible])
    return [feasible[row] for row in non_dominated(values)]


def design_key(design: Design) -> Key:
    """Exact identity of a design."""
    return tuple(design[name] for name in sorted(design))


def samples_digest(samples: Sequence[Sample]) -> str:
    """What tells samples apart, by their exact numbers; empty where there are none."""
    if not samples:
        return ""
    text = json.dumps([asdict(sample) for sample in samples], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def minimised(problem: Problem, evaluation: Evaluation) -> float:
    """The first objective over its scale, turned so that less is better; FAILED where there is none."""
    return scaled_objectives(problem, evaluation)[0]


def scaled_objectives(problem: Problem, evaluation: Evaluation) -> tuple[float, ...]:
    """Every objective over its scale, turned so that less is better; FAILED where there is none."""
    return tuple(_minimised(goal, evaluation) for goal in problem.objectives)


def _minimised(goal: Goal, evaluation: Evaluation) -> float:
    value = evaluation.metrics.get(goal.label, math.nan)
    if not math.isfinite(value):
        return FAILED
    return scaled_objective(goal, value)


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


def slopes_of(
    problem: Problem, result: Evaluation, sizes: Sequence[int], continuous: Sequence[int], dimension: int
) -> Slopes | None:
    """Of the objective and of constraints in so many pieces, as ``outcomes`` gives them; None where one is
    not known."""
    goal, known = problem.objectives[0], result.slopes
    labels = (goal.label, *(constraint.label for constraint in problem.constraints))
    if known is None or any(label not in known for label in labels):
        return None
    gradient = np.zeros(dimension)
    sign = (1.0 if goal.sense == "minimize" else -1.0) / goal.metric.scale
    gradient[continuous] = sign * np.array(known[goal.label][0])
    jacobian = np.zeros((sum(sizes), dimension))
    first = 0
    for constraint, size in zip(problem.constraints, sizes, strict=True):
        rows = np.array(known[constraint.label]) / constraint.metric.scale
        pieces = result.pieces[constraint.label]
        if len(pieces) != size:
            rows = rows[int(np.argmin(pieces))]
        jacobian[first : first + size, continuous] = rows
        first += size
    return Slopes(gradient, jacobian)


def _objective_pieces(goal: Goal, result: Evaluation, size: int) -> tuple[float, ...]:
    """Values of which the greatest is the objective; its own one ``size`` times where there are no such."""
    value = _minimised(goal, result)
    sign = (1.0 if goal.sense == "minimize" else -1.0) / goal.metric.scale
    pieces = tuple(sign * piece for piece in result.pieces.get(goal.label, ()))
    return pieces if len(pieces) == size and max(pieces) == value else (value,) * size


def _pieces(goal: Goal, result: Evaluation, size: int) -> tuple[float, ...]:
    unknown = BACKOFF if result.cutoff is not None else -FAILED
    pieces = result.pieces.get(goal.label, (unknown * goal.metric.scale,))
    return pieces if len(pieces) == size else (min(pieces),) * size
