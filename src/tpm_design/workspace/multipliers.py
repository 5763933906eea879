"""Which conditions hold a point in its place, and how hard: Karush–Kuhn–Tucker multipliers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import short_kernel

FloatArray = NDArray[np.float64]

# of a unit normal: what may be left of it, and how far beyond its bound a weight may be
NOT_STATIONARY = 1e-3
DEPENDENT = 1e-6
# three independent gradients make up every other
MOST_CONDITIONS = 3
# columns of the rows of ``_choices``: two counts, then conditions, then normals
CONDITIONS, NORMALS = 2, 2 + MOST_CONDITIONS


@short_kernel
def _fewest(gradients, usable, two_sided, normals, choices):  # type: ignore[no-untyped-def]
    """The first row of ``choices`` of those of its size that leaves the least; −1 if none is enough. The
    multipliers (3,) of its conditions."""
    best, residual = -1, NOT_STATIONARY
    multipliers = np.zeros(MOST_CONDITIONS)
    for row in range(choices.shape[0]):
        held, beside = choices[row, 0], choices[row, 1]
        if best >= 0 and held + beside > choices[best, 0] + choices[best, 1]:
            break
        columns = np.empty((3, held + beside))
        fits = True
        conditions, chosen = choices[row, CONDITIONS:NORMALS], choices[row, NORMALS:]
        first = normals[chosen[0]]
        for n in range(held):
            columns[:, n] = gradients[conditions[n]]
            fits = fits and usable[conditions[n]]
        for n in range(beside):
            columns[:, held + n] = first - normals[chosen[1 + n]]
        if not fits:
            continue
        across, triangle = np.linalg.qr(columns)
        sizes = np.abs(np.diag(triangle))
        # not where one is not a number either
        if not sizes.min() > DEPENDENT * sizes.max():
            continue
        solution = np.zeros(held + beside)
        for n in range(held + beside - 1, -1, -1):
            rest = (across[:, n] * first).sum() - (triangle[n] * solution).sum()
            solution[n] = rest / triangle[n, n]
        weights = solution[held:]
        fits = 1.0 - weights.sum() >= -NOT_STATIONARY
        for weight in weights:
            fits = fits and weight >= -NOT_STATIONARY
        for n in range(held):
            fits = fits and (two_sided[conditions[n]] or solution[n] >= -NOT_STATIONARY)
        left = first.copy()
        for n in range(held + beside):
            left -= columns[:, n] * solution[n]
        missing = math.sqrt((left * left).sum())
        if fits and missing < residual:
            best, residual = row, missing
            multipliers[:held] = solution[:held]
    return best, multipliers


def multipliers_of(
    gradients: FloatArray,
    normals: Sequence[FloatArray],
    scale: float,
    *,
    usable: NDArray[np.bool_],
    two_sided: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], FloatArray] | None:
    """The fewest conditions, the first always one of them, that make up a convex combination of unit normals:
    n = Σ μ_i ∇g_i + Σ w_j (n − n_j). Their numbers and multipliers μ; None where there are none.

    ``gradients`` (C, 3), those of the first one 1/m and of the others without unit; ``scale`` (m): what makes
    them alike. Only ``usable`` conditions (C,) count; those not ``two_sided`` (C,) have no negative
    multiplier.
    """
    if not normals or not len(gradients) or not np.isfinite(gradients).all():
        return None
    alike = gradients.copy()
    alike[0] *= scale
    choices = _choices(len(normals), len(gradients))
    row, multipliers = _fewest(alike, usable, two_sided, np.array(normals), choices)
    if row < 0:
        return None
    multipliers[0] *= scale
    held = choices[row, 0]
    return choices[row, CONDITIONS : CONDITIONS + held], multipliers[:held]


@cache
def _choices(normal_count: int, condition_count: int) -> NDArray[np.int64]:
    """Rows of up to three conditions and further normals, the smallest first: how many conditions and how
    many further normals they have, the conditions (3,), one normal, the further ones (2,)."""
    rows = []
    for count in range(1, MOST_CONDITIONS + 1):
        for beside in range(count):
            for chosen in itertools.combinations(range(1, condition_count), count - 1 - beside):
                for first, *others in itertools.combinations(range(normal_count), 1 + beside):
                    conditions, normals = _padded(0, *chosen), _padded(first, *others)
                    rows.append((count - beside, beside, *conditions, *normals))
    return np.array(rows, np.int64).reshape(-1, NORMALS + MOST_CONDITIONS)


def _padded(*numbers: int) -> tuple[int, ...]:
    return (*numbers, *(0,) * (MOST_CONDITIONS - len(numbers)))
