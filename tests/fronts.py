"""Problems of the unit cube with two and three objectives, their fronts known, and the searches for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from counting_search import CountingSearch, run_to_its_end
from tpm_design.optimizers.base import FloatArray, Optimizer, Outcomes
from tpm_design.runs.front import non_dominated

Values = tuple[list[float], list[float]]


@dataclass(frozen=True)
class FrontCase:
    """``function``: point of the cube → objectives to minimise, constraints met where ≥ 0."""

    function: Callable[[FloatArray], Values]
    start: tuple[float, ...]
    objectives: int = 2
    constraints: int = 0
    levels: tuple[int, ...] = ()


@dataclass
class FrontMemo(CountingSearch[list[float]]):
    """A search that tells all its objectives."""

    case: FrontCase

    @property
    def objective_count(self) -> int:
        return self.case.objectives

    def in_pieces(self) -> FrontMemo:
        return self

    def evaluate(self, points: FloatArray) -> Outcomes:
        values, constraints = self.measured(points)
        objectives = values.reshape(len(points), -1)
        pieces = tuple(column[:, None] for column in objectives.T)
        first = objectives[:, 0]
        return Outcomes(first, constraints, first, objectives=objectives, objective_pieces=pieces)

    def front(self) -> tuple[FloatArray, FloatArray]:
        """Objectives (M, k) and designs (M, n) of the feasible front, by the first objective."""
        values, designs = zip(*self.feasible(), strict=True)
        table = np.array(values)
        rows = non_dominated(table)
        return table[rows], np.array(designs)[rows]


def searched(method: Optimizer, case: FrontCase, budget: int, seed: int = 1) -> FrontMemo:
    return run_to_its_end(method, FrontMemo(case, budget), seed)


def between_two_points(x: FloatArray) -> Values:
    """Squared distances to two points, as shares of the squared distance of these: √f₁ + √f₂ = 1 between
    them, and nowhere less (the triangle inequality)."""
    one, other = np.full(len(x), 0.2), np.full(len(x), 0.8)
    apart = np.sum((one - other) ** 2)
    return [float(np.sum((x - one) ** 2) / apart), float(np.sum((x - other) ** 2) / apart)], []


def binh_korn(x: FloatArray) -> Values:
    """Binh and Korn, 1997. Front: f₂ against f₁ in closed form, ``binh_korn_front``."""
    u, v = 5.0 * x[0], 3.0 * x[1]
    objectives = [4.0 * u**2 + 4.0 * v**2, (u - 5.0) ** 2 + (v - 5.0) ** 2]
    return objectives, [25.0 - (u - 5.0) ** 2 - v**2, (u - 8.0) ** 2 + (v + 3.0) ** 2 - 7.7]


def binh_korn_front(first: FloatArray) -> FloatArray:
    """Designs u = v up to 3, then v = 3 and u up to 5: where no constraint is active but at the origin."""
    u = np.where(first <= 72.0, np.sqrt(first / 8.0), np.sqrt(np.maximum(first / 4.0 - 9.0, 0.0)))
    v = np.where(first <= 72.0, u, 3.0)
    return (u - 5.0) ** 2 + (v - 5.0) ** 2


def tanaka(x: FloatArray) -> Values:
    """Tanaka, Watanabe, Furukawa and Tanino, 1995: the objectives are the variables; the front lies in pieces
    on x² + y² = 1 + cos(16 atan(x/y))/10."""
    u, v = np.pi * float(x[0]), np.pi * float(x[1])
    wave = 0.1 * np.cos(16.0 * np.arctan2(u, v))
    return [u, v], [u**2 + v**2 - 1.0 - wave, 0.5 - (u - 0.5) ** 2 - (v - 0.5) ** 2]


def octant(x: FloatArray) -> Values:
    """Deb's DTLZ2, 2005, with three objectives and two distance variables: f₁² + f₂² + f₃² = 1 and more."""
    far = 1.0 + float(np.sum((x[2:] - 0.5) ** 2))
    a, b = 0.5 * np.pi * x[0], 0.5 * np.pi * x[1]
    return [
        float(far * np.cos(a) * np.cos(b)),
        float(far * np.cos(a) * np.sin(b)),
        float(far * np.sin(a)),
    ], []


COSTS = (0.3, 0.0, 0.6, 0.9)


def with_level(x: FloatArray) -> Values:
    """Between two points in x; the level adds to both, the second of four nothing."""
    cost = COSTS[int(x[1] * 4)]
    return [float((x[0] - 0.2) ** 2) + cost, float((x[0] - 0.8) ** 2) + cost], []


CONVEX = FrontCase(between_two_points, (0.5, 0.1, 0.9))
BINH_KORN = FrontCase(binh_korn, (0.5, 0.5), constraints=2)
TANAKA = FrontCase(tanaka, (0.5, 0.5), constraints=2)
OCTANT = FrontCase(octant, (0.3, 0.6, 0.1, 0.9), objectives=3)
MIXED = FrontCase(with_level, (0.5, 0.9), levels=(0, 4))
