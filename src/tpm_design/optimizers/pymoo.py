"""Evolutionary fronts of pymoo (Blank and Deb, IEEE Access 8, 2020, 89497-89509).

pymoo makes populations and is told their values; it evaluates nothing itself. What it changes for the whole
process (a notice on standard output, the filters of warnings) is undone here.

New members come from differences of others, as in differential evolution (Kukkonen and Lampinen, 2005; Li and
Zhang, 2009). pymoo's own crossover works along the axes: 4,000 evaluations of a 3-URU in 6 variables gave
links of 1487, 1812 and 2276 mm with it for 1/κ of 0.3, 0.5 and 0.6; 1260, 1761 and 2184 mm by differences.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from math import comb
from typing import Any

import numpy as np

from tpm_design.optimizers.base import Abilities, FloatArray, Optimizer, Stalled
from tpm_design.optimizers.watch import Watch, objective_count, watched

POPULATION = 40
"""Members of a generation: the result is the front of the whole log, so that a small population that moves on
more often serves it better than a large one."""

DIRECTIONS = 56
"""Most reference directions of NSGA-III, one for each member of a generation."""

FACTORS = (0.4, 0.9)
"""Factors on the difference of two members, drawn for each new member."""

EXCHANGED = 0.9
"""Share of the coordinates that a new member has from the difference, the others from its first parent."""

MUTATED = 0.2
"""Share of the new members that are mutated besides."""

NO_LIMIT = 10**9
"""The budget belongs to the search; pymoo's own limits on generations and evaluations are lifted."""


def nsga2(watch: Watch, seed: int) -> str:
    """Elitist non-dominated sorting with crowding distance; Deb's rules for constraints."""
    from pymoo.algorithms.moo.nsga2 import NSGA2

    return _evolve(
        watch,
        seed,
        objective_count(watch),
        NSGA2(
            pop_size=POPULATION,
            sampling=_first_generation(watch, POPULATION, seed),
            crossover=_differences(),
            mutation=_mutation(watch.levels > 0),
            repair=_repair(watch.levels),
        ),
    )


def nsga3(watch: Watch, seed: int) -> str:
    """Elitist non-dominated sorting along reference directions (Das and Dennis, 1998), as many as there are
    in ``DIRECTIONS``."""
    from pymoo.algorithms.moo.nsga3 import NSGA3
    from pymoo.operators.selection.tournament import TournamentSelection
    from pymoo.util.ref_dirs import get_reference_directions

    objectives = objective_count(watch)
    partitions = 1
    while comb(partitions + objectives, objectives - 1) <= DIRECTIONS:
        partitions += 1
    directions = get_reference_directions("das-dennis", objectives, n_partitions=partitions)
    size = len(directions)
    return _evolve(
        watch,
        seed,
        objectives,
        NSGA3(
            directions,
            pop_size=size,
            sampling=_first_generation(watch, size, seed),
            selection=TournamentSelection(func_comp=_feasible_first),
            crossover=_differences(),
            mutation=_mutation(watch.levels > 0),
            repair=_repair(watch.levels),
        ),
    )


def _evolve(watch: Watch, seed: int, objectives: int, algorithm: Any) -> str:
    """Generation by generation, each one batch, until pymoo's criteria find that the front rests."""
    from pymoo.config import Config
    from pymoo.core.evaluator import Evaluator
    from pymoo.core.problem import Problem
    from pymoo.problems.static import StaticProblem
    from pymoo.termination.default import DefaultMultiObjectiveTermination

    Config.warnings["not_compiled"] = False  # it would be printed where a result is expected
    bounds = np.zeros(watch.dimension), np.ones(watch.dimension)
    problem = Problem(watch.dimension, objectives, watch.constraint_count, xl=bounds[0], xu=bounds[1])
    ends = DefaultMultiObjectiveTermination(n_max_gen=NO_LIMIT, n_max_evals=NO_LIMIT)
    with _quiet():
        algorithm.setup(problem, termination=ends, seed=seed)
    while algorithm.has_next():
        with _quiet():
            population = algorithm.ask()
        if population is None:
            raise Stalled("Mating brings forth no further designs.")
        found = watch.evaluate(population.get("X"))
        values = {"F": found.objectives}
        if watch.constraint_count:
            values["G"] = -found.constraints
        with _quiet():
            Evaluator().eval(StaticProblem(problem, **values), population)
            algorithm.tell(infills=population)
    return "The front moves no more."


@contextmanager
def _quiet() -> Iterator[None]:
    """pymoo divides by zero where a front is degenerate, and NSGA-III silences warnings for good."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        yield


def _first_generation(watch: Watch, size: int, seed: int) -> FloatArray:
    """The start, then a Latin hypercube (size, n)."""
    random = np.random.default_rng(seed)
    cells = random.permuted(np.tile(np.arange(size)[:, None], (1, watch.dimension)), axis=0)
    points: FloatArray = (cells + random.random(cells.shape)) / size
    points[0] = watch.start
    return points


def _feasible_first(population: Any, pairs: Any, *, random_state: Any, algorithm: Any) -> Any:
    """Winners (N, 1) of binary tournaments (Deb and Jain, 2014): less violation, else by chance. pymoo's own
    draws the chance from a generator without a seed (0.6.2)."""
    violation = population.get("CV")[:, 0][pairs]
    first = violation[:, 0] < violation[:, 1]
    equal = violation[:, 0] == violation[:, 1]
    drawn = random_state.random(len(pairs)) < 0.5
    return np.where(first | (equal & drawn), pairs[:, 0], pairs[:, 1])[:, None]


def _repair(levels: Any) -> Any:
    """Discrete coordinates to the centre of their level, so that equal designs are equal points."""
    from pymoo.core.repair import Repair

    count = np.maximum(levels, 1)

    class LevelCentres(Repair):  # type: ignore[misc]
        def _do(self, problem: Any, X: Any, random_state: Any = None, algorithm: Any = None) -> Any:
            centres = (np.minimum(np.floor(X * count), count - 1) + 0.5) / count
            return np.where(levels > 0, centres, X)

    return LevelCentres()


def _differences() -> Any:
    """New members a + F (b − c), halfway to a bound where they would cross it."""
    from pymoo.core.crossover import Crossover

    class Differences(Crossover):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n_parents=3, n_offsprings=1, prob=1.0)

        def _do(self, problem: Any, X: Any, random_state: Any = None, algorithm: Any = None) -> Any:
            first, second, third = X
            moved = first + random_state.uniform(*FACTORS, (len(first), 1)) * (second - third)
            moved = np.where(moved < 0.0, 0.5 * first, np.where(moved > 1.0, 0.5 * (first + 1.0), moved))
            exchanged = random_state.random(moved.shape) < EXCHANGED
            exchanged[np.arange(len(first)), random_state.integers(moved.shape[1], size=len(first))] = True
            return np.where(exchanged, moved, first)[None]

    return Differences()


def _mutation(discrete: Any) -> Any:
    """Polynomial mutation; a discrete coordinate is drawn anew instead: steps as small as those of continuous
    ones would not leave its level."""
    from pymoo.operators.mutation.pm import PM

    class MixedMutation(PM):  # type: ignore[misc]
        def _do(self, problem: Any, X: Any, random_state: Any = None, algorithm: Any = None) -> Any:
            moved = super()._do(problem, X, random_state=random_state)
            chosen = random_state.random(X.shape) < 1.0 / X.shape[1]
            drawn = random_state.random(X.shape)
            return np.where(discrete, np.where(chosen, drawn, X), moved)

    return MixedMutation(prob=MUTATED, eta=20)


_ABILITIES = Abilities(
    constraints=True,
    discrete=True,
    derivatives=False,
    random=True,
    whole_space=True,
    batch=True,
    front=True,
)

METHODS = (
    Optimizer(
        "pymoo.nsga2",
        "front of several objectives: non-dominated sorting and crowding; discrete variables as levels",
        "Deb, Pratap, Agarwal and Meyarivan, 2002",
        _ABILITIES,
        watched(nsga2),
    ),
    Optimizer(
        "pymoo.nsga3",
        "front of several objectives along reference directions, for three and more; discrete variables",
        "Deb and Jain, 2014; Jain and Deb, 2014",
        _ABILITIES,
        watched(nsga3),
    ),
)
