"""Ray directions with Gauss–Legendre weights, an octant as three squares.

A direction is a point (1, u, v) of a unit square and its cyclic permutations, not normalised: with
p = t·(1, u, v) the volume element is t² dt du dv, without any factor, and no axis is a pole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

Octant = tuple[int, int, int]
ALL_OCTANTS: tuple[Octant, ...] = tuple((a, b, c) for a, b, c in product((1, -1), repeat=3))


@dataclass(frozen=True)
class RaySet:
    """``directions`` (N, 3), ``lengths`` (N,) their norms, ``weights`` (N,) of du dv, ``neighbours`` (M, 2):
    rays next to each other."""

    directions: NDArray[np.float64]
    lengths: NDArray[np.float64]
    weights: NDArray[np.float64]
    neighbours: NDArray[np.int64]


@lru_cache(maxsize=64)
def ray_set(octants: tuple[Octant, ...], order: int) -> RaySet:
    """``order``² rays in each of the three squares of each octant."""
    nodes, node_weights = np.polynomial.legendre.leggauss(order)
    u = 0.5 * (nodes + 1.0)
    square_weights = 0.25 * np.outer(node_weights, node_weights).ravel()
    uu, vv = (grid.ravel() for grid in np.meshgrid(u, u, indexing="ij"))
    directions, weights = [], []
    for octant in octants:
        for axis in range(3):
            square = np.empty((order * order, 3))
            square[:, axis], square[:, (axis + 1) % 3], square[:, (axis + 2) % 3] = 1.0, uu, vv
            directions.append(square * np.asarray(octant, dtype=np.float64))
            weights.append(square_weights)
    stacked = np.vstack(directions)
    lengths = np.linalg.norm(stacked, axis=1)
    return RaySet(stacked, lengths, np.concatenate(weights), _neighbours(octants, order))


def _neighbours(octants: tuple[Octant, ...], order: int) -> NDArray[np.int64]:
    count = order * order
    grid = np.arange(count).reshape(order, order)
    inside = np.vstack(
        [
            np.column_stack([grid[:-1].ravel(), grid[1:].ravel()]),
            np.column_stack([grid[:, :-1].ravel(), grid[:, 1:].ravel()]),
        ]
    )
    pairs = []
    for position, octant in enumerate(octants):
        for axis in range(3):
            first = count * (3 * position + axis)
            following = count * (3 * position + (axis + 1) % 3)
            pairs.append(inside + first)
            # the edge u = 1 of this square is the edge v = 1 of the next
            pairs.append(np.column_stack([first + grid[-1, :], following + grid[:, -1]]))
            for shift, edge in ((1, grid[0, :]), (2, grid[:, 0])):
                across = (axis + shift) % 3
                flipped = tuple(-s if k == across else s for k, s in enumerate(octant))
                if octant[across] > 0 and flipped in octants:
                    other = count * (3 * octants.index(flipped) + axis)
                    pairs.append(np.column_stack([first + edge, other + edge]))
    return np.vstack(pairs).astype(np.int64)
