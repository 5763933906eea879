"""The optimisers: one file per library, registered here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from tpm_design.errors import RefusedError, UsageError, did_you_mean
from tpm_design.optimizers import convex, multistart, nlopt, scipy
from tpm_design.optimizers.base import Optimizer
from tpm_design.optimizers.refusal import refusal

OPTIMIZERS: Mapping[str, Optimizer] = MappingProxyType(
    {method.name: method for method in (*multistart.METHODS, *scipy.METHODS, *nlopt.METHODS, *convex.METHODS)}
)


def optimizer(name: str) -> Optimizer:
    """The registered method; raises UsageError on an unknown name."""
    if name not in OPTIMIZERS:
        raise UsageError(f"Unknown optimizer {name!r}.", remedy=did_you_mean(name, OPTIMIZERS))
    return OPTIMIZERS[name]


def check_pair(
    method: Optimizer, *, dimension: int, discrete: Sequence[str], nondifferentiable: Sequence[str]
) -> None:
    """Raises RefusedError where ``method`` cannot search such a problem (arguments as of ``refusal``).

    The remedy names every method of the same reach, global or local, that can.
    """
    reason = refusal(method, dimension=dimension, discrete=discrete, nondifferentiable=nondifferentiable)
    if reason is None:
        return
    able = [
        other
        for other in OPTIMIZERS.values()
        if not other.abilities.relaxation
        and refusal(other, dimension=dimension, discrete=discrete, nondifferentiable=nondifferentiable)
        is None
    ]
    alike = [other for other in able if other.abilities.whole_space == method.abilities.whole_space]
    raise RefusedError(
        reason, remedy=f"Methods that suit: {', '.join(sorted(other.name for other in alike or able))}."
    )
