"""Branch and bound over the poses of one working mode: boxes proved inside, proved outside, and undecided.

The boxes form a tree of halvings, one for each chart. Each wave halves the undecided boxes with the largest
gaps between what is proved inside and what may be; the boxes of a wave are judged one by one into arrays, so
that the result is the same for any number of threads.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.worker_threads import THIS_THREAD, WorkerThreads
from tpm_design.workspace.aspects import mode_octants
from tpm_design.workspace.box_verdicts import constraint_counts, judge
from tpm_design.workspace.equal_volume_charts import CHARTS_PER_OCTANT, largest_s

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# share of the total gap that the boxes of one wave hold together, at most; halving takes this much of it
WAVE_SHARE = 0.5
TAKEN = 0.6
LEAST_WAVE_SHARE = 0.05
# relative, for each of the boxes: more than the rounding of a sum of their volumes in any order
SUM_ROUNDING = 2.0**-52
BLOCK = 4096


@dataclass(frozen=True)
class PavedSet:
    """The poses of a mode that reach allows; where ``signs`` (D,) are given, those with sign · determinant >
    margin for each determinant."""

    mechanism: Mechanism
    mode: Mode
    signs: tuple[float, ...] = ()
    margin: float = 0.0


@dataclass
class Leaves:
    """Undecided boxes: ``node`` (N,) numbers in the tree, ``charts`` (N, 4), ``boxes`` (N, 6), ``proved``
    (N,) bits, ``volumes`` (N,) of the whole boxes (m³), ``inside`` (N, 2) bounds of what is inside (m³),
    ``axis`` (N,) to halve."""

    node: IntArray
    charts: IntArray
    boxes: FloatArray
    proved: IntArray
    volumes: FloatArray
    inside: FloatArray
    axis: IntArray

    @property
    def gaps(self) -> FloatArray:
        return np.asarray(self.inside[:, 1] - self.inside[:, 0])

    def where(self, chosen: NDArray[np.bool_]) -> Leaves:
        return Leaves(*(values[chosen] for values in vars(self).values()))

    def and_also(self, other: Leaves) -> Leaves:
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Leaves(*(np.concatenate(pair) for pair in pairs))


@dataclass
class Tree:
    """All boxes: ``child`` (N,) number of the lower half, the upper one follows, −1 for a leaf; ``axis`` (N,)
    halved; ``corners``, ``closed`` (N,) and ``inside`` (N, 2) as they were judged, volumes in m³."""

    size: int
    child: NDArray[np.int32]
    axis: NDArray[np.int8]
    corners: NDArray[np.uint8]
    closed: NDArray[np.uint8]
    inside: FloatArray

    @staticmethod
    def empty() -> Tree:
        return Tree(
            0,
            np.empty(0, np.int32),
            np.empty(0, np.int8),
            np.empty(0, np.uint8),
            np.empty(0, np.uint8),
            np.empty((0, 2)),
        )

    def grow(self, traits: NDArray[np.uint8], inside: FloatArray) -> IntArray:
        """Append leaves; returns their numbers."""
        start, self.size = self.size, self.size + len(inside)
        if self.size > len(self.child):
            for name in ("child", "axis", "corners", "closed", "inside"):
                old = getattr(self, name)
                larger = np.empty((2 * self.size, *old.shape[1:]), old.dtype)
                larger[:start] = old[:start]
                setattr(self, name, larger)
        self.child[start : self.size] = -1
        self.corners[start : self.size] = traits[:, 1]
        self.closed[start : self.size] = traits[:, 2]
        self.inside[start : self.size] = inside
        return np.arange(start, self.size)


@dataclass
class Paving:
    """A paving in progress. ``decided``: volume (m³) of the boxes that are wholly inside."""

    target: PavedSet
    extent: float = 0.0
    roots: IntArray = field(default_factory=lambda: np.empty((0, 4), np.int64))
    tree: Tree = field(default_factory=Tree.empty)
    decided: float = 0.0
    leaves: Leaves = field(init=False)

    def __post_init__(self) -> None:
        mechanism, mode = self.target.mechanism, self.target.mode
        self._geometry = mechanism.enclosed_geometry({})
        legs, sides, determinants = constraint_counts(mechanism.geometry, mode.signs, 0.3, 0.4, 0.5)
        self._counts = (legs, sides, determinants if self.target.signs else 0)
        self._signs = np.array(self.target.signs or [1.0])
        self.extent = largest_s(mechanism.reach_radius())
        octants = [[int(side) for side in octant] for octant in mode_octants(mode)]
        self.roots = np.array([[axis, *octant] for octant in octants for axis in range(CHARTS_PER_OCTANT)])
        count = len(self.roots)
        boxes = np.tile([0.0, self.extent, 0.0, 1.0, 0.0, 1.0], (count, 1))
        whole = Leaves(
            np.arange(count),
            self.roots,
            boxes,
            np.zeros(count, np.int64),
            np.full(count, self.extent),
            np.empty((count, 2)),
            np.empty(count, np.int64),
        )
        self.leaves = self._judged(whole, THIS_THREAD)

    @property
    def boxes(self) -> int:
        return self.tree.size

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper bound (m³) of the volume of the set."""
        lower, upper = self.decided + self.leaves.inside.sum(axis=0)
        return max(0.0, float(lower) - self.sum_rounding), float(upper) + self.sum_rounding

    @property
    def sum_rounding(self) -> float:
        """More (m³) than the rounding of any sum of the boxes' volumes."""
        return SUM_ROUNDING * self.boxes * self.extent * len(self.roots)

    @property
    def gap(self) -> float:
        return float(self.leaves.gaps.sum())

    def refine(self, goal: float, most_boxes: int, workers: WorkerThreads = THIS_THREAD) -> bool:
        """One wave towards a total gap of ``goal`` (m³), of at most ``most_boxes`` new boxes; False where
        nothing can be halved."""
        gaps = self.leaves.gaps
        excess = float(gaps.sum()) - goal
        chosen = largest(gaps, max(LEAST_WAVE_SHARE * goal, excess / TAKEN), most_boxes // 2)
        if not chosen.any():
            return False
        self.halve(chosen, workers)
        return True

    def halve(self, chosen: NDArray[np.bool_], workers: WorkerThreads = THIS_THREAD) -> None:
        """Halve the chosen ones of the undecided boxes."""
        parents, self.leaves = self.leaves.where(chosen), self.leaves.where(~chosen)
        first = self.tree.size
        self.tree.child[parents.node] = first + 2 * np.arange(len(parents.node))
        self.tree.axis[parents.node] = parents.axis
        self.leaves = self.leaves.and_also(self._judged(halves(parents), workers))

    def _judged(self, boxes: Leaves, workers: WorkerThreads) -> Leaves:
        """Judge new boxes, put them into the tree and return those that are undecided."""
        count = len(boxes.boxes)
        shares, traits = np.empty((count, 2)), np.empty((count, 3), np.uint8)

        def judge_block(start: int) -> None:
            judge(
                self._geometry,
                self.target.mode.signs,
                self._counts,
                self._signs,
                self.target.margin,
                boxes.charts,
                boxes.boxes,
                boxes.proved,
                shares,
                traits,
                start,
                min(count, start + BLOCK),
            )

        with closing(workers.as_they_end(judge_block, range(0, count, BLOCK))) as judged:
            for _ in judged:
                pass
        boxes.inside = shares * boxes.volumes[:, None]
        boxes.axis = traits[:, 0].astype(np.int64)
        boxes.node = self.tree.grow(traits, boxes.inside)
        self.decided += float(boxes.volumes[shares[:, 0] == 1.0].sum())
        return boxes.where((shares[:, 0] < 1.0) & (shares[:, 1] > 0.0))


def largest(gaps: FloatArray, together: float, most: int) -> NDArray[np.bool_]:
    """The boxes with the largest gaps, to a quarter, that hold ``together`` or ``WAVE_SHARE`` of all,
    whichever is less; ``most`` of them at most."""
    if not gaps.any():
        return np.zeros(len(gaps), np.bool_)
    mantissa, exponent = np.frexp(gaps)
    size = 4 * exponent.astype(np.int64) + (8.0 * mantissa - 4.0).astype(np.int64)
    size[gaps == 0.0] = size[gaps > 0.0].min()
    held = np.bincount(size - size.min(), weights=gaps)[::-1].cumsum()
    steps = int(np.searchsorted(held, min(together, WAVE_SHARE * held[-1])))
    chosen = np.asarray((size >= size.max() - steps) & (gaps > 0.0))
    if np.count_nonzero(chosen) > most:
        order = np.argsort(-gaps, kind="stable")[:most]
        chosen = np.zeros(len(gaps), np.bool_)
        chosen[order] = True
    return chosen


def halves(parents: Leaves) -> Leaves:
    """Both halves of each box along its axis, the lower one first."""
    twice = Leaves(*(np.repeat(values, 2, axis=0) for values in vars(parents).values()))
    rows = np.arange(len(parents.axis))
    middle = 0.5 * (parents.boxes[rows, 2 * parents.axis] + parents.boxes[rows, 2 * parents.axis + 1])
    twice.boxes[2 * rows, 2 * parents.axis + 1] = middle
    twice.boxes[2 * rows + 1, 2 * parents.axis] = middle
    twice.volumes *= 0.5
    return twice
