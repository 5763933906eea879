"""Local searches from many starts, in step, until further starts end where earlier ones did."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from math import prod
from typing import Protocol, runtime_checkable

import numpy as np

from tpm_design.optimizers.base import Abilities, FloatArray, Optimizer, Outcomes, Question, Search
from tpm_design.optimizers.descent import BLURRED, SHARP, Landing, descend
from tpm_design.optimizers.levels import descend_levels
from tpm_design.optimizers.places import Place, looked_at, places
from tpm_design.optimizers.starts import Starts, are_one, choice_of
from tpm_design.optimizers.watch import Watch

ABREAST, SLOPED_ABREAST = 4, 8
"""Local searches under way at a time: each asks for a point for every variable where slopes are not known,
otherwise for one."""

FIRST_STARTS = 4
"""Starts from the sample before the best optimum is looked at more closely."""

RADIUS = 0.2
"""First trust region of a local search from a sample, as a share of each range."""

COARSE = 1e-4
"""Trust region at which such a search has come near enough to an optimum; the best ones are finished."""

COARSE_STEPS = 60
"""After so many steps it ends in any case: those that take longer seldom lead anywhere."""

POLISH = ((0.1, BLURRED), (0.03, SHARP), (0.003, SHARP))
"""First trust region and differences of the searches that begin again where the best one ended, in turn."""

AGAIN = 0.03
"""First trust region of a search that goes on from the best place that another one saw."""

RIVALS, NEARLY = 3, 0.05
"""The best optima of so many discrete choices are looked at more closely, if their objectives are no farther
than this share from the best: which choice is best shows only then."""

HOP_STARTS = 3
"""A search from near the best optimum follows each of so many from the sample."""

HOPS = (0.17, 0.35)
"""Distances, as shares of the ranges, by which the best optimum is perturbed for a new start."""

EQUAL = 1e-4
"""Optima whose objectives differ by a smaller share than this are equally good."""

AGREED = 5
"""Independent local searches that must have ended at an objective as good as the best."""

ON_THE_WAY = (0.1, 0.5, 0.9)
"""Where, between an optimum and a better one, it is tested whether the way leads downhill."""

ENUMERATED = 4096
"""Number of designs, where all variables are discrete, up to which each is evaluated in the end."""

Task = Generator[Question, Outcomes, None]


@runtime_checkable
class PiecewiseSearch(Protocol):
    """A search that can give its constraints in smooth pieces, and keeps what its method calls optima."""

    def in_growing_pieces(self) -> Search:
        """The same search, each answer's constraints in as many pieces as the points up to it had."""
        ...

    def note_optima(self, points: FloatArray) -> None:
        """The local optima (N, n) known by now, in place of those told before."""
        ...


@dataclass
class Optimum:
    """A local optimum. ``hits``: independent searches that ended there; ``finished``: polished, and its
    neighbouring discrete choices tried."""

    landing: Landing
    hits: int
    finished: bool = False

    @property
    def place(self) -> Place:
        return self.landing.place


def multistart(search: Search, seed: int) -> str:
    """Sobol starts, local searches abreast, then hops from the best optimum and further starts in turn.

    Converged where ``AGREED`` independent searches ended at the best objective and, by their number n and
    that of the optima w, no more than half an optimum more is to be expected: C. G. E. Boender and A. H. G.
    Rinnooy Kan, Bayesian stopping rules for multistart global optimization methods, 1987. Raises BudgetSpent.
    """
    return _Course(search, seed).run()


class _UnderWay:
    """A task, the question it waits for, and the best feasible place it saw."""

    def __init__(self, task: Task, asked: Question) -> None:
        self._task, self.asked, self.over = task, asked, False
        self.best: Place | None = None

    def go_on(self, found: Outcomes) -> None:
        """Hand over the outcomes and wait for the next question."""
        for place in places(self.asked.points, found):
            if place.violation == 0.0 and (self.best is None or place.before(self.best)):
                self.best = place
        try:
            self.asked = self._task.send(found)
        except StopIteration:
            self.over = True


class _Course:
    def __init__(self, search: Search, seed: int) -> None:
        self._search = search
        self._whole = Watch(search)
        self._pieces = self._whole
        if isinstance(search, PiecewiseSearch):
            self._pieces = Watch(search.in_growing_pieces())
        self._levels = self._whole.levels
        self._free = np.flatnonzero(self._levels == 0)
        self._designs = np.inf if len(self._free) else prod(self._levels.tolist())
        self._random = np.random.default_rng(seed)
        self._starts = Starts(self._whole, seed)
        self._optima: list[Optimum] = []
        self._begun = self._ended = self._landed = self._hops = 0
        self._finishing = False
        self._left: list[Place] = []
        self._abreast = ABREAST

    def run(self) -> str:
        self._starts.sample()
        under_way: deque[_UnderWay] = deque()
        questions: deque[Question] = deque()
        # the oldest question is always the next to be answered: so where searches go does not depend on how
        # long evaluations take, and while one of them goes on, others are being evaluated
        with closing(self._pieces.answers(questions)) as answers:
            while not self._few_left() and not self._converged():
                while len(under_way) < self._abreast:
                    task = self._next_task()
                    if (first := next(task, None)) is not None:
                        under_way.append(_UnderWay(task, first))
                        questions.append(first)
                one = under_way.popleft()
                found = next(answers)
                if any(slopes is not None for slopes in found.slopes):
                    self._abreast = SLOPED_ABREAST
                one.go_on(found)
                if not one.over:
                    under_way.append(one)
                    questions.append(one.asked)
                elif one.best:
                    self._left.append(one.best)
        if self._designs <= ENUMERATED:
            self._enumerate()
            return "Converged: every design was evaluated."
        hits = sum(optimum.hits for optimum in self._best_ones())
        return f"Converged: {hits} of {self._landed} independent local searches ended at the best objective."

    # ------------------------------------------------------------------------------ what is begun

    def _next_task(self) -> Task:
        best = self._best()
        while self._left:
            left = self._left.pop()
            if best is None or left.improves(best.place):
                self._left = []
                return self._from_left(left)
        if self._ended >= FIRST_STARTS and best is not None:
            rivals = self._rivals(best)
            unfinished = next((rival for rival in rivals if not rival.finished), None)
            if unfinished is not None and not self._finishing:
                return self._finish(unfinished)
            if self._begun >= HOP_STARTS * (self._hops + 1):
                self._hops += 1
                return self._hop(rivals[self._hops // len(HOPS) % len(rivals)])
        self._begun += 1
        ordered = sorted(self._optima, key=lambda optimum: optimum.place.objective)
        return self._from_sample(self._starts.next([optimum.place.point for optimum in ordered]))

    def _from_sample(self, sample: Place) -> Task:
        start = yield from looked_at(sample.point)
        landing = yield from self._descended(start, RADIUS)
        self._ended += 1
        yield from self._arrived(landing, independent=True)

    def _from_left(self, left: Place) -> Task:
        """From the best place that a search saw, where it went elsewhere and found nothing better."""
        start = yield from looked_at(left.point)
        landing = yield from self._descended(start, AGAIN)
        yield from self._arrived(landing, independent=False)

    def _hop(self, optimum: Optimum) -> Task:
        sigma = HOPS[self._hops % len(HOPS)] / max(1, len(self._free)) ** 0.5
        point = optimum.place.point.copy()
        point[self._free] += sigma * self._random.standard_normal(len(self._free))
        start = yield from looked_at(np.clip(point, 0.0, 1.0))
        landing = yield from self._descended(start, 0.5 * RADIUS)
        yield from self._arrived(landing, independent=False)

    def _descended(self, start: Place, radius: float) -> Generator[Question, Outcomes, Landing]:
        landing = yield from descend(start, self._free, radius, self._known, COARSE, COARSE_STEPS)
        if not len(self._free):
            landing = yield from descend_levels(landing, self._levels)
        return landing

    def _finish(self, optimum: Optimum) -> Task:
        """Polish an optimum, then, of the best one, try the neighbours in the discrete variables."""
        self._finishing = True
        landing = optimum.landing
        for radius, blur in POLISH if len(self._free) else ():
            further = yield from descend(landing.place, self._free, radius, blur=blur)
            if not landing.place.improves(further.place):
                landing = further
        optimum.landing, optimum.finished = landing, True
        self._tell()
        if np.any(self._levels > 0) and optimum is self._best():
            landing = yield from descend_levels(landing, self._levels)
            if landing is not optimum.landing:
                yield from self._arrived(landing, independent=False)
        self._finishing = False

    # ------------------------------------------------------------------------------ what was found

    def _known(self, place: Place) -> bool:
        """Whether a search has come to where an earlier one ended."""
        near = self._near(place)
        return near is not None and not place.improves(near.place)

    def _near(self, place: Place) -> Optimum | None:
        for optimum in self._optima:
            if are_one(optimum.place.point, place.point, self._levels):
                return optimum
        return None

    def _alike(self, one: Place, other: Place) -> bool:
        return choice_of(one.point, self._levels) == choice_of(other.point, self._levels)

    def _arrived(self, landing: Landing, *, independent: bool) -> Task:
        """Take in where a search ended: a new optimum, or one more way to a known one."""
        known = self._near(landing.place) or self._near(landing.last)
        if known is None and landing.place.violation > 0.0:
            return
        self._landed += independent
        if known is None:
            known = yield from self._downhill(landing.place)
        if known is None:
            self._optima.append(Optimum(landing, int(independent)))
        else:
            known.hits += independent
            if landing.place.improves(known.place):
                known.landing, known.finished = landing, False
        self._tell()

    def _downhill(self, place: Place) -> Generator[Question, Outcomes, Optimum | None]:
        """The nearest optimum that is as good, if the straight way there never leads uphill."""
        others = [o for o in self._optima if self._alike(o.place, place)]
        others.sort(key=lambda o: float(np.abs(o.place.point - place.point).max()))
        for other in others[:1]:
            ends = sorted([place, other.place], key=lambda end: end.objective)
            way = ends[0].point - ends[1].point
            points = ends[1].point + np.array(ON_THE_WAY)[:, None] * way
            allowed = ends[1].objective + EQUAL * 0.1 * abs(ends[1].objective)
            found = places(points, (yield Question(points)))
            if all(step.violation <= 1e-6 and step.objective <= allowed for step in found):
                return other
        return None

    def _best(self) -> Optimum | None:
        return min(self._optima, key=lambda optimum: optimum.place.objective, default=None)

    def _rivals(self, best: Optimum) -> list[Optimum]:
        """The best optimum of each discrete choice that comes near the best of all, which is the first."""
        bound = best.place.objective + NEARLY * abs(best.place.objective)
        rivals: dict[object, Optimum] = {}
        for optimum in sorted(self._optima, key=lambda optimum: optimum.place.objective):
            if optimum.place.objective <= bound:
                rivals.setdefault(choice_of(optimum.place.point, self._levels), optimum)
        return list(rivals.values())[:RIVALS]

    def _best_ones(self) -> list[Optimum]:
        best = self._best()
        if best is None:
            return []
        bound = best.place.objective + EQUAL * abs(best.place.objective)
        return [optimum for optimum in self._optima if optimum.place.objective <= bound]

    def _converged(self) -> bool:
        best = self._best()
        if best is None or not best.finished or self._finishing:
            return False
        optima, landed = len(self._optima), self._landed
        if sum(optimum.hits for optimum in self._best_ones()) < AGREED or landed <= optima + 2:
            return False
        return optima * (landed - 1) / (landed - optima - 2) <= optima + 0.5

    def _tell(self) -> None:
        if isinstance(self._search, PiecewiseSearch):
            ordered = sorted(self._optima, key=lambda optimum: optimum.place.objective)
            self._search.note_optima(np.array([optimum.place.point for optimum in ordered]))

    def _few_left(self) -> bool:
        """Whether it is time to evaluate every design: after a few local searches, or a sample as large."""
        return self._designs <= min(ENUMERATED, 2 * self._starts.batch) or (
            self._designs <= ENUMERATED and self._ended >= FIRST_STARTS
        )

    def _enumerate(self) -> None:
        counts = self._levels.tolist()
        numbers = np.indices(counts).reshape(len(counts), -1).T
        self._whole.evaluate((numbers + 0.5) / self._levels)


METHODS = (
    Optimizer(
        "multistart",
        "local searches from low-discrepancy starts by quadratic programs; lists every local optimum",
        "Rinnooy Kan and Timmer, 1987; Fletcher, 1987",
        Abilities(
            constraints=True, discrete=True, derivatives=False, random=True, whole_space=True, batch=True
        ),
        multistart,
    ),
)
