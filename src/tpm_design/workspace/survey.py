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
from tpm_design.workspace.aspects import mode_octants
from tpm_design.workspace.directions import Octant
from tpm_design.workspace.indices import determinant_at
from tpm_design.workspace.rays import trace

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
def _ray_grids(octants: tuple[Octant, ...], order: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Directions (N, 3), ``order``² in each of the three squares of an octant, edges included, and
    neighbours (M, 2)."""
    u = np.maximum(NEAREST_PLANE, np.linspace(0.0, 1.0, order) ** 2)
    square = np.stack([np.ones((order, order)), *np.meshgrid(u, u, indexing="ij")], axis=-1).reshape(-1, 3)
    grid = np.arange(order * order).reshape(order, order)
    pairs = np.vstack(
        [
            np.column_stack([grid[:-1].ravel(), grid[1:].ravel()]),
            np.column_stack([grid[:, :-1].ravel(), grid[:, 1:].ravel()]),
        ]
    )
    directions = [np.roll(square, axis, axis=1) * octant for octant in octants for axis in range(3)]
    neighbours = [pairs + number * order * order for number in range(len(directions))]
    return np.vstack(directions), np.vstack(neighbours)


def survey(mechanism: Mechanism, mode: Mode, *, order: int) -> Survey:
    """The mode's workspace on ``order``² rays per square of an octant."""
    directions, neighbours = _ray_grids(mode_octants(mode), order)
    limits = mechanism.reach_radius() / np.linalg.norm(directions, axis=1)
    parts = trace(
        mechanism.geometry,
        mode.signs,
        determinant_count=len(mechanism.kind.determinants),
        sided=False,
        floor=0.0,
        origin=(0.0, 0.0, 0.0),
        scale=(1.0, 1.0, 1.0),
        directions=directions,
        limits=limits,
    )
    along = parts.start[:, None] + (parts.end - parts.start)[:, None] * ALONG
    poses = along[:, :, None] * directions[parts.ray][:, None, :]
    determinants = mechanism.determinants_at(poses.reshape(-1, 3), mode)
    shape = (len(determinants), *along.shape)
    return Survey(poses, _part_pairs(parts.ray, neighbours, len(directions)), determinants.reshape(shape))


def _part_pairs(ray: NDArray[np.int64], neighbours: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """The first part of each ray beside the first part of its neighbour, the second beside the second …"""
    first = np.searchsorted(ray, np.arange(count + 1))
    parts = np.diff(first)
    a, b = neighbours.T
    both = np.minimum(parts[a], parts[b])
    pairs = [
        np.column_stack([first[a[both > number]] + number, first[b[both > number]] + number])
        for number in range(int(both.max(initial=0)))
    ]
    return np.vstack([np.empty((0, 2), np.int64), *pairs])


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


@kernel
def _crossings(geometry, mode, part, poses, pairs, values):  # type: ignore[no-untyped-def]
    """Poses (N, 3) near which one determinant changes sign between neighbours of the grids."""
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


def survey_crossings(mechanism: Mechanism, mode: Mode, seen: Survey, part: int) -> NDArray[np.float64]:
    """Poses (N, 3) close to the locus of one determinant, all over the mode's workspace."""
    found: NDArray[np.float64] = _crossings(
        mechanism.geometry, mode.signs, part, seen.poses, seen.pairs, seen.determinants[part]
    )
    return found
