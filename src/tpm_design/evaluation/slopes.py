"""What the measurements of a design say of its neighbours, to first order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tpm_design.errors import ParameterError
from tpm_design.evaluation.contexts import neighbouring_contexts
from tpm_design.evaluation.goals import slacks_near
from tpm_design.evaluation.samples import Sampled, samples_near
from tpm_design.metrics.base import UNDEFINED, FloatArray, Measurement
from tpm_design.metrics.context import Context
from tpm_design.metrics.neighbourhood import Neighbourhood
from tpm_design.problem import Design, Problem


@dataclass(frozen=True)
class Neighbour:
    """A design next to another one: ``step`` away from it along one continuous variable, in the variable's
    SI unit, or of the multiple where it is a ratio; not 0."""

    design: Design
    step: float


Neighbours = Sequence[Neighbour]


Slopes = Mapping[str, tuple[tuple[float, ...], ...]]
"""Label → of each of its pieces (constraints: of the slacks; an objective without pieces: of its value) the
derivative along each neighbour's variable, SI. Missing: not known to first order."""


def slopes_along(
    problem: Problem,
    design: Design,
    context: Context,
    measured: Mapping[str, Measurement],
    sampled: Sampled,
    neighbours: Neighbours,
) -> Slopes:
    """Difference quotients of what a design's measurements say of its neighbours."""
    try:
        beside = neighbouring_contexts(problem, context, design, [n.design for n in neighbours])
        # the design itself is seen in the same way
        seen = _seen_near(problem, Neighbourhood((context, *beside)), measured, sampled)
    except ParameterError:
        return {}
    steps = np.array([neighbour.step for neighbour in neighbours])
    slopes = {}
    for label, values in seen.items():
        found = (values[1:] - values[0]).T / steps
        if np.isfinite(found).all():
            slopes[label] = tuple(map(tuple, found.tolist()))
    return slopes


def _seen_near(
    problem: Problem, designs: Neighbourhood, measured: Mapping[str, Measurement], sampled: Sampled
) -> dict[str, FloatArray]:
    """Pieces (N, P) of objectives and constraints of each design."""
    found: dict[str, FloatArray] = {}
    for goal in problem.objectives:
        here, near = measured[goal.label], measured[goal.label].near
        if UNDEFINED in here.notes:
            found[goal.label] = np.zeros((len(designs.contexts), 1))
        elif near is not None:
            there = near(designs)
            pieces = None if len(problem.objectives) == 1 else there.pieces
            found[goal.label] = there.values[:, None] if pieces is None else pieces
    of_samples = samples_near(problem, designs, sampled)
    for goal in problem.constraints:
        slacks, more = slacks_near(goal, measured[goal.label], designs), of_samples.get(goal.label, [])
        if slacks is not None and more is not None:
            found[goal.label] = np.hstack([slacks, *more])
    return found
