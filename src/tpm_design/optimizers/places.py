"""What local searches ask, and points with what was found there, as they compare them."""

from __future__ import annotations

import itertools
from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from tpm_design.optimizers.base import FloatArray, Outcomes, Slopes
from tpm_design.optimizers.watch import Watch

IMPROVED = 1e-7
"""Share of the objective by which a better place must be better."""


@dataclass(frozen=True)
class Question:
    """Points (N, n) to be evaluated; ``sloped``: their slopes are asked for as well."""

    points: FloatArray
    sloped: bool = False


def answered(watch: Watch, questions: Sequence[Question]) -> list[Outcomes]:
    """The outcomes of each question, all of them from one batch."""
    points = np.vstack([question.points for question in questions])
    sloped = np.repeat([question.sloped for question in questions], [len(q.points) for q in questions])
    found = watch.evaluate_sloped(points, sloped)
    ends = np.cumsum([0, *(len(question.points) for question in questions)]).tolist()
    return [found.part(slice(*pair)) for pair in itertools.pairwise(ends)]


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
