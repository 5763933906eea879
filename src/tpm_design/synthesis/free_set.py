"""Where a body may lie: the poses of a mode within reach, every determinant on one side, with a margin."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.computed_once import computed_once
from tpm_design.mechanisms.fold_lines import FoldLine
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.aspects import ball_field, mode_field
from tpm_design.workspace.indices import DETERMINANT, REACH, Index, index_values

FloatArray = NDArray[np.float64]

SEED_ORDER = 8
MOST_SEEDS = 6
# a shallower seed is not worth its time
LEAST_SHARE = 0.25
RAY_ORDER = 4
# of the reach, over which slopes are taken
STEP = 1e-6
# by how much of a slope the slopes to both sides of a pose may differ
KINK = 1e-3


@dataclass(frozen=True, eq=False)
class Tangents:
    """Planes ``normals`` (K, 3) · x = ``offsets`` (K,), unit normals outward, and the number (K,) of the pose
    that each was found at."""

    normals: FloatArray
    offsets: FloatArray
    pose: NDArray[np.int64]


@dataclass(frozen=True)
class FreeSet:
    """``sides``: the sign of each determinant; ``floor``: the least margin, dimensionless."""

    mechanism: Mechanism
    mode: Mode
    sides: tuple[float, ...]
    floor: float

    @computed_once
    def length(self) -> float:
        """A length (m) that no reachable pose is farther than from the origin."""
        return self.mechanism.reach_radius()

    @computed_once
    def lines(self) -> tuple[FoldLine, ...]:
        """Lines of folded limbs, which no body may hold."""
        return self.mechanism.fold_lines()

    @property
    def indices(self) -> tuple[Index, ...]:
        """The fields that bound the set, reach first."""
        sided = enumerate(self.sides)
        return (Index(REACH), *(Index(DETERMINANT, part=part, sign=side) for part, side in sided))

    def margins(self, poses: FloatArray) -> FloatArray:
        """(1 + D, N) at poses (N, 3), all ≥ 0 in the set: reach (m), then determinants less the floor."""
        poses = np.ascontiguousarray(poses)
        reach = index_values(self.mechanism.geometry, self.mode.signs, Index(REACH), poses)
        signs = np.asarray(self.sides)[:, None]
        return np.vstack([reach, signs * self.mechanism.determinants_at(poses, self.mode) - self.floor])

    def slopes(self, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """``margins`` and their gradients (1 + D, N, 3) by central differences, NaN at a kink, where two
        bounds of reach are equal."""
        step = STEP * self.length
        moved = poses[None] + step * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])[:, None]
        values = self.margins(moved.reshape(-1, 3)).reshape(1 + len(self.sides), 7, len(poses))
        slopes = (values[:, 1:4] - values[:, 4:]) / (2.0 * step)
        bends = np.abs(values[:, 1:4] + values[:, 4:] - 2.0 * values[:, :1]).max(axis=1) / step
        smooth = bends <= KINK * np.linalg.norm(slopes, axis=1)
        # determinants have no kinks, but roots, which fall to 0 where limbs are stretched
        smooth[1:] = True
        slopes = np.where(smooth[:, None], slopes, math.nan)
        return values[:, 0], np.moveaxis(slopes, 1, 2)

    def holds(self, pose: FloatArray) -> bool:
        """Whether a pose lies in the set, folds aside."""
        return bool(np.all(self.margins(pose[None]) >= 0.0))

    @property
    def _code(self) -> int:
        return 1 + sum(1 << part for part, side in enumerate(self.sides) if side > 0.0)

    def exits(self, centre: FloatArray) -> FloatArray:
        """Poses (N, 3) at which rays from a pose of the set leave it; none where the pose is outside."""
        x, y, z = centre.tolist()
        radius = 2.0 * self.length
        field = ball_field(
            self.mechanism, self.mode, centre=(x, y, z), radius=radius, order=RAY_ORDER, floor=self.floor
        )
        found = field.segments
        # the first piece of each ray, on this side of the determinants
        first = np.flatnonzero((found.start < 1e-6) & (found.code == self._code))
        if first.size < len(field.rays.directions):
            return np.zeros((0, 3))
        along = found.end[first, None] * field.rays.directions[found.ray[first]]
        return np.asarray(centre + radius * along)

    def tangents(self, poses: FloatArray, near: float, around: float) -> Tangents:
        """Planes that touch the set's bounds close to poses (N, 3): of every bound that is, to first order,
        within ``near`` (m) of a pose. Where several bounds meet and none has a slope, slopes are taken at
        ``around`` (m) from the pose."""
        found = self._planes(poses, near)
        bare = np.setdiff1d(np.arange(len(poses)), found.pose)
        if not bare.size:
            return found
        cluster = around * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        more = self._planes((poses[bare][:, None] + cluster).reshape(-1, 3), near + 2.0 * around)
        return Tangents(
            np.vstack([found.normals, more.normals]),
            np.append(found.offsets, more.offsets),
            np.append(found.pose, bare[more.pose // len(cluster)]),
        )

    def _planes(self, poses: FloatArray, near: float) -> Tangents:
        values, slopes = self.slopes(poses)
        steepness = np.linalg.norm(slopes, axis=2)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = values / steepness
            normals = -slopes / steepness[:, :, None]
        usable = np.isfinite(distance) & (np.abs(distance) <= near) & np.isfinite(normals).all(axis=2)
        offsets = np.einsum("knj,nj->kn", normals, poses) + distance
        return Tangents(normals[usable], offsets[usable], np.nonzero(usable)[1])


@dataclass(frozen=True)
class Seed:
    """A pose (3,) in metres to grow a body from, the set it lies in, and about how deep (m)."""

    free: FreeSet
    pose: FloatArray
    depth: float


def seeds(mechanism: Mechanism, mode: Mode, floor: float, wanted: FloatArray | None) -> tuple[Seed, ...]:
    """Deep poses of the mode's aspects, far from each other, the deepest first; and ``wanted`` if it is in
    one."""
    field = mode_field(mechanism, mode, order=SEED_ORDER, sided=True, floor=floor)
    pieces = field.segments
    steps = field.rays.directions * np.asarray(field.scale)
    shares = np.array([0.15, 0.3, 0.5, 0.7, 0.85])
    along = pieces.start[:, None] + (pieces.end - pieces.start)[:, None] * shares
    poses = (along[:, :, None] * steps[pieces.ray][:, None]).reshape(-1, 3)
    codes = np.repeat(pieces.code, shares.size)
    ends = np.vstack([t[:, None] * steps[pieces.ray] for t in (pieces.start, pieces.end)])
    if wanted is not None:
        poses = np.vstack([poses, wanted])
        codes = np.append(codes, _code_at(mechanism, mode, wanted))
    free = {int(code): FreeSet(mechanism, mode, _sides(mechanism, int(code)), floor) for code in set(codes)}
    depths = np.full(len(poses), -math.inf)
    for code, one in free.items():
        members = np.flatnonzero(codes == code)
        depths[members] = _depths(one, poses[members], ends)
    chosen: list[Seed] = []
    if wanted is not None and depths[-1] > 0.0:
        chosen.append(Seed(free[int(codes[-1])], wanted, float(depths[-1])))
    deepest = float(depths.max(initial=0.0))
    for n in np.argsort(-depths, kind="stable"):
        if depths[n] <= LEAST_SHARE * deepest or len(chosen) >= MOST_SEEDS:
            break
        apart = [np.linalg.norm(poses[n] - seed.pose) > depths[n] for seed in chosen]
        if all(apart):
            chosen.append(Seed(free[int(codes[n])], poses[n], float(depths[n])))
    return tuple(sorted(chosen, key=lambda seed: -seed.depth))


def _sides(mechanism: Mechanism, code: int) -> tuple[float, ...]:
    return tuple(1.0 if (code - 1) >> part & 1 else -1.0 for part in range(len(mechanism.kind.determinants)))


def _code_at(mechanism: Mechanism, mode: Mode, pose: FloatArray) -> int:
    values = mechanism.determinants_at(pose[None], mode)[:, 0]
    return 1 + sum(1 << part for part, value in enumerate(values) if value > 0.0)


def _depths(free: FreeSet, poses: FloatArray, ends: FloatArray) -> FloatArray:
    """About how far poses (N, 3) are from all bounds: to first order, and from where rays met them."""
    from scipy.spatial import cKDTree

    values, slopes = free.slopes(poses)
    steepness = np.linalg.norm(slopes, axis=2)
    # reach is in metres; a limit may be steeper
    steepness[0] = np.fmax(steepness[0], 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = values / steepness
    depth = np.where(np.isfinite(distance), distance, math.inf).min(axis=0)
    depth = np.minimum(depth, cKDTree(ends).query(poses)[0])
    for line in free.lines:
        away = np.linalg.norm(np.cross(poses - np.asarray(line.point), line.direction), axis=1)
        depth = np.minimum(depth, away - line.radius)
    return np.asarray(depth)
