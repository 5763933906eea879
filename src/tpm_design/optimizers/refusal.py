"""What a method cannot work with."""

from __future__ import annotations

from collections.abc import Sequence

from tpm_design.optimizers.base import Optimizer


def refusal(
    optimizer: Optimizer,
    *,
    dimension: int,
    discrete: Sequence[str],
    nondifferentiable: Sequence[str],
    objectives: int = 1,
) -> str | None:
    """One sentence on why ``optimizer`` cannot search this problem, or None where it can.

    ``dimension``: number of design variables; ``discrete``: names of those with levels;
    ``nondifferentiable``: labels of the objectives and constraints without a gradient; ``objectives``: how
    many there are.
    """
    name, able = optimizer.name, optimizer.abilities
    if able.front and objectives == 1:
        return f"{name} searches the front of several objectives; this study has one."
    if objectives > 1 and not able.front:
        return f"{name} takes one objective; this study has {objectives}."
    if able.most_objectives is not None and objectives > able.most_objectives:
        return f"{name} takes at most {able.most_objectives} objectives; this study has {objectives}."
    if able.largest_dimension is not None and dimension > able.largest_dimension:
        return f"{name} takes at most {able.largest_dimension} variables; this study has {dimension}."
    if dimension < able.smallest_dimension:
        return f"{name} needs at least {able.smallest_dimension} variables; this study has {dimension}."
    if discrete and not able.discrete:
        return f"{name} takes continuous variables only; discrete here: {', '.join(discrete)}."
    if nondifferentiable and able.derivatives:
        return f"{name} follows gradients; without one here: {', '.join(nondifferentiable)}."
    return None
