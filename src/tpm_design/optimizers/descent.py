"""A local search that asks for its points in batches: sequential quadratic programming in a trust region.

A descent is a generator: it yields questions and is sent the outcomes. So several of them go on in step, each
round of their points one batch, without threads.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.optimizers.base import FloatArray, Outcomes, Question, Slopes
from tpm_design.optimizers.cuts import Cuts, cuts_near
from tpm_design.optimizers.measure import FIRST_PENALTY, INSIDE, Measure
from tpm_design.optimizers.places import Place, looked_at
from tpm_design.optimizers.quadratic import Program, Step, elastic_step

FINE = 1e-6
"""Trust region, as a share of each range, at which a descent has converged."""

NEGLIGIBLE = 1e-2
"""So many times that share of the objective is a gain that is not worth a step."""

FINEST_DIFFERENCE = 1e-6
"""Least step of the difference quotients, as a share of each range."""

SHARP, BLURRED = 0.01, 0.1
"""Shares of the last step that difference quotients are taken over: where slopes are to be exact, and where
small kinks and steps are to be overlooked."""

ACCEPTED, POOR, GOOD = 0.05, 0.3, 0.7
"""Shares of the promised gain: from which a step is taken, below which the next is shorter, from which it may
be longer."""

WIDEST = 0.5
SHRINKING = 0.3
"""The widest trust region, and the factor on it after a step that was not taken."""

FIRST_CURVATURE, CURVATURES = 0.1, (1e-4, 1e4)

NEARLY_MET = 1e-2
"""Shortfall below which the penalty may shrink again."""

MISSED = 1e-3
"""Shortfall from which a descent that found no way down tries a larger penalty, once."""

KINKED = 0.02
"""A second step in a row that was not taken looks for a kink where it led, if it is no longer than this."""

REMEMBERED, FORGETTING, AFRESH = 6, 2, 0.01
"""Places whose slopes are kept; how often they may be forgotten where they hold a descent back, and the trust
region after that."""

INWARD = (2.0, 6.0, 18.0, 54.0)
"""Last steps aim inside by so many times the shortfall."""

MOST_STEPS = 200

Walk = Generator[Question, Outcomes, "Landing"]
"""Yields questions, is sent their outcomes, returns where it landed."""


@dataclass(frozen=True)
class Landing:
    """Where a descent ended: the best ``place``, the ``last`` one, and how it saw the problem there."""

    place: Place
    last: Place
    program: Program
    weights: FloatArray
    height: float
    penalty: float

    def guess(self, place: Place, free: NDArray[np.int64], radius: float) -> tuple[float, FloatArray]:
        """Where the same slopes would lead from another place within ``radius``: the penalised objective,
        measured, and the point (n,)."""
        needed = place.constraints * self.weights - INSIDE
        step = elastic_step(
            self.program.with_constraints(needed).around(place.point[free], radius), self.penalty
        )
        value = place.objective * self.height + step.descent + self.penalty * step.shortfall
        return value, _moved(place.point, free, step.step)


class _MorePieces(Exception):  # noqa: N818 - not an error
    """The constraints came in another number of pieces than before; ``here``: where to go on from."""

    def __init__(self, here: Place) -> None:
        super().__init__()
        self.here = here


def never(place: Place) -> bool:
    """For descents that are not to be abandoned."""
    return False


def descend(
    start: Place,
    free: NDArray[np.int64],
    radius: float,
    abandoned: Callable[[Place], bool] = never,
    fine: float = FINE,
    steps: int = MOST_STEPS,
    blur: float = SHARP,
) -> Walk:
    """Walk downhill from ``start`` in the variables ``free`` (their numbers), the others held.

    ``radius``: of the first trust region; ``fine``: of the last. ``abandoned``: asked at every new place
    whether to give up. ``steps``: at most. ``blur``: where slopes are not known, or this is more than
    ``SHARP``, differences are taken over this share of the last step, at most its square.

    Sources: R. Fletcher, Practical methods of optimization, 1987, 14.4 (exact penalty in a trust region,
    correction of second order); M. J. D. Powell, 1978 (damped update of the curvature).
    """
    if not len(free):
        return _standing(start)
    while True:
        try:
            return (yield from _Descent(start, free, radius, fine, blur).run(abandoned, steps))
        except _MorePieces as more:
            start = yield from looked_at(more.here.point)


def _standing(start: Place) -> Landing:
    """Where there is nothing to move."""
    none, count = np.zeros(0), len(start.constraints)
    still = Program(np.eye(0), none, start.constraints, np.zeros((count, 0)), none, none)
    return Landing(start, start, still, np.ones(count), 1.0, FIRST_PENALTY)


class _Descent:
    def __init__(
        self, start: Place, free: NDArray[np.int64], radius: float, fine: float, blur: float
    ) -> None:
        self._free, self._fine, self._first, self._blur = free, fine, radius, blur
        self._here = self._best = start
        self._radius, self._width = radius, self._difference(radius)
        self._measure = Measure(len(start.constraints))
        self._curvature = FIRST_CURVATURE * np.eye(len(free))
        self._seen: list[tuple[Place, FloatArray]] = []
        self._failures, self._forgetting, self._harder = 0, FORGETTING, 1
        self._gradient, self._jacobian = np.zeros(len(free)), np.zeros((len(start.constraints), len(free)))

    def run(self, abandoned: Callable[[Place], bool], steps: int) -> Walk:
        measure = self._measure
        self._gradient, self._jacobian = yield from self._slopes_here()
        self._curvature *= measure.follow(self._here, self._gradient, self._jacobian)
        for _ in range(steps):
            cuts = cuts_near(self._here, self._free, self._seen, measure, self._radius)
            program = self._program(cuts)
            shortfall = measure.shortfall(self._here)
            step = measure.steered(program, easing=shortfall < NEARLY_MET)
            promised = -step.descent + measure.penalty * (shortfall - step.shortfall)
            if self._at_rest(step, promised):
                if self._stirred(step, shortfall):
                    continue
                break
            trial = yield from self._look(step.step)
            if self._bent(trial, step, promised):
                trial, step = yield from self._corrected(program, trial, step)
            if trial.before(self._best):
                self._best = trial
            gain, length = measure.gain(self._here, trial), float(np.abs(step.step).max())
            if gain < ACCEPTED * promised:
                yield from self._stay(trial, step)
                continue
            if gain > GOOD * promised and length > 0.8 * self._radius:
                self._radius = min(WIDEST, 2.0 * self._radius)
            elif gain < POOR * promised:
                self._radius = max(0.5 * self._radius, FINE)
            if abandoned(trial):
                self._here = trial
                return self._landing()
            yield from self._move(trial, length, cuts.folded(step.multipliers))
        yield from self._step_inside()
        return self._landing()

    def _program(self, cuts: Cuts) -> Program:
        measure = self._measure
        return Program(
            self._curvature,
            self._gradient * measure.height,
            np.concatenate([measure.needed(self._here), cuts.values]),
            np.vstack([self._jacobian * measure.weights[:, None], cuts.slopes]),
            np.zeros(len(self._free)),
            np.zeros(len(self._free)),
        ).around(self._here.point[self._free], self._radius)

    def _at_rest(self, step: Step, promised: float) -> bool:
        size = max(1e-3, abs(self._here.objective) * self._measure.height)
        length = float(np.abs(step.step).max())
        small = promised < NEGLIGIBLE * self._fine * size
        return self._radius < self._fine or length < 0.1 * self._fine or small

    def _stirred(self, step: Step, shortfall: float) -> bool:
        """Go on where a descent may have come to rest too early: whether there was anything to change."""
        held_back = float(step.multipliers[len(self._here.constraints) :].sum()) > 1e-9
        if held_back and self._forgetting:
            self._forgetting -= 1
            self._seen, self._radius = [], AFRESH
            return True
        if shortfall > MISSED and self._harder:
            self._harder -= 1
            self._measure.penalty *= 100.0
            self._radius = self._first
            return True
        return False

    def _bent(self, trial: Place, step: Step, promised: float) -> bool:
        """Whether the bend of constraints cost most of what a step did not gain."""
        missed = self._measure.penalty * (self._measure.shortfall(trial) - step.shortfall)
        gain = self._measure.gain(self._here, trial)
        return gain < GOOD * promised and missed > 0.5 * (promised - gain)

    def _corrected(
        self, program: Program, trial: Place, step: Step
    ) -> Generator[Question, Outcomes, tuple[Place, Step]]:
        """The better of a step and another that aims at the constraints as the first one found them."""
        measure, count = self._measure, len(trial.constraints)
        found = program.constraints.copy()
        found[:count] = measure.needed(trial) - program.jacobian[:count] @ step.step
        if float(np.abs(found - program.constraints).max()) >= 10.0 * self._radius:
            return trial, step
        second = elastic_step(program.with_constraints(found), measure.penalty)
        if np.abs(second.step - step.step).max() <= 1e-4 * np.abs(step.step).max():
            return trial, step
        again = yield from self._look(second.step)
        better = measure.gain(self._here, again) > measure.gain(self._here, trial)
        return (again, second) if better else (trial, step)

    def _stay(self, trial: Place, step: Step) -> Generator[Question, Outcomes, None]:
        """Shrink the trust region, and look closer at what was mistaken."""
        length = float(np.abs(step.step).max())
        self._failures += 1
        kinked = self._failures > 1 and length < KINKED
        if (self._known(trial) or kinked) and self._measure.shortfall(trial) > step.shortfall:
            width, self._width = self._width, self._difference(length)
            beyond = yield from self._slopes(trial)
            self._width = width
            self._seen.append((trial, beyond.jacobian))
        self._radius = SHRINKING * min(self._radius, max(length, 0.1 * FINE))
        if (
            self._known(self._here) is None
            and FINE < self._radius < 30.0 * self._width > 30.0 * FINEST_DIFFERENCE
        ):
            self._width = self._difference(self._radius)
            self._gradient, self._jacobian = yield from self._slopes_here()

    def _move(
        self, trial: Place, length: float, multipliers: FloatArray
    ) -> Generator[Question, Outcomes, None]:
        """Take a step, and update what is known of the slopes."""
        measure, here = self._measure, self._here
        multipliers = multipliers * measure.weights / measure.height
        slope = self._gradient - self._jacobian.T @ multipliers
        self._failures = 0
        self._seen = [*self._seen, (here, self._jacobian)][-REMEMBERED:]
        self._here, self._width = trial, self._difference(length)
        self._gradient, self._jacobian = yield from self._slopes_here()
        turned = self._gradient - self._jacobian.T @ multipliers - slope
        way = trial.point[self._free] - here.point[self._free]
        self._curvature = _updated(self._curvature, way, turned * measure.height)
        self._curvature *= measure.follow(trial, self._gradient, self._jacobian)

    def _step_inside(self) -> Generator[Question, Outcomes, None]:
        """Kinks are often reached from outside: step inside, a little further each time."""
        shortfall = self._measure.shortfall(self._here)
        if not 0.0 < shortfall < NEARLY_MET:
            return
        cuts = cuts_near(self._here, self._free, self._seen, self._measure, self._radius)
        program = self._program(cuts).around(self._here.point[self._free], 0.5 * self._first)
        for aim in INWARD:
            aimed = program.with_constraints(program.constraints - aim * shortfall)
            step = elastic_step(aimed, 1e3 * self._measure.penalty)
            inner = yield from self._look(step.step)
            if inner.before(self._best):
                self._best = inner
            if inner.violation == 0.0:
                return

    def _landing(self) -> Landing:
        measure, none = (
            self._measure,
            Cuts(np.zeros(0), np.zeros((0, len(self._free))), np.zeros(0, np.int64)),
        )
        program = self._program(none)
        return Landing(self._best, self._here, program, measure.weights, measure.height, measure.penalty)

    def _look(self, step: FloatArray) -> Generator[Question, Outcomes, Place]:
        point = _moved(self._here.point, self._free, step)
        place = yield from looked_at(point, sloped=self._blur <= SHARP)
        self._check(place.constraints)
        return place

    def _slopes_here(self) -> Generator[Question, Outcomes, tuple[FloatArray, FloatArray]]:
        found = yield from self._slopes(self._here)
        return found.gradient, found.jacobian

    def _slopes(self, place: Place) -> Generator[Question, Outcomes, Slopes]:
        """In the free variables: those that are known, else difference quotients, towards the middle of the
        cube."""
        free, each, known = self._free, np.arange(len(self._free)), self._known(place)
        if known is not None:
            return Slopes(known.gradient[free], known.jacobian[:, free])
        points = np.tile(place.point, (len(free), 1))
        points[each, free] += np.where(place.point[free] > 0.5, -self._width, self._width)
        steps = points[each, free] - place.point[free]
        found = yield Question(points)
        self._check(found.constraints[0])
        gradient = (found.objective - place.objective) / steps
        return Slopes(gradient, ((found.constraints - place.constraints) / steps[:, None]).T)

    def _known(self, place: Place) -> Slopes | None:
        """Slopes as they are lead nowhere across small steps and kinks."""
        return None if self._blur > SHARP else place.slopes

    def _difference(self, step: float) -> float:
        return float(np.clip(self._blur * step, FINEST_DIFFERENCE, self._blur**2))

    def _check(self, constraints: FloatArray) -> None:
        if len(constraints) != len(self._here.constraints):
            raise _MorePieces(self._here)


def _moved(point: FloatArray, free: NDArray[np.int64], step: FloatArray) -> FloatArray:
    moved = point.copy()
    moved[free] = np.clip(moved[free] + step, 0.0, 1.0)
    return moved


def _updated(curvature: FloatArray, way: FloatArray, turned: FloatArray) -> FloatArray:
    """The damped update of the curvature from a step and the change of the gradient along it."""
    bent = curvature @ way
    along = float(way @ bent)
    if along <= 1e-20:
        return curvature
    product = float(way @ turned)
    share = 1.0 if product >= 0.2 * along else 0.8 * along / (along - product)
    turned = share * turned + (1.0 - share) * bent
    updated = curvature - np.outer(bent, bent) / along + np.outer(turned, turned) / float(way @ turned)
    values, vectors = np.linalg.eigh(0.5 * (updated + updated.T))
    limited: FloatArray = (vectors * np.clip(values, *CURVATURES)) @ vectors.T
    return limited
