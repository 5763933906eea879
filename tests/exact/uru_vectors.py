"""The 3-URU written a second time, with vectors in space, from Robotics 9(3), 60, 2020."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.mechanisms import mechanism
from tpm_design.mechanisms.uru import Uru

Array = NDArray[np.float64]
AXES = np.eye(3)


@dataclass(frozen=True)
class Limb:
    """One limb at one pose: points A, B, C, the unit vectors of the paper, θ_i2, θ_i3 and γ_i, β_i."""

    a: Array
    b: Array
    c: Array
    e: Array
    g: Array
    h: Array
    v: Array
    second: float
    third: float
    gamma: float
    beta: float


def limb(machine: Uru, i: int, elbow: float, pose: Array) -> Limb:
    """By the law of cosines in the plane (e_i, h_i), elbow +1 with sin θ_i3 < 0."""
    g = machine.geometry
    f, r = g.proximal[i], g.distal[i]
    e = AXES[i]
    beta = float(np.linalg.norm(pose - pose[i] * e))
    normal = np.cross(e, pose) / beta
    h = np.cross(normal, e)
    base, platform = g.base[i] * e, pose + g.platform[i] * e
    reach = platform - base
    rho = float(np.linalg.norm(reach))
    towards = math.atan2(float(reach @ h), float(reach @ e))
    second = towards + elbow * math.acos((rho**2 + f**2 - r**2) / (2 * f * rho))
    third = -elbow * math.acos((rho**2 - f**2 - r**2) / (2 * f * r))
    knee = base + f * (math.cos(second) * e + math.sin(second) * h)
    v = (platform - knee) / r
    gamma = float(np.cross(normal, knee - base) @ v)
    return Limb(base, platform, knee, e, normal, h, v, second, third, gamma, beta)


def limbs(machine: Uru, elbows: tuple[float, ...], pose: Array) -> list[Limb]:
    return [limb(machine, i, elbows[i], pose) for i in range(3)]


def random_machine(random: np.random.Generator) -> Uru:
    """Three different limbs, offsets and gear ratios of both signs."""
    return mechanism(  # type: ignore[return-value]
        "uru",
        db=tuple(random.uniform(0.0, 0.4, 3)),
        dp=tuple(random.uniform(0.0, 0.4, 3)),
        f=tuple(random.uniform(0.4, 1.0, 3)),
        r=tuple(random.uniform(0.4, 1.0, 3)),
        k=tuple(random.uniform(0.4, 2.5, 3) * random.choice([-1.0, 1.0], 3)),
    )


def random_signs(random: np.random.Generator) -> str:
    return "".join(random.choice(["+", "-"], 3))


def numbers(signs: str) -> tuple[float, ...]:
    return tuple(1.0 if sign == "+" else -1.0 for sign in signs)


def good_poses(machine: Uru, octant: str, count: int, random: np.random.Generator) -> Array:
    """Poses (count, 3) well inside the octant and the leg space."""
    mode = machine.mode(octant=octant, elbows="+++")
    poses = random.uniform(0.08, 1.2, (40_000, 3)) * numbers(octant)
    margins = machine.margins(poses, mode)
    inside = (margins["reach"] > 0.03) & (margins["serial"] > 0.25)
    return poses[inside][:count]
