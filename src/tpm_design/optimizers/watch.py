"""One run's view of a search: what every library's callback asks of the problem.

Libraries differ in what they do with an exception raised inside a callback; ``Watch`` keeps the first one,
answers nothing more afterwards, and ``watched`` lets it out again whatever the library made of it.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace

import numpy as np

from tpm_design.errors import RefusedError
from tpm_design.optimizers.base import (
    FloatArray,
    FrontSearch,
    Outcomes,
    Question,
    ScreeningSearch,
    Search,
    SlopedSearch,
    Slopes,
    Stalled,
)

LOCAL_STEP = 0.05
"""First step of local methods, as a share of each variable's range: chosen on constrained problems in seven
variables, where it finished the result of a global search best (0.01 to 0.1 differ little)."""

LOCAL_TOLERANCE = 1e-6
"""Step, as a share of each variable's range, below which a local method has converged."""

DIFFERENCE_STEP = 1e-5
"""Step of the difference quotients, as a share of each variable's range."""

RESTART_DISTANCE = 1e-6
"""Methods that are known to stop short begin again where they ended, until a repetition stays this near, as a
share of each variable's range."""

REPEATS_ALLOWED = 10_000
"""Points in a row that were all known before, after which a search has nothing left to find. Without this a
method without an end of its own would never stop on a problem with discrete variables only."""


@dataclass(frozen=True)
class Tangents:
    """Values and slopes at one point: ``objective``, ``constraints`` (m,)."""

    objective: float
    constraints: FloatArray
    slopes: Slopes


class Watch:
    """A search as callbacks see it: points inside the cube, single values, slopes, the first exception."""

    def __init__(self, search: Search) -> None:
        self.search = search
        self.dimension = search.dimension
        self.levels = np.asarray(search.levels, dtype=np.int64)
        self.constraint_count = search.constraint_count
        self.start: FloatArray = np.clip(np.asarray(search.start, dtype=np.float64), 0.0, 1.0)
        self.stopped: BaseException | None = None
        self._known: set[bytes] = set()
        self._repeats = 0

    def evaluate(self, points: FloatArray) -> Outcomes:
        """Values at ``points`` (N, n), moved into the cube where they lie outside.

        Raises whatever ended the search first, again at every later call.
        """
        return self._asked(points, self.search.evaluate)

    def answers(self, questions: deque[Question]) -> Generator[Outcomes]:
        """As ``SlopedSearch``; of a search that knows no slopes without them, and what is asked meanwhile
        waits until the questions before it are answered."""
        search = self.search
        if isinstance(search, SlopedSearch):
            inside: deque[Question] = deque()
            with self._watching(), closing(search.answers(inside)) as answers:
                self._pass_on(questions, inside)
                for found in answers:
                    yield found
                    self._pass_on(questions, inside)
            return
        while questions:
            sizes = [len(question.points) for question in questions]
            points = np.vstack([question.points for question in questions])
            questions.clear()
            found = self.evaluate(points)
            for first, last in itertools.pairwise(itertools.accumulate(sizes, initial=0)):
                yield found.part(slice(first, last))

    def _pass_on(self, questions: deque[Question], inside: deque[Question]) -> None:
        while questions:
            question = questions.popleft()
            inside.append(replace(question, points=self._inside(question.points)))

    def screen(self, points: FloatArray, keep: int) -> Outcomes:
        """As ``evaluate``, the ``keep`` best of them to the end; all where the search cannot screen."""
        search = self.search
        if not isinstance(search, ScreeningSearch):
            return self.evaluate(points)
        return self._asked(points, lambda inside: search.screen(inside, keep))

    def _asked(self, points: FloatArray, ask: Callable[[FloatArray], Outcomes]) -> Outcomes:
        with self._watching():
            return ask(self._inside(points))

    @contextmanager
    def _watching(self) -> Generator[None]:
        """Keep what ends the search, and raise it again instead of going on."""
        if self.stopped is not None:
            raise self.stopped
        try:
            yield
        except GeneratorExit:
            # whoever asked wants no more of these answers
            raise
        except BaseException as reason:
            self.stopped = reason
            raise

    def _inside(self, points: FloatArray) -> FloatArray:
        # + 0.0 turns -0.0 into 0.0: the same point must have the same bits.
        inside: FloatArray = np.clip(np.asarray(points, dtype=np.float64), 0.0, 1.0) + 0.0
        if np.isnan(inside).any():
            raise Stalled("The method broke down: it asked for a point that is not a number.")
        self._note(inside)
        return inside

    def objective(self, point: FloatArray) -> float:
        """The objective at one point (n,)."""
        return float(self.evaluate(point[None, :]).objective[0])

    def merit(self, point: FloatArray) -> float:
        """Objective plus exact penalty at one point (n,)."""
        return float(self.evaluate(point[None, :]).merit[0])

    def constraints(self, point: FloatArray) -> FloatArray:
        """The constraints (m,) at one point (n,), met where ≥ 0."""
        constraints: FloatArray = self.evaluate(point[None, :]).constraints[0]
        return constraints

    def tangents(self, point: FloatArray) -> Tangents:
        """Values and slopes at one point (n,), where the search does not know slopes from one batch of
        2 n + 1 points in the cube.

        Difference quotients over ± ``DIFFERENCE_STEP``: central, one-sided where a bound is nearer.
        """
        middle = np.clip(point, 0.0, 1.0)
        (found,) = self.answers(deque([Question(middle[None, :], sloped=True)]))
        if found.slopes and found.slopes[0] is not None:
            return Tangents(float(found.objective[0]), found.constraints[0], found.slopes[0])
        size = self.dimension
        above = np.minimum(middle + DIFFERENCE_STEP, 1.0)
        below = np.maximum(middle - DIFFERENCE_STEP, 0.0)
        stencil = np.tile(middle, (2 * size + 1, 1))
        each = np.arange(size)
        stencil[1 + each, each] = above
        stencil[1 + size + each, each] = below
        values = self.evaluate(stencil)
        width = above - below
        objective, constraints = values.objective, values.constraints
        gradient = (objective[1 : 1 + size] - objective[1 + size :]) / width
        jacobian = ((constraints[1 : 1 + size] - constraints[1 + size :]) / width[:, None]).T
        return Tangents(float(objective[0]), constraints[0], Slopes(gradient, jacobian))

    def see_pieces(self) -> None:
        """From here on constraints and objectives in as many pieces as a known point has of each."""
        if isinstance(self.search, FrontSearch):
            self.search = self.search.in_pieces()
            self.constraint_count = self.search.constraint_count

    def _note(self, points: FloatArray) -> None:
        """Counts points in a row that were all known before; a level counts as one value."""
        levels = np.maximum(self.levels, 1)
        level = np.minimum(np.floor(points * levels), levels - 1)
        for point in np.where(self.levels > 0, level, points):
            key = point.tobytes()
            if key in self._known:
                self._repeats += 1
            else:
                self._known.add(key)
                self._repeats = 0
        if self._repeats > REPEATS_ALLOWED:
            raise Stalled("Nothing left to try: every further point had been evaluated before.")


def objective_count(watch: Watch) -> int:
    """How many objectives a search has. Raises RefusedError where it tells only one."""
    if not isinstance(watch.search, FrontSearch):
        raise RefusedError("This search has one objective.", remedy="Choose a method for one objective.")
    return watch.search.objective_count


def watched(method: Callable[[Watch, int], str]) -> Callable[[Search, int], str]:
    """``run`` of an optimiser: ``method`` on a fresh Watch, its first exception passed on.

    BudgetSpent, Stalled, KeyboardInterrupt and errors of the problem come out as they were raised.
    """

    def run(search: Search, seed: int) -> str:
        watch = Watch(search)
        sentence = ""
        try:
            sentence = method(watch, seed)
        except BaseException:
            if watch.stopped is None:
                raise
        if watch.stopped is None:
            return sentence
        raise watch.stopped

    return run
