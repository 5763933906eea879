"""Designs next to one another, as its measurements see them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tpm_design.computed_once import computed_once
from tpm_design.metrics.base import FloatArray
from tpm_design.metrics.context import Context
from tpm_design.workspace.extremes import IndicesNear


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """N ``contexts`` in one mode. What several measurements ask of the same poses is computed once."""

    contexts: tuple[Context, ...]

    @computed_once
    def radii(self) -> FloatArray:
        """Reach radii (N,) of the machines, m."""
        return np.array([context.mechanism.reach_radius() for context in self.contexts])

    @computed_once
    def _found(self) -> dict[IndicesNear, FloatArray]:
        return {}

    def values(self, indices: IndicesNear) -> FloatArray:
        """Indices at their poses (N, K, P)."""
        if indices not in self._found:
            self._found[indices] = indices.values(
                [(c.mechanism.geometry, c.mode.signs, c.placed.centre) for c in self.contexts]
            )
        return self._found[indices]

    def each(self, values: Callable[[Context], float | tuple[float, ...]]) -> FloatArray:
        """One value, or several, of every context (N,) or (N, k)."""
        return np.array([values(context) for context in self.contexts])
