"""Machines in plain numbers: where their joints are, by closing each limb's loop with numpy.

Nothing here is differentiated by hand: rows and gains are differences of the inverse map.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Sizes = Mapping[str, float]
"""Of one limb."""
STEP = 1e-6


class Limb(NamedTuple):
    """A limb at a pose: actuator coordinate, unit vector along the link that pushes, crank, the sine of its
    distance from its own singularity, constraint normal if it has one, reach, and what is limited."""

    q: float
    push: Vector
    crank: float
    serial: float
    normal: Vector
    reach: tuple[float, ...]
    limited: Mapping[str, float]


LimbAt = Callable[[Sizes, int, int, Vector], Limb]


def unit(vector: Vector) -> Vector:
    return vector / np.linalg.norm(vector)


def axis(azimuth: float, elevation: float) -> Vector:
    return np.asarray(
        [
            math.cos(elevation) * math.cos(azimuth),
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
        ]
    )


def cylindrical(slide: bool, idle: bool) -> LimbAt:
    def limb_at(size: Sizes, limb: int, sign: int, pose: Vector) -> Limb:
        s = axis(size["azimuth"], size["elevation"])
        base, platform = (np.asarray([size[end + along] for along in "xyz"]) for end in "ab")
        d = axis(size["slide_azimuth"], size["slide_elevation"]) if slide else s
        # base + S d and the platform's point are in one plane across s
        q = float(s @ (pose + platform - base)) / float(s @ d)
        rho = float(np.linalg.norm(pose + platform - base - q * d))
        f, r = size["f"], size["r"]
        share = abs(float(s @ d))  # how fast the pose nears a bound of reach
        cosine = (f * f + r * r - rho * rho) / (2 * f * r)
        interior = math.acos(min(1.0, max(-1.0, cosine)))
        normal = unit(np.cross(s, axis(size["idle_azimuth"], size["idle_elevation"]))) if idle else s
        return Limb(
            q, s, 1.0, math.sin(interior), normal, (share * (f + r - rho), share * (rho - abs(f - r))),
            {"stroke": q, "elbow": interior},
        )  # fmt: skip

    return limb_at


def delta(size: Sizes, limb: int, sign: int, pose: Vector) -> Limb:
    outward = axis(size["azimuth"], 0.0)
    across = np.cross([0.0, 0.0, 1.0], outward)
    upper, lower = size["L"], size["l"]
    end = pose + (size["u"] - size["w"]) * outward
    x, y, z = outward @ end, across @ end, end[2]
    # |end − knee| = l, as x cos θ − z sin θ = ρ cos(θ − toward)
    toward, rho = math.atan2(-z, x), math.hypot(x, z)
    ratio = (x * x + y * y + z * z + upper * upper - lower * lower) / (2 * upper * rho)
    turn = math.acos(min(1.0, max(-1.0, ratio)))
    knees = []
    for theta in (toward + turn, toward - turn):
        knee = upper * (math.cos(theta) * outward - math.sin(theta) * np.asarray([0.0, 0.0, 1.0]))
        knees.append((theta, knee))
    # seen from the base, the knee that is out is turned towards ε
    towards = math.atan2(z, x)
    theta, knee = max(
        knees, key=lambda each: sign * math.sin(math.atan2(each[1][2], outward @ each[1]) - towards)
    )
    s = (end - knee) / lower
    moved = -math.sin(theta) * outward - math.cos(theta) * np.asarray([0.0, 0.0, 1.0])
    return Limb(
        theta, s, upper, abs(float(s @ moved)), unit(np.cross(s, across)),
        (lower - math.hypot(rho - upper, y), math.hypot(rho + upper, y) - lower),
        {"theta": math.remainder(theta, 2 * math.pi), "swing": math.asin(min(1.0, abs(float(y)) / lower))},
    )  # fmt: skip


def on_rail(
    start: Vector, rail: Vector, end: Vector, length: float, lesser: bool
) -> tuple[float, Vector, float]:
    """The carriage's place and the unit vector of the strut from there to ``end``, and the reach."""
    way = end - start
    roots = np.sort(np.roots([1.0, -2.0 * float(rail @ way), float(way @ way) - length * length]).real)
    q = float(roots[0 if lesser else 1])
    aside = float(np.linalg.norm(np.cross(rail, way)))
    return q, (way - q * rail) / length, length - aside


def linear_delta(size: Sizes, limb: int, sign: int, pose: Vector) -> Limb:
    outward = axis(size["azimuth"], 0.0)
    rail = math.sin(size["tilt"]) * outward - math.cos(size["tilt"]) * np.asarray([0.0, 0.0, 1.0])
    end = pose + size["r"] * outward
    q, s, reach = on_rail(size["R"] * outward, rail, end, size["l"], sign > 0)
    across = np.cross([0.0, 0.0, 1.0], outward)
    return Limb(
        q, s, 1.0, abs(float(s @ rail)), unit(np.cross(s, across)), (reach,),
        {"rail": q, "swing": math.asin(min(1.0, abs(float(s @ across))))},
    )  # fmt: skip


def orthoglide(size: Sizes, limb: int, sign: int, pose: Vector) -> Limb:
    rail = np.eye(3)[limb]
    q, s, reach = on_rail(np.zeros(3), rail, pose + size["d"] * rail, size["L"], sign < 0)
    along = abs(float(s @ rail))
    return Limb(q, s, 1.0, along, rail, (reach,), {"stroke": q, "swing": math.acos(min(1.0, along))})


CLOSURES: Mapping[str, LimbAt] = {
    "crr": cylindrical(slide=False, idle=False),
    "prrr": cylindrical(slide=True, idle=False),
    "crrr": cylindrical(slide=False, idle=True),
    "delta": delta,
    "linear_delta": linear_delta,
    "orthoglide": orthoglide,
}
ANGLES = ("azimuth", "elevation", "tilt")


class Machine:
    """A mechanism with sizes by limb and the signs of its mode."""

    def __init__(self, name: str, parameters: Mapping[str, Sequence[float]], signs: Sequence[int]) -> None:
        self.limb_at, self.signs = CLOSURES[name], signs
        self.sizes = [{key: values[limb] for key, values in parameters.items()} for limb in range(3)]

    def limb(self, limb: int, pose: Any) -> Limb:
        return self.limb_at(self.sizes[limb], limb, self.signs[limb], np.asarray(pose, dtype=float))

    def limbs(self, pose: Any) -> list[Limb]:
        return [self.limb(limb, pose) for limb in range(3)]

    def slope(self, limb: int, pose: Any) -> Vector:
        """∂q/∂p by differences."""
        return np.asarray(
            [
                (self.limb(limb, pose + STEP * e).q - self.limb(limb, pose - STEP * e).q) / (2 * STEP)
                for e in np.eye(3)
            ]
        )

    def b(self, limb: int, pose: Any) -> float:
        """a = b ∂q/∂p is the unit vector of the link that pushes."""
        slope = self.slope(limb, pose)
        return float(self.limb(limb, pose).push @ slope) / float(slope @ slope)

    def gain_squared(self, limb: int, pose: Any) -> float:
        """Σ c² of a·dx = Σ c dL with q held: c = −b ∂q/∂L."""
        total = 0.0
        for name, value in self.sizes[limb].items():
            if not name.endswith(ANGLES):
                ends = [
                    self.limb_at(self.sizes[limb] | {name: value + h}, limb, self.signs[limb], pose).q
                    for h in (STEP, -STEP)
                ]
                total += ((ends[0] - ends[1]) / (2 * STEP)) ** 2
        return total * self.b(limb, pose) ** 2
