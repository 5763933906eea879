"""What the convex relaxation says of a study: a lower bound on its links, and the designs that attain it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tpm_design.design_space import octant_signs, with_changes
from tpm_design.optimizers.conic import solve
from tpm_design.problem import Design, Problem
from tpm_design.synthesis.relaxation import Relaxation, octants, refusal, relaxation

FloatArray = NDArray[np.float64]

INWARD = (1e-8, 1e-6, 1e-4)
"""By how much relaxed designs keep off the bounds of reach, as shares of the largest length: what lies on a
bound misses it by a rounding, or by the numeric error of a metric."""


@dataclass(frozen=True)
class ReachBound:
    """No design within the study's ranges that reaches its region has less than ``least`` (m) of the
    objective ``goal``; infinite: no such design reaches it."""

    goal: str
    least: float

    @property
    def reachable(self) -> bool:
        """Whether the relaxation leaves room for a design."""
        return math.isfinite(self.least)

    def gap(self, value: float) -> float:
        """By which share of the bound a design's ``value`` (m) is above it."""
        return value / self.least - 1.0


def reach_bound(problem: Problem) -> ReachBound | None:
    """The bound, None where the problem has no convex relaxation. Raises RefusedError where the solver
    fails."""
    if refusal(problem) is not None:
        return None
    relaxed = [relaxation(problem, octant) for octant in octants(problem)]
    values = [one.constant + one.unit * solve(one.program).bound for one in relaxed]
    return ReachBound(problem.objectives[0].label, min(values))


def relaxed_designs(problem: Problem, start: Design, most: int) -> list[Design]:
    """Designs with the shortest links that reach the region by outer reach alone: a few for each choice of
    the discrete variables, each a little farther inside than the one before; at most ``most``. What has no
    part in the relaxation is as in ``start``.

    Raises RefusedError where the solver fails.
    """
    return list(itertools.islice(_relaxed_designs(problem, start), most))


def _relaxed_designs(problem: Problem, start: Design) -> Iterator[Design]:
    discrete = [variable for variable in problem.variables if variable.values]
    choices: list[tuple[float | str, ...]] = [variable.values for variable in discrete]
    continuous = tuple(variable for variable in problem.variables if not variable.values)
    signs = octant_signs(problem.modes)
    known: dict[object, dict[str, float] | None] = {}
    for values in itertools.product(*choices):
        chosen = {variable.name: value for variable, value in zip(discrete, values, strict=True)}
        held = replace(problem, variables=continuous, fixed={**problem.fixed, **chosen})
        octant = signs[str(held.fixed["mode"])]
        lengths = tuple(
            value for variable, value in zip(discrete, values, strict=True) if variable.dimension == "length"
        )
        for inward in INWARD:
            key = (octant, lengths, inward)
            if key not in known:
                known[key] = _solved(relaxation(held, octant, inward=inward))
            found = known[key]
            if found is not None:
                yield with_changes(problem, start, {**chosen, **found})


def _solved(relaxed: Relaxation) -> dict[str, float] | None:
    point = solve(relaxed.program).point
    if point is None:
        return None
    own = point[: len(relaxed.names)] * relaxed.unit
    return {name: float(value) for name, value in zip(relaxed.names, own, strict=True)}
