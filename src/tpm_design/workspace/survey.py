"""A coarse look at a whole working mode: where a determinant changes sign, however small or far the piece.

The workspace of the mode is laid out as curvilinear grids: rays from the origin, on each as many poses
within reach, crowded towards the coordinate planes and the bounds of reach, where loci hide.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.mechanisms.pointwise import determinant_table
from tpm_design.workspace.aspects import mode_octants, reach_parts
from tpm_design.workspace.directions import Octant, RaySet
from tpm_design.workspace.indices import determinant_at

NEAREST_PLANE = 1e-7
ALONG = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 13))
BISECTIONS = 3


@dataclass(frozen=True)
class Survey:
    """``poses`` (S, K, 3) in metres along S parts of rays within reach, ``pairs`` (M, 2): parts next to each
    other, ``determinants`` (D, S, K) signed, 0 where undefined."""

    poses: NDArray[np.float64]
    pairs: NDArray[np.int64]
    determinants: NDArray[np.float64]


@lru_cache(maxsize=16)
def _ray_grids(octants: tuple[Octant, ...], order: int) -> RaySet:
    """``order``² rays in each of the three squares of an octant, edges included; nothing is integrated along
    them."""
    u = np.maximum(NEAREST_PLANE, np.linspace(0.0, 1.0, order) ** 2)
    square = np.stack([np.ones((order, order)), *np.meshgrid(u, u, indexing="ij")], axis=-1).reshape(-1, 3)
    grid = np.arange(order * order).reshape(order, order)
    pairs = np.vstack(
        [
            np.column_stack([grid[:-1].ravel(), grid[1:].ravel()]),
            np.column_stack([grid[:, :-1].ravel(), grid[:, 1:].ravel()]),
        ]
    )
    squares = [np.roll(square, axis, axis=1) * octant for octant in octants for axis in range(3)]
    neighbours = [pairs + number * order * order for number in range(len(squares))]
    directions = np.vstack(squares)
    lengths = np.linalg.norm(directions, axis=1)
    return RaySet(directions, lengths, np.zeros(len(directions)), np.vstack(neighbours))


@inner
def _part_pairs(rays, neighbours, count):  # type: ignore[no-untyped-def]
    """The first part of each ray beside the first part of its neighbour, the second beside the second …"""
    first = np.zeros(count + 1, np.int64)
    for ray in rays:
        first[ray + 1] += 1
    for ray in range(count):
        first[ray + 1] += first[ray]
    size, most = 0, 0
    for n in range(neighbours.shape[0]):
        a, b = neighbours[n, 0], neighbours[n, 1]
        both = min(first[a + 1] - first[a], first[b + 1] - first[b])
        size += both
        most = max(most, both)
    pairs = np.empty((size, 2), np.int64)
    size = 0
    for number in range(most):
        for n in range(neighbours.shape[0]):
            a, b = neighbours[n, 0], neighbours[n, 1]
            if number < min(first[a + 1] - first[a], first[b + 1] - first[b]):
                pairs[size, 0], pairs[size, 1] = first[a] + number, first[b] + number
                size += 1
    return pairs


@kernel
def _surveyed(geometry, mode, directions, neighbours, rays, start, end):  # type: ignore[no-untyped-def]
    """Poses (S · K, 3), pairs and determinants (D, S · K) of ``Survey``."""
    poses = np.empty((rays.size * ALONG.size, 3))
    for s in range(rays.size):
        for k in range(ALONG.size):
            t = start[s] + (end[s] - start[s]) * ALONG[k]
            for axis in range(3):
                poses[s * ALONG.size + k, axis] = t * directions[rays[s], axis]
    pairs = _part_pairs(rays, neighbours, directions.shape[0])
    return poses, pairs, determinant_table(geometry, mode, poses)


def survey(mechanism: Mechanism, mode: Mode, *, order: int) -> Survey:
    """The mode's workspace on ``order``² rays per square of an octant."""
    grids = _ray_grids(mode_octants(mode), order)
    parts = reach_parts(mechanism, mode, grids)
    poses, pairs, determinants = _surveyed(
        mechanism.geometry,
        mode.signs,
        grids.directions,
        grids.neighbours,
        parts.ray,
        parts.start,
        parts.end,
    )
    return Survey(
        poses.reshape(-1, ALONG.size, 3), pairs, determinants.reshape(len(determinants), -1, ALONG.size)
    )


@inner
def _between(geometry, mode, part, p, q):  # type: ignore[no-untyped-def]
    """Pose on the chord pq near which the determinant changes sign, by bisection."""
    low, high = 0.0, 1.0
    positive = determinant_at(geometry, mode, part, p[0], p[1], p[2]) > 0.0
    for _ in range(BISECTIONS):
        t = 0.5 * (low + high)
        x, y, z = p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), p[2] + t * (q[2] - p[2])
        if (determinant_at(geometry, mode, part, x, y, z) > 0.0) == positive:
            low = t
        else:
            high = t
    t = 0.5 * (low + high)
    return p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), p[2] + t * (q[2] - p[2])


@inner
def crossings(geometry, mode, part, seen):  # type: ignore[no-untyped-def]
    """Poses (N, 3) near which one determinant changes sign between neighbours of the grids: close to its
    locus, all over the mode's workspace. ``seen``: as ``Survey`` has them."""
    poses, pairs, values = seen[0], seen[1], seen[2][part]
    count = 0
    for s in range(values.shape[0]):
        for k in range(1, values.shape[1]):
            count += (values[s, k] > 0.0) != (values[s, k - 1] > 0.0)
    for n in range(pairs.shape[0]):
        for k in range(values.shape[1]):
            count += (values[pairs[n, 0], k] > 0.0) != (values[pairs[n, 1], k] > 0.0)
    out = np.empty((count, 3))
    count = 0
    for s in range(values.shape[0]):
        for k in range(1, values.shape[1]):
            if (values[s, k] > 0.0) != (values[s, k - 1] > 0.0):
                out[count] = _between(geometry, mode, part, poses[s, k - 1], poses[s, k])
                count += 1
    for n in range(pairs.shape[0]):
        a, b = pairs[n]
        for k in range(values.shape[1]):
            if (values[a, k] > 0.0) != (values[b, k] > 0.0):
                out[count] = _between(geometry, mode, part, poses[a, k], poses[b, k])
                count += 1
    return out
