"""The front of several objectives: the designs that no other one betters in all of them.

Arrays of objectives are (N, k), finite, and less is better in every column.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

REFERENCE_MARGIN = 0.1
"""How far the reference point of the hypervolume lies beyond the worst of the front in every objective, as a
share of the front's range: so that the extremes count too (Ishibuchi, Imada, Setoguchi and Nojima, 2018)."""


def non_dominated(values: FloatArray) -> NDArray[np.intp]:
    """Rows that no other row betters: none is at most as large in every column. Of equal rows the first.
    In the order of the first column, then of the others."""
    # a row that comes later in this order cannot dominate an earlier one
    order = np.lexsort(values.T[::-1])
    front = np.empty_like(values)
    chosen: list[int] = []
    for row in order:
        if not np.any(np.all(front[: len(chosen)] <= values[row], axis=1)):
            front[len(chosen)] = values[row]
            chosen.append(int(row))
    return np.array(chosen, dtype=np.intp)


def extended(front: FloatArray, row: FloatArray) -> FloatArray:
    """A front (M, k) with one more row (k,), without those that it dominates; the same array where one of
    its rows is at most as large in every column."""
    if np.any(np.all(front <= row, axis=1)):
        return front
    return np.vstack([front[~np.all(row <= front, axis=1)], row])


def extremes(front: FloatArray) -> NDArray[np.intp]:
    """For each column the row that is least in it, of equal ones that with the least sum of shares."""
    total = _shares(front).sum(axis=1)
    return np.array([np.lexsort((total, column))[0] for column in front.T], dtype=np.intp)


def knee(front: FloatArray) -> int:
    """The row that lies farthest towards the ideal point from the hyperplane through the extremes, each
    objective as a share of the front's range (Das, Structural Optimization 18, 1999, 107-115).

    Where these span no plane that faces the ideal point, the plane of equal weights stands for it. Of equal
    distances that with the least sum of shares; where the whole front bulges away from the ideal point that
    is one of the extremes.
    """
    shares = _shares(front)
    normal: FloatArray = np.ones(front.shape[1])
    corners = shares[extremes(front)]
    if np.linalg.cond(corners) < 1e8:
        solved = np.asarray(np.linalg.solve(corners, normal), dtype=np.float64)
        if np.all(solved > 0.0):
            normal = solved
    # rounded, so that which of equal ones is chosen does not hang on the last digit
    distance = np.round((1.0 - shares @ normal) / np.linalg.norm(normal), 12)
    return int(np.lexsort((shares.sum(axis=1), -distance))[0])


def _shares(front: FloatArray) -> FloatArray:
    """Each column from 0 to 1 over the front; 0 where it has no range."""
    least = front.min(axis=0)
    width = front.max(axis=0) - least
    shares: FloatArray = (front - least) / np.where(width > 0.0, width, 1.0)
    return shares


def spread(front: FloatArray, kept: Sequence[int], count: int) -> list[int]:
    """At most ``count`` rows that stand for the whole front, in order: those ``kept``, then each time the row
    farthest from all that are chosen, each objective as a share of the front's range (Gonzalez, 1985)."""
    shares = _shares(front)
    chosen = list(dict.fromkeys(kept))
    nearest = np.full(len(front), np.inf)
    for row in chosen:
        nearest = np.minimum(nearest, np.linalg.norm(shares - shares[row], axis=1))
    while len(chosen) < min(count, len(front)):
        # those that are chosen are at distance 0 from themselves, others perhaps too: of equal objectives
        nearest[chosen] = -1.0
        row = int(np.argmax(nearest))
        chosen.append(row)
        nearest = np.minimum(nearest, np.linalg.norm(shares - shares[row], axis=1))
    return sorted(chosen)


@dataclass(frozen=True)
class FrontBox:
    """Where hypervolumes are measured: from the ``ideal`` point to the ``reference`` point (k,)."""

    ideal: FloatArray
    reference: FloatArray

    def hypervolume(self, values: FloatArray) -> float:
        """The share of the box that the rows dominate, from 0 to 1: exact (Fonseca, Paquete and
        López-Ibáñez, 2006, through pymoo)."""
        from pymoo.indicators.hv import HV

        shares = (values - self.ideal) / (self.reference - self.ideal)
        within = shares[np.all(shares < 1.0, axis=1)]
        if not len(within):
            return 0.0
        return float(HV(ref_point=np.ones(len(self.ideal)))(np.maximum(within, 0.0)))


def front_box(front: FloatArray) -> FrontBox | None:
    """The box of a front: from its least values to ``REFERENCE_MARGIN`` beyond its greatest. None where an
    objective has one value only."""
    ideal, worst = front.min(axis=0), front.max(axis=0)
    if not np.all(worst > ideal):
        return None
    return FrontBox(ideal, worst + REFERENCE_MARGIN * (worst - ideal))
