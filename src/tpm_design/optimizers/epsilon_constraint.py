"""Fronts by bounds on an objective (Haimes, Lasdon and Wismer, 1971): a ladder of problems with one
objective, each solved by NLopt's COBYLA. Deterministic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tpm_design.optimizers.base import Abilities, FloatArray, Optimizer, Stalled
from tpm_design.optimizers.watch import LOCAL_STEP, Watch, objective_count, watched

SURVEY = 20
"""Points per variable, spread over the cube, from which the extremes are sought."""

STEPS = (LOCAL_STEP, 0.2 * LOCAL_STEP, 0.04 * LOCAL_STEP)
"""First steps of the descents to an extreme: minima over a region have kinks, at which a method that begins
with a large step halts and one that begins anew with a small one goes on."""

SHARES = (0.3, 0.05)
"""First steps of the descents of a rung, as shares of the distance of the designs above and below; the first
begins between them, the second at the best known design."""

SMALLEST_STEP = 1e-3
"""Least first step, as a share of each variable's range."""

TOLERANCE = 1e-5
"""Step, as a share of each variable's range, below which a descent has converged."""

DESCENT = 15
"""Most evaluations per variable and descent."""

FINEST_RUNG = 1.0 / 128.0
"""Least distance of two bounds, as a share of the second objective's range."""

CLOSE = 0.04
"""Neighbours on the front that are this near, as a share of the range of each objective, need no rung between
them."""

SAME = 1e-6
"""Extremes that differ by no more in an objective, in its scale, are one design."""

MET = -1e-7
"""A constraint counts as met up to this: active-set methods end a rounding outside."""


def epsilon_constraint(watch: Watch, seed: int) -> str:
    """The extremes, then the first objective under bounds on the second that halve the widest gap."""
    objective_count(watch)
    known = _Known(watch)
    known.survey()
    # at a design that serves the region metrics over the region have all their pieces
    known.reach_feasible()
    known.see_pieces()
    first = _extreme(known, 0)
    second = _extreme(known, 1)
    width = np.abs(known.objectives(second) - known.objectives(first))
    if np.any(width <= SAME):
        return "One design is best in every objective."
    top, bottom = known.objectives(first)[1], known.objectives(second)[1]
    gaps = [_Gap(bottom, second, top, first)]
    rungs = 0
    while True:
        open_gaps = [gap for gap in gaps if gap.bounds > FINEST_RUNG * width[1]]
        widest = max(open_gaps, key=lambda gap: known.distance(gap.low, gap.high, width), default=None)
        if widest is None or known.distance(widest.low, widest.high, width) <= CLOSE:
            return f"The ladder of bounds is complete: {rungs} between the extremes."
        middle = 0.5 * (widest.lower + widest.upper)
        found = known.between(_Task(0, 1, middle, width), widest.low, widest.high)
        rungs += 1
        # what is below the bound that was found there needs no bound of its own
        reached = min(middle, known.objectives(found)[1])
        gaps.remove(widest)
        if reached > widest.lower:
            gaps.append(_Gap(widest.lower, widest.low, reached, found))
        gaps.append(_Gap(middle, found, widest.upper, widest.high))


@dataclass(frozen=True)
class _Gap:
    """Two bounds on the second objective, and the numbers of the known points that solve them."""

    lower: float
    low: int
    upper: float
    high: int

    @property
    def bounds(self) -> float:
        return self.upper - self.lower


@dataclass(frozen=True)
class _Task:
    """The least of one objective where the other is at most ``bound``; ``width``: the range of both."""

    minimised: int
    bounded: int
    bound: float
    width: FloatArray


def _extreme(known: _Known, objective: int) -> int:
    """The least of one objective, then the least of the other one there."""
    other, width = 1 - objective, known.range()
    best = known.descend(_Task(objective, other, np.inf, width), STEPS)
    least = float(known.objectives(best)[objective])
    return known.descend(_Task(other, objective, least, width), STEPS[1:2])


class _Known:
    """Every point that was evaluated, in order, and descents that begin at the best of them."""

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._points: list[FloatArray] = []
        self._objectives: list[FloatArray] = []
        self._slacks: list[FloatArray] = []
        self._pieces: list[tuple[FloatArray, ...]] = []
        self._numbers: dict[bytes, int] = {}

    def objectives(self, number: int) -> FloatArray:
        return self._objectives[number]

    def met(self, number: int) -> bool:
        return bool(np.all(self._slacks[number] >= MET))

    def distance(self, one: int, other: int, width: FloatArray) -> float:
        """Greatest difference of two points in an objective, as a share of its range."""
        return float(np.max(np.abs(self._objectives[one] - self._objectives[other]) / width))

    def survey(self) -> None:
        """The start, and an additive recurrence of the generalised golden ratio (Roberts, 2018)."""
        size = self._watch.dimension
        ratio = 2.0
        for _ in range(60):
            ratio = (1.0 + ratio) ** (1.0 / (size + 1))
        steps = ratio ** -np.arange(1.0, size + 1.0)
        spread = (0.5 + np.outer(np.arange(1, SURVEY * size + 1), steps)) % 1.0
        self._evaluate(np.vstack([self._watch.start, spread]))

    def see_pieces(self) -> None:
        """From here on constraints and objectives in as many pieces as a known point has; numbers stay."""
        self._watch.see_pieces()
        points = np.array(self._points)
        for values in (self._points, self._objectives, self._slacks, self._pieces, self._numbers):
            values.clear()
        self._evaluate(points)

    def range(self) -> FloatArray:
        """By how much each objective differs among the known points that meet the constraints; 1 without."""
        values = [o for o, s in zip(self._objectives, self._slacks, strict=True) if np.all(s >= MET)]
        width = np.ptp(np.array(values), axis=0) if values else np.zeros(len(self._objectives[0]))
        return np.where(width > 0.0, width, 1.0)

    def _evaluate(self, points: FloatArray) -> list[int]:
        """Numbers of the points; new ones are added."""
        inside: FloatArray = np.clip(points, 0.0, 1.0) + 0.0
        fresh = {point.tobytes(): point for point in inside if point.tobytes() not in self._numbers}
        if fresh:
            new = np.array(list(fresh.values()))
            found = self._watch.evaluate(new)
            for place, key in enumerate(fresh):
                self._numbers[key] = len(self._points)
                self._points.append(new[place])
                self._objectives.append(found.objectives[place])
                self._slacks.append(found.constraints[place])
                self._pieces.append(tuple(values[place] for values in found.objective_pieces))
        return [self._numbers[point.tobytes()] for point in inside]

    def best(self, task: _Task) -> int:
        """The known point that solves a task best: least violation, then the objective."""
        values = np.array(self._objectives)
        violation = np.maximum(0.0, -np.array(self._slacks)).sum(axis=1, initial=0.0)
        violation = violation + np.maximum(0.0, values[:, task.bounded] - task.bound)
        return int(np.lexsort((values[:, task.minimised], np.where(violation <= -MET, 0.0, violation)))[0])

    def reach_feasible(self) -> None:
        """Descend until a point meets the constraints. Raises Stalled where none does."""
        task = _Task(0, 1, np.inf, self.range())
        for step in STEPS:
            if self.met(self.descend(task, (step,))):
                return
        raise Stalled("No design that meets the constraints was found near the initial one or in the survey.")

    def descend(self, task: _Task, steps: Sequence[float]) -> int:
        """The best point after descents from the best known one."""
        for step in steps:
            self._cobyla(task, self._points[self.best(task)], step)
        return self.best(task)

    def between(self, task: _Task, low: int, high: int) -> int:
        """The best point after descents from between two known ones and from the best known one."""
        apart = float(np.abs(self._points[low] - self._points[high]).max())
        long, short = (max(SMALLEST_STEP, min(LOCAL_STEP, share * apart)) for share in SHARES)
        self._cobyla(task, 0.5 * (self._points[low] + self._points[high]), long)
        self._cobyla(task, self._points[self.best(task)], short)
        return self.best(task)

    def _cobyla(self, task: _Task, start: FloatArray, step: float) -> None:
        """One descent. The greatest of several pieces is minimised as a further variable that bounds them:
        linear models follow that around kinks."""
        import nlopt

        size, first = self._watch.dimension, self._evaluate(start[None, :])[0]
        count = len(self._pieces[first][task.minimised])
        bound_above = count > 1
        opt = nlopt.opt(nlopt.LN_COBYLA, size + bound_above)
        opt.set_lower_bounds(np.append(np.zeros(size), -np.inf)[: size + bound_above])
        opt.set_upper_bounds(np.append(np.ones(size), np.inf)[: size + bound_above])
        opt.set_initial_step(step)
        opt.set_xtol_abs(TOLERANCE)
        opt.set_maxeval(DESCENT * (size + 1))

        def shares(x: FloatArray, objective: int) -> FloatArray:
            pieces = self._pieces[self._evaluate(x[None, :size])[0]][objective]
            found: FloatArray = pieces / task.width[objective]
            return found

        def objective(x: FloatArray, gradient: FloatArray) -> float:
            return float(x[size] if bound_above else shares(x, task.minimised)[0])

        def constraints(result: FloatArray, x: FloatArray, jacobian: FloatArray) -> None:
            above = [-self._slacks[self._evaluate(x[None, :size])[0]]]
            if bound_above:
                above.append(shares(x, task.minimised) - x[size])
            if np.isfinite(task.bound):
                above.append(shares(x, task.bounded) - task.bound / task.width[task.bounded])
            result[:] = np.concatenate(above)

        limits = self._watch.constraint_count + count * bound_above
        if np.isfinite(task.bound):
            limits += len(self._pieces[first][task.bounded])
        opt.set_min_objective(objective)
        if limits:
            opt.add_inequality_mconstraint(constraints, np.zeros(limits))
        _run(opt, np.append(start, shares(start, task.minimised).max())[: size + bound_above])


def _run(opt: Any, start: FloatArray) -> None:
    """One descent; where roundoff or NLopt's own failure ends it, the points it found stand."""
    import nlopt

    try:
        opt.optimize(start)
    except Exception:
        # NLopt raises on ends that are ordinary here, under names that differ between its versions.
        if opt.last_optimize_result() not in (nlopt.ROUNDOFF_LIMITED, nlopt.FORCED_STOP, nlopt.FAILURE):
            raise


METHODS = (
    Optimizer(
        "nlopt.epsilon_constraint",
        "front of two objectives: one minimised under a ladder of bounds on the other; deterministic",
        "Haimes, Lasdon and Wismer, 1971; Powell, 1994",
        Abilities(
            constraints=True,
            discrete=False,
            derivatives=False,
            random=False,
            whole_space=True,
            batch=False,
            front=True,
            most_objectives=2,
        ),
        watched(epsilon_constraint),
    ),
)
