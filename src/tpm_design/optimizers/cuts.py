"""Constraints seen from other places: beyond a kink they slope otherwise."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.optimizers.base import FloatArray
from tpm_design.optimizers.measure import Measure
from tpm_design.optimizers.places import Place

NEARBY = 3.0
"""Distance, in trust regions, up to which such slopes are of use."""


@dataclass(frozen=True)
class Cuts:
    """Linear constraints: ``values`` (k,) here, ``slopes`` (k, n), and whose they are, ``owners`` (k,)."""

    values: FloatArray
    slopes: FloatArray
    owners: NDArray[np.int64]

    def folded(self, multipliers: FloatArray) -> FloatArray:
        """Multipliers (m,) of the constraints with those of their cuts, which stand behind them."""
        count = len(multipliers) - len(self.owners)
        total: FloatArray = multipliers[:count] + np.bincount(
            self.owners, weights=multipliers[count:], minlength=count
        )
        return total


def cuts_near(
    here: Place,
    free: NDArray[np.int64],
    seen: Iterable[tuple[Place, FloatArray]],
    measure: Measure,
    radius: float,
) -> Cuts:
    """What slopes ``seen`` (m, n) elsewhere add within the trust region.

    Cutting planes, as in bundle methods, where a constraint is the least of several functions. A slope that
    falls short of what the constraint is here belongs to a bend, not to a kink, and is left out.
    """
    size = len(free)
    values, slopes, owners = [np.zeros(0)], [np.zeros((0, size))], [np.zeros(0, dtype=np.int64)]
    now = measure.needed(here)
    for place, slope in seen:
        way = here.point[free] - place.point[free]
        if float(np.abs(way).max()) > NEARBY * radius:
            continue
        value = measure.needed(place) + (slope @ way) * measure.weights
        steep = slope * measure.weights[:, None]
        within = radius * np.abs(steep).sum(axis=1)
        useful = np.flatnonzero((value >= now - 1e-12) & (value < within))
        values.append(value[useful])
        slopes.append(steep[useful])
        owners.append(useful)
    return Cuts(np.concatenate(values), np.vstack(slopes), np.concatenate(owners))
