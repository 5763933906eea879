"""What the measurements of a design say of its neighbours, to first order."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tpm_design.errors import ParameterError
from tpm_design.evaluation.contexts import neighbouring_contexts
from tpm_design.evaluation.goals import slack_pieces
from tpm_design.evaluation.samples import Sampled, samples_near
from tpm_design.evaluation.violation import objective_pieces
from tpm_design.metrics.base import UNDEFINED, Measurement
from tpm_design.metrics.context import Context
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
    here = _seen_near(problem, context, measured, sampled)
    try:
        beside = neighbouring_contexts(problem, context, design, [n.design for n in neighbours])
        there = [_seen_near(problem, other, measured, sampled) for other in beside]
    except ParameterError:
        return {}
    slopes = {}
    for label, values in here.items():
        found = [
            [(after - before) / neighbour.step for before, after in zip(values, seen[label], strict=True)]
            for neighbour, seen in zip(neighbours, there, strict=True)
        ]
        rows = tuple(zip(*found, strict=True)) if found else ((),) * len(values)
        if all(math.isfinite(slope) for row in rows for slope in row):
            slopes[label] = rows
    return slopes


def _seen_near(
    problem: Problem, context: Context, measured: Mapping[str, Measurement], sampled: Sampled
) -> dict[str, tuple[float, ...]]:
    """Pieces of objectives and constraints as the measurements of a design next to this one tell them."""
    found: dict[str, tuple[float, ...]] = {}
    for goal in problem.objectives:
        near = measured[goal.label].near
        if near is not None:
            there = near(context)
            in_pieces = objective_pieces(problem, {goal.label: there}).get(goal.label)
            # what is undefined is level
            found[goal.label] = (0.0,) if UNDEFINED in there.notes else in_pieces or (there.value,)
    of_samples = samples_near(problem, context, sampled)
    for goal in problem.constraints:
        near, more = measured[goal.label].near, of_samples.get(goal.label, ())
        if near is not None and more is not None:
            found[goal.label] = slack_pieces(goal, near(context)) + more
    return found
