"""The points of a sweep's plan, in order."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from tpm_design.design_space import DesignSpace, Multiples, octant_signs, values_at
from tpm_design.errors import UsageError
from tpm_design.runs.sweeps import WHOLE, Point, Shard
from tpm_design.study.design import choose_design, completed_design, first_multiple
from tpm_design.study.study import Study
from tpm_design.study.sweep import GridSweep, ListSweep, SampleSweep, Sweep

Values = Mapping[str, float | str]


def plan_of_sweep(study: Study) -> Sweep:
    """The study's plan. Raises UsageError where it has none."""
    if study.sweep is None:
        raise UsageError(
            "This study has no plan to sweep.",
            where=str(study.path),
            remedy="Add one, such as `sweep: {type: grid, parameters: {NAME: {num: 9}}}`.",
        )
    return study.sweep


def plan_size(plan: Sweep) -> int:
    """Number of points of the whole plan."""
    if isinstance(plan, GridSweep):
        return math.prod(len(values) for _, values in plan.axes)
    return len(plan.points) if isinstance(plan, ListSweep) else plan.samples


def swept_names(plan: Sweep) -> tuple[str, ...]:
    """The quantities that a plan names, in the order in which it first does."""
    if isinstance(plan, GridSweep):
        return tuple(name for name, _ in plan.axes)
    if isinstance(plan, ListSweep):
        return tuple(dict.fromkeys(name for point in plan.points for name in point))
    return plan.names


def sweep_points(study: Study, shard: Shard = WHOLE) -> tuple[Point, ...]:
    """The points of a shard, numbered as in the whole plan: a grid's last axis runs fastest, Sobol points
    are scrambled by the plan's seed. What a point does not name is held at its initial value, else the
    middle of its range, else the first value listed. Raises UsageError where there is no plan."""
    plan, problem = plan_of_sweep(study), study.problem
    held = completed_design(problem, {})
    held_multiples = {
        v.name: multiple for v in problem.variables if (multiple := first_multiple(v)) is not None
    }
    space = DesignSpace(problem.variables, problem.fixed, octant_signs(problem.modes), problem.ties)
    chosen = itertools.islice(enumerate(_values(study, plan)), shard.index - 1, None, shard.count)
    points = []
    for number, (values, multiples) in chosen:
        left = {name: multiple for name, multiple in held_multiples.items() if name not in values}
        points.append(Point(number, space.completed({**held, **values}, {**left, **multiples})))
    return tuple(points)


def held_values(study: Study) -> tuple[str, ...]:
    """A line for each free quantity that the plan leaves alone: its value and why this one."""
    swept = swept_names(plan_of_sweep(study))
    _, assumptions = choose_design(study, {})
    return tuple(line for line in assumptions if line.partition(" = ")[0] not in swept)


def _values(study: Study, plan: Sweep) -> Iterator[tuple[Values, Multiples]]:
    if isinstance(plan, GridSweep):
        names = [name for name, _ in plan.axes]
        for combination in itertools.product(*(values for _, values in plan.axes)):
            yield dict(zip(names, combination, strict=True)), {}
    elif isinstance(plan, ListSweep):
        for point in plan.points:
            yield point, {}
    else:
        variables = [next(v for v in study.problem.variables if v.name == name) for name in plan.names]
        for row in _samples(plan):
            yield values_at(variables, row)


def _samples(plan: SampleSweep) -> NDArray[np.float64]:
    """Points (samples, n) of the unit cube."""
    from scipy.stats import qmc

    if plan.method == "latin_hypercube":
        cube = qmc.LatinHypercube(len(plan.names), rng=np.random.default_rng(plan.seed))
        return np.asarray(cube.random(plan.samples))
    sequence = qmc.Sobol(len(plan.names), scramble=True, rng=np.random.default_rng(plan.seed))
    return np.asarray(sequence.random_base2((plan.samples - 1).bit_length())[: plan.samples])
