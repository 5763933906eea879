"""What every optimiser declares and the one view of the problem it is given."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class BudgetSpent(Exception):  # noqa: N818 - an ordinary end of a search, not an error
    """Raised by ``Search.evaluate`` when the next point would exceed the budget."""


class Stalled(Exception):  # noqa: N818 - an ordinary end of a search, not an error
    """Raised by ``Optimizer.run`` where the method could not go on before it had converged; the text is the
    sentence that says why."""


@dataclass(frozen=True)
class Slopes:
    """At one point: ``gradient`` (n,) of the objective and ``jacobian`` (m, n) of the constraints, per unit
    of the cube, 0 along discrete variables."""

    gradient: FloatArray
    jacobian: FloatArray


@dataclass(frozen=True)
class Outcomes:
    """Values at N points: ``objective`` (N,) to minimise, ``constraints`` (N, m) met where ≥ 0 (each
    divided by its metric's scale), ``merit`` (N,) = objective + exact penalty, finite everywhere.
    ``aborted`` (N,), or empty for none: points that a ``ScreeningSearch`` did not measure to the end. What is
    not known of them is 0 of a constraint, and their merit is behind those that were asked for.
    ``slopes``: of a ``SlopedSearch``, None at points where they were not asked for or are not known.
    Of a ``FrontSearch``: ``objectives`` (N, k), all of them, each to minimise, and ``objective_pieces``: for
    each of them an array (N, s) whose greatest value it is, smoother in the design."""

    objective: FloatArray
    constraints: FloatArray
    merit: FloatArray
    aborted: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    objectives: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    objective_pieces: tuple[FloatArray, ...] = ()
    slopes: tuple[Slopes | None, ...] = ()

    def part(self, rows: slice) -> Outcomes:
        """Those of some of the points, of one objective."""
        return Outcomes(
            self.objective[rows],
            self.constraints[rows],
            self.merit[rows],
            self.aborted[rows],
            slopes=self.slopes[rows],
        )


class Search(Protocol):
    """The problem as an optimiser sees it: points of the unit cube [0, 1]^n, no units, no mechanism.

    ``levels[i]``: 0 for a continuous variable, else the number of values of a discrete one; value j
    of L is the coordinate interval [j/L, (j+1)/L), centre (j + 0.5)/L.
    """

    @property
    def dimension(self) -> int: ...
    @property
    def levels(self) -> tuple[int, ...]: ...
    @property
    def start(self) -> FloatArray: ...
    @property
    def constraint_count(self) -> int: ...

    def evaluate(self, points: FloatArray) -> Outcomes:
        """Values at ``points`` (N, n), in order; repeated points cost nothing. Raises BudgetSpent."""
        ...


@runtime_checkable
class ScreeningSearch(Search, Protocol):
    """A search that need not measure everything of points that are not among the best."""

    def screen(self, points: FloatArray, keep: int) -> Outcomes:
        """As ``evaluate``; only the ``keep`` best of ``points``, by violation and then by objective, are sure
        to be measured to the end. Raises BudgetSpent."""
        ...


@dataclass(frozen=True)
class Question:
    """Points (N, n) to be evaluated; ``sloped``: their slopes are asked for as well."""

    points: FloatArray
    sloped: bool = False


@runtime_checkable
class SlopedSearch(Search, Protocol):
    """A search that may know slopes."""

    def answers(self, questions: deque[Question]) -> Generator[Outcomes]:
        """As ``evaluate``, of questions that are taken from the left of a queue: each one's values as soon as
        they and those before are there. More may be asked between them, as long as one is not answered.

        Slopes, where they are asked for, cost less than an evaluation and do not count as one. Raises
        BudgetSpent.
        """
        ...


@runtime_checkable
class FrontSearch(Search, Protocol):
    """A search that tells all its objectives."""

    @property
    def objective_count(self) -> int: ...

    def in_pieces(self) -> FrontSearch:
        """The same search, constraints and objectives in as many pieces as a known point has of each."""
        ...


@dataclass(frozen=True)
class Abilities:
    """What a method can work with.

    ``constraints``: it handles inequalities itself (otherwise it is given the merit). ``discrete``: it
    may be given variables with levels. ``derivatives``: it follows gradients, so every metric must be
    differentiable. ``random``: its path depends on the seed. ``whole_space``: global, as opposed to
    local from ``start``. ``batch``: it evaluates whole populations at once, so workers help.
    ``relaxation``: it solves a convex relaxation of the problem, which must have one. ``front``: it
    searches the front of two objectives or more, and only that; at most ``most_objectives``.
    """

    constraints: bool
    discrete: bool
    derivatives: bool
    random: bool
    whole_space: bool
    batch: bool
    smallest_dimension: int = 1
    largest_dimension: int | None = None
    relaxation: bool = False
    front: bool = False
    most_objectives: int | None = None


@dataclass(frozen=True)
class Optimizer:
    """One method. ``run(search, seed)`` searches until it converges and returns one sentence on how it
    ended; it raises Stalled where it cannot go on before that. BudgetSpent passes through it."""

    name: str
    description: str
    source: str
    abilities: Abilities
    run: Callable[[Search, int], str]
