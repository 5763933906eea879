"""The plane that best keeps a body from a line on which a limb is folded."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tpm_design.mechanisms.fold_lines import FoldLine
from tpm_design.synthesis.body_forms import BodyForm

FloatArray = NDArray[np.float64]

ANGLES = np.linspace(0.0, 2.0 * np.pi, 144, endpoint=False)
# the angle to 1e-6, and the room, which is greatest there, to the square of that
NARROWINGS, NARROWED = 5, np.linspace(-1.0, 1.0, 17)


@dataclass(frozen=True, eq=False)
class FoldPlane:
    """``normal`` (3,) · x ≤ ``offset`` holds at no pose of the line; ``room`` (m) is what the body keeps from
    it, negative where every such plane cuts the body."""

    normal: FloatArray
    offset: float
    room: float


def fold_plane(form: BodyForm, centre: FloatArray, sizes: FloatArray, line: FoldLine) -> FoldPlane:
    """Of the planes that touch the line's cylinder, the one that leaves most room."""
    across, angles, normals = _around(line)
    point, width = np.asarray(line.point), ANGLES[1]
    for narrowing in range(NARROWINGS + 1):
        offsets = normals @ point - line.radius
        rooms = offsets - normals @ centre - form.extents(normals, sizes)
        n = int(np.argmax(rooms))
        if narrowing < NARROWINGS:
            angles = angles[n] + width * NARROWED
            best = normals[n]
            normals = np.cos(angles)[:, None] * across[0] + np.sin(angles)[:, None] * across[1]
            # the best so far as it was: at a kink a part of it is 0 exactly
            normals[len(angles) // 2] = best
            width *= NARROWED[1] - NARROWED[0]
    return FoldPlane(normals[n], float(offsets[n]), float(rooms[n]))


@lru_cache(maxsize=64)
def _around(line: FoldLine) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Two directions across a line, angles from the first to the second, and the unit vectors there."""
    along = np.asarray(line.direction)
    one = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    one /= np.linalg.norm(one)
    other = np.cross(along, one)
    # where a normal has no part along an axis, extents have a kink: there the best one often is
    kinks = np.arctan2(-one, other)
    angles = np.concatenate([ANGLES, kinks, kinks + np.pi])
    normals = np.cos(angles)[:, None] * one + np.sin(angles)[:, None] * other
    normals[np.abs(normals) < 1e-15] = 0.0
    return np.vstack([one, other]), angles, normals
