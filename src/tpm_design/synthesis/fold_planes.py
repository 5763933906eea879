"""The plane that best keeps a body from a line on which a limb is folded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.mechanisms.fold_lines import FoldLine
from tpm_design.synthesis.body_forms import BodyForm

FloatArray = NDArray[np.float64]

ANGLES = np.linspace(0.0, 2.0 * np.pi, 144, endpoint=False)
NARROWINGS = 12


@dataclass(frozen=True, eq=False)
class FoldPlane:
    """``normal`` (3,) · x ≤ ``offset`` holds at no pose of the line; ``room`` (m) is what the body keeps from
    it, negative where every such plane cuts the body."""

    normal: FloatArray
    offset: float
    room: float


def fold_plane(form: BodyForm, centre: FloatArray, sizes: FloatArray, line: FoldLine) -> FoldPlane:
    """Of the planes that touch the line's cylinder, the one that leaves most room."""
    along, point = np.asarray(line.direction), np.asarray(line.point)
    one = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    one /= np.linalg.norm(one)
    other = np.cross(along, one)
    # where a normal has no part along an axis, extents have a kink: there the best one often is
    kinks = np.arctan2(-one, other)
    angles = np.concatenate([ANGLES, kinks, kinks + np.pi])
    width = ANGLES[1]
    best = 0.0
    for _ in range(NARROWINGS):
        normals = np.cos(angles)[:, None] * one + np.sin(angles)[:, None] * other
        normals[np.abs(normals) < 1e-15] = 0.0
        offsets = normals @ point - line.radius
        rooms = offsets - normals @ centre - form.extents(normals, sizes)
        n = int(np.argmax(rooms))
        found = FoldPlane(normals[n], float(offsets[n]), float(rooms[n]))
        best = angles[n]
        angles = np.append(best + width * np.linspace(-1.0, 1.0, 17), best)
        width /= 6.0
    return found
