"""How far a platform tilts in every direction, at one distance, before something stops it.

In coordinates (a, b, d) of ``mechanisms/tilts.py`` a direction of tilt is a ray from (0, 0, d). Along each
the first pose out of the workspace, or beyond a singularity, is bracketed on samples and bisected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.indices import LEGS, REACH, Index, index_values
from tpm_design.workspace.poses import aspect_code, side_margin, workspace_margin

SAMPLES = 256
BISECTIONS = 46
SECTORS = 12
RAYS_PER_SECTOR = 8
NARROWINGS = 40
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
# relative, beyond an end of reach, to see what ends there
BEYOND = 1e-9


@inner
def _inside(geometry, mode, code, x, y, z):  # type: ignore[no-untyped-def]
    if workspace_margin(geometry, mode, x, y, z) < 0.0:
        return False
    return side_margin(geometry, mode, code, 0.0, x, y, z) >= 0.0


@inner
def _end_of_ray(geometry, mode, code, distance, azimuth, most):  # type: ignore[no-untyped-def]
    """tan(β/2) of the first pose outside, ``most`` where there is none."""
    c, s = math.cos(azimuth), math.sin(azimuth)
    for k in range(1, SAMPLES + 1):
        high = most * k / SAMPLES
        if not _inside(geometry, mode, code, high * c, high * s, distance):
            low = most * (k - 1) / SAMPLES
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                if _inside(geometry, mode, code, middle * c, middle * s, distance):
                    low = middle
                else:
                    high = middle
            return high
    return most


@inner
def _least_between(geometry, mode, code, distance, first, last, most):  # type: ignore[no-untyped-def]
    """Golden section search: the least end and its azimuth."""
    u, v = last - GOLDEN * (last - first), first + GOLDEN * (last - first)
    at_u = _end_of_ray(geometry, mode, code, distance, u, most)
    at_v = _end_of_ray(geometry, mode, code, distance, v, most)
    for _ in range(NARROWINGS):
        if at_u < at_v:
            last, v, at_v = v, u, at_u
            u = last - GOLDEN * (last - first)
            at_u = _end_of_ray(geometry, mode, code, distance, u, most)
        else:
            first, u, at_u = u, v, at_v
            v = first + GOLDEN * (last - first)
            at_v = _end_of_ray(geometry, mode, code, distance, v, most)
    return (at_u, u) if at_u < at_v else (at_v, v)


@kernel
def _sector_ends(geometry, mode, code, distance, rays, most, out):  # type: ignore[no-untyped-def]
    """Least tan(β/2) and its azimuth in each sector (S, 2), from ``rays`` rays a sector and the neighbours of
    the lowest."""
    step = 2.0 * math.pi / (out.shape[0] * rays)
    for sector in range(out.shape[0]):
        least, at = math.inf, 0.0
        for k in range(rays):
            azimuth = (sector * rays + k) * step
            end = _end_of_ray(geometry, mode, code, distance, azimuth, most)
            if end < least:
                least, at = end, azimuth
        end, azimuth = _least_between(geometry, mode, code, distance, at - step, at + step, most)
        out[sector, 0], out[sector, 1] = (end, azimuth) if end < least else (least, at)


@dataclass(frozen=True)
class AllRoundTilt:
    """``tilt`` (rad): every pose tilted by less lies in the aspect of the upright one. ``error``: what half
    the rays would have missed. ``sectors``: the tilt of each sector of directions, whose least is ``tilt``.
    ``limit``: what is beyond. ``upright`` (m): margin of reach of the upright pose; negative: no tilt."""

    tilt: float
    error: float
    sectors: tuple[float, ...]
    limit: str
    upright: float


def all_round_tilt(mechanism: Mechanism, mode: Mode, distance: float) -> AllRoundTilt:
    """The largest tilt that is possible in all directions at a distance (m)."""
    geometry, signs = mechanism.geometry, mode.signs
    reach = float(index_values(geometry, signs, Index(REACH), np.array([[0.0, 0.0, distance]]))[0])
    code = aspect_code(geometry, signs, 0.0, 0.0, distance)
    if code == 0:
        return AllRoundTilt(0.0, 0.0, (), "the upright pose", reach)
    most = max(mechanism.reach_half_axes()[:2])
    fine, coarse = np.empty((SECTORS, 2)), np.empty((SECTORS, 2))
    _sector_ends(geometry, signs, code, distance, RAYS_PER_SECTOR, most, fine)
    _sector_ends(geometry, signs, code, distance, RAYS_PER_SECTOR // 2, most, coarse)
    sectors = 2.0 * np.arctan(np.minimum(fine, coarse)[:, 0])
    least = int(sectors.argmin())
    size, azimuth = fine[least] if fine[least, 0] <= coarse[least, 0] else coarse[least]
    pose = (1.0 + BEYOND) * size * np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    limit = _limit(mechanism, mode, pose + np.array([0.0, 0.0, distance]), code)
    error = abs(float(2.0 * np.arctan(coarse[:, 0].min()) - sectors[least])) + 4.0 * BEYOND
    return AllRoundTilt(float(sectors[least]), error, tuple(sectors.tolist()), limit, reach)


def _limit(mechanism: Mechanism, mode: Mode, pose: NDArray[np.float64], code: int) -> str:
    """What is not as it should be at a pose."""
    poses = pose.reshape(1, 3)
    values = mechanism.determinants_at(poses, mode)[:, 0]
    for part, name in enumerate(mechanism.kind.determinants):
        if (values[part] > 0.0) != bool((code - 1) >> part & 1):
            return f"{name} singularity"
    legs = index_values(mechanism.geometry, mode.signs, Index(LEGS), poses)[0]
    return "edge of reach" if legs < 0.0 else "joint limits"
