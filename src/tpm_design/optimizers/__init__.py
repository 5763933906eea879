"""The optimisers: one file per library, registered here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from tpm_design.errors import RefusedError, UsageError, did_you_mean
from tpm_design.optimizers import convex, epsilon_constraint, local, multistart, nlopt, pymoo, scipy
from tpm_design.optimizers.base import Optimizer
from tpm_design.optimizers.refusal import refusal

OPTIMIZERS: Mapping[str, Optimizer] = MappingProxyType(
    {
        method.name: method
        for method in (
            *multistart.METHODS,
            *local.METHODS,
            *scipy.METHODS,
            *nlopt.METHODS,
            *convex.METHODS,
            *pymoo.METHODS,
            *epsilon_constraint.METHODS,
        )
    }
)

ONE_OBJECTIVE, FRONT = "multistart", "pymoo.nsga2"
"""The methods that search where a study names none."""


def default_method(objectives: int) -> str:
    """The method for so many objectives where none is named."""
    return ONE_OBJECTIVE if objectives == 1 else FRONT


def optimizer(name: str) -> Optimizer:
    """The registered method; raises UsageError on an unknown name."""
    if name not in OPTIMIZERS:
        raise UsageError(f"Unknown optimizer {name!r}.", remedy=did_you_mean(name, OPTIMIZERS))
    return OPTIMIZERS[name]


def check_pair(
    method: Optimizer,
    *,
    dimension: int,
    discrete: Sequence[str],
    nondifferentiable: Sequence[str],
    objectives: int = 1,
) -> None:
    """Raises RefusedError where ``method`` cannot search such a problem (arguments as of ``refusal``).

    The remedy names every method of the same reach, global or local, that can.
    """

    def reason_against(one: Optimizer) -> str | None:
        return refusal(
            one,
            dimension=dimension,
            discrete=discrete,
            nondifferentiable=nondifferentiable,
            objectives=objectives,
        )

    reason = reason_against(method)
    if reason is None:
        return
    able = [
        other
        for other in OPTIMIZERS.values()
        if not other.abilities.relaxation and reason_against(other) is None
    ]
    alike = [other for other in able if other.abilities.whole_space == method.abilities.whole_space]
    raise RefusedError(
        reason, remedy=f"Methods that suit: {', '.join(sorted(other.name for other in alike or able))}."
    )
