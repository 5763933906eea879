"""Where local searches begin: a low-discrepancy sample, the most promising points first, far apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import ceil, log2

import numpy as np
from numpy.typing import NDArray

from tpm_design.optimizers.base import FloatArray
from tpm_design.optimizers.places import Place, places
from tpm_design.optimizers.watch import Watch

SAMPLES = 12
"""Points of the first sample for each variable and one more, at least; further samples are as large."""

KEPT = 0.25
"""Share of a sample that is measured to the end: local searches begin at none of the others."""

APART, CLOSER = 0.1, 0.7
"""Least distance of starts from each other and from optima, times the root of the dimension; the factor on it
where a whole sample has nothing so far away."""

SPREAD, SPREAD_OF_BEST = 0.5, 0.3
"""By which share of the sample a discrete choice falls back with each start that it had; the choice of the
best optimum by less."""

SAME = 0.01
"""Optima of the same discrete choice that are nearer than this in every coordinate of the cube are one."""

Levels = NDArray[np.int64]
Choice = tuple[int, ...]


def choice_of(point: FloatArray, levels: Levels) -> Choice:
    """The values of the discrete variables, as numbers of their levels."""
    discrete = levels > 0
    numbers = np.floor(point[discrete] * levels[discrete]).astype(int)
    return tuple(np.minimum(numbers, levels[discrete] - 1).tolist())


def are_one(point: FloatArray, other: FloatArray, levels: Levels) -> bool:
    """Whether two optima, points (n,) of the cube, count as one."""
    near = float(np.abs(point - other).max()) < SAME
    return near and choice_of(point, levels) == choice_of(other, levels)


class Starts:
    """Sobol points (scrambled by ``seed``), evaluated as they are needed, with the search's own start before
    them."""

    def __init__(self, search: Watch, seed: int) -> None:
        from scipy.stats import qmc

        self._search, self._levels = search, search.levels
        self._sequence = qmc.Sobol(search.dimension, scramble=True, rng=seed)
        self.batch = 2 ** ceil(log2(SAMPLES * (search.dimension + 1)))
        self._samples: list[Place] = []
        self._used: list[FloatArray] = []
        self._apart = APART * np.sqrt(search.dimension)

    def sample(self) -> None:
        """Evaluate another batch."""
        points = self._sequence.random(self.batch)
        if not self._samples:
            points = np.vstack([self._search.start, points])
        points = np.where(self._levels > 0, self._centred(points), points)
        found = self._search.screen(points, ceil(KEPT * len(points)))
        aborted = found.aborted if found.aborted.size else np.zeros(len(points), dtype=np.bool_)
        self._samples += [p for p, cut in zip(places(points, found), aborted, strict=True) if not cut]

    def next(self, optima: Sequence[FloatArray]) -> Place:
        """The next start, away from ``optima`` (best first): the search's own first."""
        if not self._used:
            return self._take(self._samples[0])
        while (found := self._most_promising(optima)) is None:
            self.sample()
            self._apart *= CLOSER
        return self._take(found)

    def _take(self, place: Place) -> Place:
        self._used.append(place.point)
        return place

    def _centred(self, points: FloatArray) -> FloatArray:
        levels = np.maximum(self._levels, 1)
        centred: FloatArray = (np.minimum(np.floor(points * levels), levels - 1) + 0.5) / levels
        return centred

    def _most_promising(self, optima: Sequence[FloatArray]) -> Place | None:
        samples = self._samples
        objectives = np.array([place.objective for place in samples])
        shortfalls = np.maximum(0.0, -np.array([place.constraints for place in samples]))
        sizes = np.median(np.abs([place.constraints for place in samples]), axis=0)
        violations = (shortfalls / np.where(sizes > 0.0, sizes, 1.0)).sum(axis=1)
        ranks = _ranks(objectives) + _ranks(violations)
        used = Counter(choice_of(point, self._levels) for point in self._used)
        best = choice_of(optima[0], self._levels) if len(optima) else None
        scores = []
        for rank, place in zip(ranks.tolist(), samples, strict=True):
            choice = choice_of(place.point, self._levels)
            spread = SPREAD_OF_BEST if choice == best else SPREAD
            scores.append(rank + spread * len(samples) * used[choice])
        taken = np.array([*self._used, *optima])
        for number in map(int, np.argsort(scores, kind="stable")):
            place = samples[number]
            if np.sqrt(((taken - place.point) ** 2).sum(axis=1)).min() > self._apart:
                return place
        return None


def _ranks(values: FloatArray) -> FloatArray:
    """The number of smaller values, for each."""
    ranks: FloatArray = np.searchsorted(np.sort(values), values).astype(np.float64)
    return ranks
