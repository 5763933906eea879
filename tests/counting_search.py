"""A search of the unit cube as the program makes one: repeated designs are free, a new one past the budget is
refused."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from tpm_design.optimizers.base import BudgetSpent, FloatArray, Optimizer, Outcomes, Stalled

FEASIBLE = 1e-6

Value = TypeVar("Value")
Value_co = TypeVar("Value_co", covariant=True)


class CubeCase(Protocol[Value_co]):
    """``function``: point of the cube → objective or objectives to minimise, constraints met where ≥ 0."""

    @property
    def function(self) -> Callable[[FloatArray], tuple[Value_co, list[float]]]: ...
    @property
    def start(self) -> tuple[float, ...]: ...
    @property
    def constraints(self) -> int: ...
    @property
    def levels(self) -> tuple[int, ...]: ...


@dataclass
class CountingSearch(ABC, Generic[Value]):
    """``log``: the designs in the order they were paid for. ``after_end``: calls after the budget was
    spent."""

    case: CubeCase[Value]
    budget: int
    log: list[FloatArray] = field(default_factory=list)
    batches: list[int] = field(default_factory=list)
    values: dict[bytes, tuple[Value, list[float]]] = field(default_factory=dict)
    spent: bool = False
    after_end: int = 0

    @property
    def dimension(self) -> int:
        return len(self.case.start)

    @property
    def levels(self) -> tuple[int, ...]:
        return self.case.levels or (0,) * self.dimension

    @property
    def start(self) -> FloatArray:
        return np.array(self.case.start)

    @property
    def constraint_count(self) -> int:
        return self.case.constraints

    @abstractmethod
    def evaluate(self, points: FloatArray) -> Outcomes:
        """As ``Search``."""

    def measured(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values (N, …) and constraints (N, m) at points (N, n)."""
        self.after_end += self.spent
        assert points.ndim == 2
        assert points.shape[1] == self.dimension
        assert np.all((points >= 0.0) & (points <= 1.0))
        paid = len(self.log)
        results = [self._value(point) for point in points]
        self.batches.append(len(self.log) - paid)
        constraints = np.array([slack for _, slack in results]).reshape(len(points), self.case.constraints)
        return np.array([value for value, _ in results]), constraints

    def _value(self, point: FloatArray) -> tuple[Value, list[float]]:
        design = point.copy()
        for i, count in enumerate(self.levels):
            if count:
                design[i] = (min(int(design[i] * count), count - 1) + 0.5) / count
        key = design.tobytes()
        if key not in self.values:
            if len(self.log) >= self.budget:
                self.spent = True
                raise BudgetSpent
            self.values[key] = self.case.function(design)
            self.log.append(design)
        return self.values[key]

    def feasible(self) -> list[tuple[Value, FloatArray]]:
        """Values and designs that meet all constraints, in the order they were paid for."""
        found = [(*self.values[x.tobytes()], x) for x in self.log]
        feasible = [(value, x) for value, slack, x in found if min(slack, default=0.0) >= -FEASIBLE]
        assert feasible, "no feasible design was found"
        return feasible


Counting = TypeVar("Counting", bound=CountingSearch[Any])


def run_to_its_end(method: Optimizer, search: Counting, seed: int) -> Counting:
    """The search, after the method said why it ended, or stalled, or spent the budget."""
    try:
        assert method.run(search, seed).endswith(".")
    except BudgetSpent:
        assert search.spent
    except Stalled as end:
        assert str(end).endswith(".")
    return search
