"""A mechanism as points and lines in space, named as it declares them, for its line drawing."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.mechanisms.base import Drawing
from tpm_design.mechanisms.mechanism import Mechanism, Mode

FloatArray = NDArray[np.float64]

AXES: Mapping[str, tuple[float, float, float]] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
}
ORIGIN, PLATFORM, MIDDLE = "O", "P", "M"
RAIL = "+rail"
STEP = 1e-4
RAIL_PIECE = 0.17


@dataclass(frozen=True)
class Rail:
    """Where a driven joint slides: ``start`` at coordinate 0, ``direction`` a unit vector along which the
    coordinate grows, ``length`` (m) where a parameter says it."""

    start: FloatArray
    direction: FloatArray
    length: float | None


@dataclass(frozen=True)
class Skeleton:
    """One machine at one pose (m). ``limbs``: (limbs, centres, 3). ``hinges``: per limb, the direction of the
    short bars of its parallelogram."""

    mechanism: Mechanism
    limbs: FloatArray
    platform: FloatArray
    rails: tuple[Rail, ...]
    hinges: tuple[FloatArray, ...]

    @property
    def drawing(self) -> Drawing:
        return self.mechanism.kind.drawing

    @property
    def platform_name(self) -> str:
        """The pose is a position and the point P, or ``platform`` is the middle of the platform's joints."""
        return PLATFORM if self.mechanism.kind.translational else MIDDLE

    @property
    def bases(self) -> FloatArray:
        """Where each limb begins (limbs, 3): the start of its rail, or its first joint."""
        if self.rails:
            return np.array([rail.start for rail in self.rails])
        return self.limbs[:, 0]

    @property
    def size(self) -> float:
        """Diagonal of the box around all joints, the origin and the platform (m)."""
        everything = np.vstack([self.limbs.reshape(-1, 3), self.platform[None], self.bases, np.zeros((1, 3))])
        return float(np.linalg.norm(np.ptp(everything, axis=0)))

    def rail_ends(self, limb: int) -> tuple[FloatArray, FloatArray]:
        """Ends of a rail as drawn: as long as it is, or a piece on both sides of what slides on it."""
        rail = self.rails[limb]
        if rail.length is not None:
            return rail.start, rail.start + rail.length * rail.direction
        place = self.joint(self.drawing.driven)
        assert place is not None
        piece = RAIL_PIECE * self.size * rail.direction
        return self.limbs[limb, place] - piece, self.limbs[limb, place] + piece

    def is_rail(self, place: int) -> bool:
        """Whether what begins at this joint of a limb is its rail."""
        joints = self.drawing.joints
        return bool(self.rails) and bool(joints) and joints[place] == self.drawing.slides_from

    def lines(self, limb: int) -> list[tuple[FloatArray, FloatArray]]:
        """Rail and links of one limb."""
        links = [
            (start, end)
            for place, (start, end) in enumerate(itertools.pairwise(self.limbs[limb]))
            if not self.is_rail(place)
        ]
        return [self.rail_ends(limb), *links] if self.rails else links

    def rods(self, limb: int) -> tuple[FloatArray, FloatArray] | None:
        """Where the middles of the parallelogram's short bars are on one limb; None where there is none."""
        if len(self.drawing.parallelogram) != 2:
            return None
        start, end = (self.point(name, limb) for name in self.drawing.parallelogram)
        return None if start is None or end is None else (start, end)

    def joint(self, name: str) -> int | None:
        """Place of a joint in its limb; None where the mechanism has no joint of this name."""
        return self.drawing.joints.index(name) if name in self.drawing.joints else None

    def point(self, name: str, limb: int) -> FloatArray | None:
        """The point that a mark names, on one limb; None where it names none."""
        place = self.joint(name)
        if place is not None:
            return np.asarray(self.limbs[limb, place])
        if name == ORIGIN:
            return np.zeros(3)
        if name == self.platform_name:
            return self.platform
        if self.rails and name == self.drawing.slides_from:
            return self.rails[limb].start
        return None

    def letters(self) -> tuple[str, ...]:
        """Names of the points of a limb, from the base."""
        joints = self.drawing.joints
        own = self.drawing.slides_from
        return (own, *joints) if self.rails and own not in (*joints, ORIGIN) else joints

    def shared(self, letter: str) -> bool:
        """Whether a joint of all limbs has one place, so that it has one name, ``B_i``."""
        place = self.joint(letter)
        if place is None:
            return False
        return bool(np.ptp(self.limbs[:, place], axis=0).max() < 1e-3 * self.size)

    def is_point(self, point: FloatArray, letter: str) -> bool:
        """Whether a rail that starts with ``letter`` does so at the origin, which has a name already."""
        return letter not in self.drawing.joints and bool(np.linalg.norm(point) < 1e-6 * self.size)

    def direction(self, name: str, limb: int) -> FloatArray | None:
        """The unit vector that a mark names; None where it names none or it has no direction."""
        if name == RAIL:
            return self.rails[limb].direction if self.rails else None
        if len(name) != 2:
            return None
        if name[0] in "+-" and name[1] in AXES:
            return np.array(AXES[name[1]]) * (1.0 if name[0] == "+" else -1.0)
        start, end = self.point(name[0], limb), self.point(name[1], limb)
        return None if start is None or end is None else unit(end - start)


def skeleton(mechanism: Mechanism, mode: Mode, pose: Sequence[float]) -> Skeleton | None:
    """The machine at ``pose``; None where it cannot be there."""
    if not np.isfinite(mechanism.ik(np.asarray(pose, dtype=np.float64).reshape(1, -1), mode)).all():
        return None
    limbs = mechanism.joint_centres(pose, mode)
    if not np.isfinite(limbs).all():
        return None
    translational = mechanism.kind.translational
    platform = np.asarray(pose, dtype=np.float64) if translational else limbs[:, -1].mean(axis=0)
    rails = _rails(mechanism, mode, pose, limbs)
    hinges = tuple(_hinge(limb[-1] - platform, limb[0]) for limb in limbs)
    return Skeleton(mechanism, limbs, platform, rails, hinges)


def _rails(mechanism: Mechanism, mode: Mode, pose: Sequence[float], limbs: FloatArray) -> tuple[Rail, ...]:
    """From how the driven joints move with their coordinates; none where they do not slide."""
    drawing = mechanism.kind.drawing
    if not drawing.slides_from or drawing.driven not in drawing.joints:
        return ()
    place = drawing.joints.index(drawing.driven)
    here = np.asarray(pose, dtype=np.float64)
    radius = mechanism.reach_radius()
    steps = [STEP * (radius if name == "m" else 1.0) for name in mechanism.kind.pose_units]
    poses = np.vstack([here, here + np.diag(steps), here - np.diag(steps)])
    coordinates = mechanism.ik(poses, mode)
    if not np.isfinite(coordinates).all():
        return ()
    centres = np.array([mechanism.joint_centres(near, mode)[:, place] for near in poses])
    count = len(steps)
    turned = coordinates[1 : 1 + count] - coordinates[1 + count :]
    moved = centres[1 : 1 + count] - centres[1 + count :]
    rails = []
    for limb, joint in enumerate(limbs[:, place]):
        best = int(np.argmax(np.abs(turned[:, limb])))
        direction = unit(moved[best, limb] / turned[best, limb])
        if direction is None:
            return ()
        rails.append(Rail(joint - coordinates[0, limb] * direction, direction, _rail_length(mechanism, limb)))
    return tuple(rails)


def _rail_length(mechanism: Mechanism, limb: int) -> float | None:
    for name, mark in mechanism.kind.drawing.marks.items():
        if len(mark) == 2 and mark[1] == RAIL:
            return parameter_value(mechanism, name, limb)
    return None


def _hinge(outward: FloatArray, base: FloatArray) -> FloatArray:
    """ẑ × ε_i, ε_i the horizontal direction of the limb."""
    for vector in (outward, base):
        hinge = unit(np.cross((0.0, 0.0, 1.0), vector))
        if hinge is not None:
            return hinge
    return np.array(AXES["y"])


def parameter_value(mechanism: Mechanism, name: str, limb: int) -> float | None:
    values = mechanism.parameters.get(name)
    return None if values is None else values[limb if len(values) > 1 else 0]


def unit(vector: FloatArray) -> FloatArray | None:
    """The direction of a vector; None where it is 0."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-12 else None
