"""Points with what was found there, as local searches compare them."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from tpm_design.optimizers.base import FloatArray, Outcomes, Question, Slopes

IMPROVED = 1e-7
"""Share of the objective by which a better place must be better."""


@dataclass(frozen=True)
class Place:
    """A point (n,) with its ``objective``, ``constraints`` (m,), and ``slopes`` where they are known."""

    point: FloatArray
    objective: float
    constraints: FloatArray
    slopes: Slopes | None = None

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
    slopes = outcomes.slopes or (None,) * len(points)
    rows = zip(points, outcomes.objective, outcomes.constraints, slopes, strict=True)
    return [
        Place(point, float(objective), constraints, known) for point, objective, constraints, known in rows
    ]


def looked_at(point: FloatArray, *, sloped: bool = True) -> Generator[Question, Outcomes, Place]:
    """The place at one point (n,), with its slopes."""
    points = point[None, :]
    (place,) = places(points, (yield Question(points, sloped)))
    return place
