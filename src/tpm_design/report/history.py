"""How a search went: objective and violation against the number of the evaluation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.problem import Problem
from tpm_design.runs.search import Entry

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class History:
    """Arrays (N,) over the entries in order. ``objective``: SI, NaN where it has no value. ``best``: the best
    feasible objective so far, NaN before there is one. ``violation``: NaN for failed entries; ``closest``:
    the least so far."""

    numbers: NDArray[np.int64]
    objective: FloatArray
    violation: FloatArray
    feasible: NDArray[np.bool_]
    best: FloatArray
    closest: FloatArray

    @property
    def first_feasible(self) -> int | None:
        """Number of the first feasible evaluation."""
        return int(self.numbers[np.argmax(self.feasible)]) if self.feasible.any() else None


def history(problem: Problem, entries: tuple[Entry, ...]) -> History:
    """The course of the first objective."""
    goal = problem.objectives[0]
    objective = np.array([e.evaluation.metrics.get(goal.label, math.nan) for e in entries], dtype=np.float64)
    violation = np.array([e.evaluation.violation for e in entries], dtype=np.float64)
    feasible = np.array([e.evaluation.status == "feasible" for e in entries], dtype=np.bool_)
    better = np.fmin if goal.sense == "minimize" else np.fmax
    violation[~np.isfinite(violation)] = np.nan
    return History(
        numbers=np.array([entry.number for entry in entries], dtype=np.int64),
        objective=objective,
        violation=violation,
        feasible=feasible,
        best=better.accumulate(np.where(feasible, objective, np.nan)),
        closest=np.fmin.accumulate(violation),
    )
