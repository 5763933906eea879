"""Designs and working modes that are compared with a multibody model, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians

import numpy as np
from mjcf import FloatArray
from numpy.typing import NDArray

from tpm_design.mechanisms.mechanism import Mechanism, Mode

Dimensions = Mapping[str, float | Sequence[float]]


@dataclass(frozen=True)
class Design:
    """One machine and its working modes."""

    kind: str
    parameters: Dimensions
    modes: tuple[Mapping[str, str], ...]


def degrees(*angles: float) -> tuple[float, ...]:
    return tuple(radians(angle) for angle in angles)


ALIKE_CRR = {"f": 0.3, "r": 0.25}
# axes that are neither square to each other nor concurrent, all limbs different
OBLIQUE_CRR = {
    "f": (0.3, 0.35, 0.32),
    "r": (0.28, 0.3, 0.36),
    "azimuth": degrees(10, 80, 200),
    "elevation": degrees(-5, 15, 65),
    "ax": (0.02, -0.1, 0.05),
    "ay": (-0.04, 0.03, 0.06),
    "az": (0.01, 0.05, -0.07),
    "bx": (0.03, 0.02, -0.01),
    "by": (0.01, -0.05, 0.04),
    "bz": (-0.02, 0.01, 0.06),
}
ELBOWS = ({"elbows": "+++"}, {"elbows": "-+-"})
CARRIAGES = ({"carriages": "+++"}, {"carriages": "+-+"})

DESIGNS = (
    Design(
        "uru",
        {"db": 0.3, "dp": 0.1, "f": 0.6, "r": 0.5, "k": 1.0},
        ({"octant": "+++", "elbows": "+++"}, {"octant": "-+-", "elbows": "-++"}),
    ),
    Design(
        "uru",
        {"db": 0.2, "dp": 0.25, "f": (0.5, 0.55, 0.6), "r": (0.6, 0.5, 0.45), "k": (1.0, -2.0, 0.5)},
        ({"octant": "-++", "elbows": "+-+"}, {"octant": "+--", "elbows": "---"}),
    ),
    Design("crr", ALIKE_CRR, ELBOWS),
    Design("crr", OBLIQUE_CRR, ELBOWS),
    Design("prrr", ALIKE_CRR, ELBOWS),
    Design(
        "prrr",
        {**OBLIQUE_CRR, "slide_azimuth": degrees(30, 60, 190), "slide_elevation": degrees(20, -10, 40)},
        ELBOWS,
    ),
    Design("crrr", ALIKE_CRR, ELBOWS),
    Design(
        "crrr",
        {**OBLIQUE_CRR, "idle_azimuth": degrees(95, 20, 10), "idle_elevation": degrees(10, 80, 5)},
        ELBOWS,
    ),
    Design("delta", {"w": 0.164, "u": 0.044, "L": 0.524, "l": 1.244}, ({"elbows": "+++"}, {"elbows": "+-+"})),
    Design(
        "delta",
        {
            "w": (0.2, 0.25, 0.22),
            "u": (0.05, 0.0, 0.08),
            "L": (0.35, 0.4, 0.3),
            "l": (0.8, 0.7, 0.75),
            "azimuth": degrees(-80, 20, 160),
        },
        ({"elbows": "+++"}, {"elbows": "--+"}),
    ),
    Design("linear_delta", {"R": 0.142, "r": 0.073, "l": 0.264, "rail": 0.4}, CARRIAGES),
    Design(
        "linear_delta",
        {
            "R": (0.2, 0.22, 0.18),
            "r": (0.05, 0.04, 0.06),
            "l": (0.45, 0.4, 0.5),
            "rail": 0.8,
            "azimuth": degrees(-140, -35, 80),
            "tilt": degrees(15, -10, 20),
        },
        ({"carriages": "+++"}, {"carriages": "-+-"}),
    ),
    Design("orthoglide", {"L": 0.31, "d": 0.05}, CARRIAGES),
    Design("orthoglide", {"L": (0.3, 0.35, 0.28), "d": (0.04, -0.02, 0.0)}, CARRIAGES),
    Design("puu", {"R": 0.12, "r": 0.05, "theta": radians(45), "L": 0.062}, ({"carriages": "+++"},)),
    Design(
        "puu",
        {"R": 0.12, "r": 0.05, "theta": radians(40), "L": 0.065, "o": 0.008},
        ({"carriages": "+++"}, {"carriages": "+-+"}),
    ),
)

POSES = 4

# mechanism, determinant that changes sign within a working mode, actuators that are locked when it vanishes
CROSSED: tuple[tuple[str, str, str | None], ...] = (
    ("uru", "translation", "joint"),
    ("uru", "actuation", "motor"),
    ("delta", "actuation", "motor"),
    ("delta", "rotation", None),
    ("linear_delta", "actuation", "motor"),
    ("linear_delta", "rotation", None),
    ("orthoglide", "actuation", "motor"),
    ("puu", "actuation", "motor"),
    ("puu", "rotation", None),
)


def poses_of(mechanism: Mechanism, mode: Mode, random: np.random.Generator) -> FloatArray:
    """Poses (POSES, 3) within reach and off the singularities, where motions are not unique."""
    poses = random.uniform(*_range_of_poses(mechanism), (20000, 3))
    regular = (np.abs(mechanism.determinants(poses, mode)) > 0.1).all(axis=0)
    return poses[regular & _closes(mechanism, mode, poses)][:POSES]


def crossing(
    mechanism: Mechanism, mode: Mode, determinant: str, random: np.random.Generator
) -> tuple[FloatArray, FloatArray] | None:
    """A regular pose (3,) and one on the way from it to another where the determinant vanishes, both within
    reach; None if none is found."""
    index = mechanism.kind.determinants.index(determinant)
    poses = random.uniform(*_range_of_poses(mechanism), (20000, 3))
    poses = poses[_closes(mechanism, mode, poses)]
    values = mechanism.determinants(poses, mode)[index]
    positive, negative = poses[values > 0.02], poses[values < -0.02]
    if not len(positive) or not len(negative):
        return None
    for _ in range(200):
        start, end = random.choice(positive), random.choice(negative)
        if not _closes(mechanism, mode, np.linspace(start, end, 100)).all():
            continue
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            value = mechanism.determinants(start + middle * (end - start), mode)[index, 0]
            low, high = (middle, high) if value > 0.0 else (low, middle)
        return start, start + low * (end - start)
    return None


def placement(mechanism: Mechanism, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Position (3,) and orientation (4,), w first, of the platform at a pose."""
    if mechanism.kind.translational:
        return pose, np.array([1.0, 0.0, 0.0, 0.0])
    return _mirrored(mechanism.parameters, pose)


def twists(mechanism: Mechanism, pose: FloatArray) -> FloatArray:
    """Velocity of the platform, linear and angular, for each pose coordinate at unit speed (6, 3)."""
    if mechanism.kind.translational:
        return np.vstack([np.eye(3), np.zeros((3, 3))])
    step = 1e-5
    columns = []
    for axis in np.eye(3):
        (after, turned), (before, start) = (
            placement(mechanism, pose + side * step * axis) for side in (1.0, -1.0)
        )
        # ω = 2 q̇ q*, with q the orientation half way
        half, rate = 0.5 * (turned + start), (turned - start) / (2.0 * step)
        columns.append(np.concatenate([(after - before) / (2.0 * step), 2.0 * _vector_part(rate, half)]))
    return np.array(columns).T


def _closes(mechanism: Mechanism, mode: Mode, poses: FloatArray) -> NDArray[np.bool_]:
    """Where (N,) the limbs reach poses (N, 3) without being stretched or folded."""
    margins = mechanism.margins(poses, mode)
    inside = (margins["reach"] > 0.02 * mechanism.reach_radius()) & (np.nan_to_num(margins["serial"]) > 0.1)
    found: NDArray[np.bool_] = inside & np.isfinite(mechanism.ik(poses, mode)).all(axis=1)
    return found


def _range_of_poses(mechanism: Mechanism) -> tuple[FloatArray, FloatArray]:
    radius = mechanism.reach_radius()
    if mechanism.kind.translational:
        return np.full(3, -radius), np.full(3, radius)
    # tilt direction, tilt, distance
    return np.array([-np.pi, 0.05, 0.0]), np.array([np.pi, 1.3, radius])


def _mirrored(parameters: Mapping[str, tuple[float, ...]], pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Paper C: the platform is the mirror image of one that never moves, (0, 0, h) that of its centre; the
    plane's normal is tilted by β/2 in the direction α, the image of the centre at the distance d."""
    alpha, beta, distance = pose
    (R,), (r,), (theta,), (offset,) = (parameters[name] for name in ("R", "r", "theta", "o"))
    height = (R - r) * np.tan(theta) + offset
    normal = np.array([np.sin(beta / 2) * np.cos(alpha), np.sin(beta / 2) * np.sin(alpha), np.cos(beta / 2)])
    along = -height * normal[2] + np.sqrt(distance**2 - height**2 * (1.0 - normal[2] ** 2))
    axis = np.array([-np.sin(alpha), np.cos(alpha), 0.0])
    quaternion = np.concatenate([[np.cos(beta / 2)], np.sin(beta / 2) * axis])
    return height * np.eye(3)[2] + along * normal, quaternion


def _vector_part(p: FloatArray, q: FloatArray) -> FloatArray:
    """Of the quaternion p q*."""
    part: FloatArray = q[0] * p[1:] - p[0] * q[1:] - np.cross(p[1:], q[1:])
    return part
