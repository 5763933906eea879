"""How a search went: objective and violation against the number of the evaluation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.problem import Problem
from tpm_design.runs.entry import Entry

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class History:
    """Arrays (N,) over the entries in order. ``objective``: SI, NaN where it has no value. ``best``: the best
    feasible objective so far in the entry's round, NaN before there is one. ``violation``: NaN for failed
    entries; ``closest``: the least so far in the round. ``rounds``: each entry's."""

    numbers: NDArray[np.int64]
    objective: FloatArray
    violation: FloatArray
    feasible: NDArray[np.bool_]
    best: FloatArray
    closest: FloatArray
    rounds: NDArray[np.int64]

    @property
    def first_feasible(self) -> int | None:
        """Number of the first feasible evaluation."""
        return int(self.numbers[np.argmax(self.feasible)]) if self.feasible.any() else None


def history(problem: Problem, entries: tuple[Entry, ...]) -> History:
    """The course of the first objective; of aborted evaluations nothing is told."""
    goal = problem.objectives[0]
    objective = np.array([e.evaluation.metrics.get(goal.label, math.nan) for e in entries], dtype=np.float64)
    violation = np.array([e.evaluation.violation for e in entries], dtype=np.float64)
    aborted = np.array([e.evaluation.status == "aborted" for e in entries], dtype=np.bool_)
    objective[aborted] = violation[aborted] = np.nan
    feasible = np.array([e.evaluation.status == "feasible" for e in entries], dtype=np.bool_)
    better = np.fmin if goal.sense == "minimize" else np.fmax
    violation[~np.isfinite(violation)] = np.nan
    rounds = np.array([entry.round for entry in entries], dtype=np.int64)
    reached = np.where(feasible, objective, np.nan)

    def so_far(accumulated: np.ufunc, values: FloatArray) -> FloatArray:
        parts = [accumulated.accumulate(values[rounds == number]) for number in np.unique(rounds)]
        return np.concatenate(parts) if parts else values

    return History(
        numbers=np.array([entry.number for entry in entries], dtype=np.int64),
        objective=objective,
        violation=violation,
        feasible=feasible,
        best=so_far(better, reached),
        closest=so_far(np.fmin, violation),
        rounds=rounds,
    )
