"""The convex relaxation of a study as a method: cvxpy with Clarabel."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from tpm_design.errors import RefusedError
from tpm_design.optimizers.base import Abilities, FloatArray, Optimizer, Search


@runtime_checkable
class RelaxedSearch(Protocol):
    """A search whose problem has a convex relaxation."""

    def relaxed_optima(self) -> FloatArray:
        """Points (N, n) of the cube that solve it, N = 0 where it has no point."""
        ...


def _solve_relaxation(search: Search, seed: int) -> str:
    if not isinstance(search, RelaxedSearch):
        raise RefusedError("This problem has no convex relaxation.", remedy="Choose a method that searches.")
    points = search.relaxed_optima()
    if not len(points):
        return "The convex relaxation has no point."
    search.evaluate(points)
    return "The convex relaxation was solved."


METHODS = (
    Optimizer(
        "convex",
        "the shortest links that reach the region, best placed: outer reach alone, to its global optimum",
        "second-order and semidefinite cones; Clarabel: Goulart and Chen, 2024",
        Abilities(
            constraints=True,
            discrete=True,
            derivatives=False,
            random=False,
            whole_space=True,
            batch=True,
            relaxation=True,
        ),
        _solve_relaxation,
    ),
)
