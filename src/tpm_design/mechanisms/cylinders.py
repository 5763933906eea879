"""A ball that holds the intersection of cylinders."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

Vector = tuple[float, float, float]


def reach_of_cylinders(points: Sequence[Vector], axes: Sequence[Vector], radii: Sequence[float]) -> float:
    """No point within ``radii`` (m) of the lines through ``points`` along the unit ``axes`` is farther from
    the origin than this (m); infinite where all axes are parallel.

    Σ |(I − s sᵀ)(p − c)|² ≤ Σ radius² is an ellipsoid.
    """
    least, size, offsets = _middle(tuple(points), tuple(axes))
    if least < 1e-12:
        return math.inf
    room = sum(radius**2 for radius in radii) - sum(offset**2 for offset in offsets)
    return size + math.sqrt(max(0.0, room) / least)


@lru_cache(maxsize=64)
def _middle(points: tuple[Vector, ...], axes: tuple[Vector, ...]) -> tuple[float, float, tuple[float, ...]]:
    """Of Σ |(I − s sᵀ)(p − c)|²: its least curvature, and of the p where it is least the distances from the
    origin and from each line; all machines of a study may share them."""
    projectors = [np.eye(3) - np.outer(axis, axis) for axis in axes]
    total = np.sum(projectors, axis=0)
    least = float(np.linalg.eigvalsh(total)[0])
    if least < 1e-12:
        return least, math.inf, ()
    linear = np.sum([p @ np.asarray(c) for p, c in zip(projectors, points, strict=True)], axis=0)
    centre = np.linalg.solve(total, linear)
    offsets = tuple(float(np.linalg.norm(p @ (centre - c))) for p, c in zip(projectors, points, strict=True))
    return least, float(np.linalg.norm(centre)), offsets
