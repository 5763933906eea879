"""Points with what was found there, as local searches compare them."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from tpm_design.optimizers.base import FloatArray, Outcomes

IMPROVED = 1e-7
"""Share of the objective by which a better place must be better."""


@dataclass(frozen=True)
class Place:
    """A point (n,) with its ``objective`` and ``constraints`` (m,)."""

    point: FloatArray
    objective: float
    constraints: FloatArray

    @property
    def violation(self) -> float:
        """Sum of the shortfalls."""
        return float(np.maximum(0.0, -self.constraints).sum())

    def before(self, other: Place) -> bool:
        """Whether it ranks before ``other``: less violation, then less objective."""
        return (self.violation, self.objective) < (other.violation, other.objective)

    def improves(self, other: Place) -> bool:
        """Whether it ranks before ``other`` by more than rounding."""
        if self.violation > 0.0 or other.violation > 0.0:
            return self.violation < other.violation
        return self.objective < other.objective - IMPROVED * abs(other.objective)


def places(points: FloatArray, outcomes: Outcomes) -> list[Place]:
    """Points with their outcomes."""
    rows = zip(points, outcomes.objective, outcomes.constraints, strict=True)
    return [Place(point, float(objective), constraints) for point, objective, constraints in rows]


def looked_at(point: FloatArray) -> Generator[FloatArray, Outcomes, Place]:
    """The place at one point (n,)."""
    (place,) = places(point[None, :], (yield point[None, :]))
    return place
