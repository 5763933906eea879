"""The problem as an optimiser sees it: the unit cube, up to a number of evaluations."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tpm_design.design_space import DesignSpace, value_at
from tpm_design.evaluation.result import Evaluation
from tpm_design.evaluation.slopes import Neighbour, Neighbours
from tpm_design.optimizers.base import Outcomes, Question
from tpm_design.runs.entry import Entry
from tpm_design.runs.log import Asked, EvaluationLog
from tpm_design.runs.outcomes import outcomes, slopes_of
from tpm_design.runs.ranking import cutoff_at
from tpm_design.synthesis.bound import relaxed_designs

FloatArray = NDArray[np.float64]

SCREENED = 32
"""Points that are screened by one cutoff: fixed, so that the log does not depend on the number of workers."""

SLOPE_STEP = 1e-7
"""Share of each range that slopes are differences over: of smooth functions, so that it may be small."""


@dataclass(frozen=True)
class _Around:
    """Designs next to a point. ``rates`` (n,): by which the values of the variables grow with their
    coordinates, 0 of discrete ones."""

    neighbours: Neighbours
    rates: FloatArray


@dataclass(frozen=True)
class UnitSearch:
    """A ``Search`` over a design space, up to ``limit`` entries in the log. ``sizes``: in how many smooth
    pieces each constraint is given to the optimiser; where ``growing``, in as many as a design so far had.
    ``objective_sizes``: each objective, empty for one."""

    log: EvaluationLog
    space: DesignSpace
    start: FloatArray
    limit: int
    sizes: tuple[int, ...]
    objective_sizes: tuple[int, ...] = ()
    growing: bool = False

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

    def answers(self, questions: deque[Question]) -> Generator[Outcomes]:
        """As ``SlopedSearch``."""
        asked: deque[Asked] = deque()
        waiting: deque[tuple[_Around | None, ...]] = deque()
        with closing(self.log.as_they_come(asked, self.limit)) as evaluations:
            while questions or waiting:
                while questions:
                    question = questions.popleft()
                    around = tuple(self._around(p) if question.sloped else None for p in question.points)
                    for point, beside in zip(question.points, around, strict=True):
                        neighbours = None if beside is None else beside.neighbours
                        asked.append(Asked(self.space.design(point), neighbours))
                    waiting.append(around)
                around = waiting.popleft()
                yield self._outcomes([(next(evaluations), beside) for beside in around])

    def _outcomes(self, results: Sequence[tuple[Evaluation, _Around | None]]) -> Outcomes:
        problem, sizes = self.log.problem, self._piece_counts if self.growing else self.sizes
        found = outcomes(problem, [result for result, _ in results], sizes, self.objective_sizes)
        slopes = tuple(
            None if beside is None else slopes_of(problem, result, sizes, beside.rates)
            for result, beside in results
        )
        return replace(found, slopes=slopes)

    @property
    def _piece_counts(self) -> tuple[int, ...]:
        """Of each constraint: how many a design in the log had at most."""
        most = self.log.most_pieces
        return tuple(most.get(goal.label, 1) for goal in self.log.problem.constraints)

    def _around(self, point: FloatArray) -> _Around:
        """A neighbour along each continuous variable, towards the middle of the cube."""
        neighbours, rates = [], np.zeros(self.dimension)
        for number, (variable, coordinate) in enumerate(
            zip(self.space.variables, point.tolist(), strict=True)
        ):
            if not variable.values:
                step = -SLOPE_STEP if coordinate > 0.5 else SLOPE_STEP
                change = float(value_at(variable, coordinate + step)) - float(value_at(variable, coordinate))
                moved = point.copy()
                moved[number] += step
                neighbours.append(Neighbour(self.space.design(moved), change))
                rates[number] = change / step
        return _Around(tuple(neighbours), rates)

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
        most, objectives = self.log.most_pieces, self.log.problem.objectives
        counts = tuple(most.get(goal.label, 1) for goal in objectives)
        return replace(self, sizes=self._piece_counts, objective_sizes=counts)

    def in_growing_pieces(self) -> UnitSearch:
        """The same search, each answer's constraints in as many smooth pieces as a design up to it had."""
        return replace(self, growing=True)

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
