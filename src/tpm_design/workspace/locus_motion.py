"""How the distance to a singularity locus changes with the machine and the region's place, to first order.

At the locus point p nearest to the region the signed distance d is stationary on the locus, and where p lies
on bounds of reach on these too: ∇d = λ ∇g + Σ μ_i ∇m_i for the determinant g and the bounds m_i. The locus of
a neighbouring machine is met where g = 0 and m_i = 0 again, so that d is less by λ g + Σ μ_i m_i of that
machine at p (sensitivity of optimal values: A. V. Fiacco, Introduction to Sensitivity and Stability Analysis
in Nonlinear Programming, 1983, ch. 3). As the region moves, p moves with it.

Inside the shell of a leg the determinant goes with the root of the margin, and the locus meets the shell at a
tangent; just outside, where the root is clamped, it is smooth, and the rim is where both vanish. So for a
point on a shell everything is taken just outside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, short_kernel
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.indices import determinant_at
from tpm_design.workspace.loci import REACH_TOLERANCE, LocusDistance
from tpm_design.workspace.multipliers import multipliers_of
from tpm_design.workspace.region_geometry import PlacedRegion
from tpm_design.workspace.region_normals import outward_normals

FloatArray = NDArray[np.float64]
Triple = tuple[float, float, float]

# lengths as shares of the reach radius: of differences, of what counts as on a bound, of the way outside
DIFFERENCE = 1e-6
ON_BOUND = 1e-7
OUTSIDE = 1e-6
# differences keep within these shares of the way to where the root begins or ends
SHARE_INSIDE, SHARE_OUTSIDE = 0.05, 0.2
# how far neighbouring designs move the locus, and what a slope may change by on that way, or on that outside
NEIGHBOURHOOD = 1e-7
CURVED = 1e-2


@inner
def _write_conditions(geometry, mode, part, x, y, z, out):  # type: ignore[no-untyped-def]
    """One determinant, the margins of the legs and of the mode (C,)."""
    out[0] = determinant_at(geometry, mode, part, x, y, z)
    number = 1
    for margin in equations.leg_margins(geometry, mode, x, y, z):
        out[number] = margin
        number += 1
    for margin in equations.mode_margins(geometry, mode, x, y, z):
        out[number] = margin
        number += 1


@inner
def _leg_count(geometry, mode):  # type: ignore[no-untyped-def]
    return len(equations.leg_margins(geometry, mode, 0.0, 0.0, 0.0))


@inner
def _condition_count(geometry, mode):  # type: ignore[no-untyped-def]
    return 1 + _leg_count(geometry, mode) + len(equations.mode_margins(geometry, mode, 0.0, 0.0, 0.0))


@inner
def _linear(geometry, mode, part, pose, step, way):  # type: ignore[no-untyped-def]
    """Conditions near a pose, by differences of ``step`` (m): values (C,), gradients (C, 3), and whether each
    is as good as linear over ``way`` (m) (C,)."""
    count = _condition_count(geometry, mode)
    here, after, before = np.empty(count), np.empty(count), np.empty(count)
    rises, bends = np.zeros(count), np.zeros(count)
    gradients = np.empty((count, 3))
    x, y, z = pose
    _write_conditions(geometry, mode, part, x, y, z, here)
    for axis in range(3):
        u, v, w = step * (axis == 0), step * (axis == 1), step * (axis == 2)
        _write_conditions(geometry, mode, part, x + u, y + v, z + w, after)
        _write_conditions(geometry, mode, part, x - u, y - v, z - w, before)
        for n in range(count):
            rise = after[n] - before[n]
            gradients[n, axis] = 0.5 * rise / step
            rises[n] = max(rises[n], abs(rise))
            bends[n] = max(bends[n], abs(after[n] + before[n] - 2.0 * here[n]))
    return here, gradients, way / step * bends <= CURVED * rises


@short_kernel
def _at_locus(geometry, mode, part, pose, radius):  # type: ignore[no-untyped-def]
    """Where conditions are taken for a locus point: a pose; which conditions (B,) are 0 at the point; their
    gradients (B, 3), and whether each is straight, and no side of the mode (B,). No condition: nowhere."""
    step, way = DIFFERENCE * radius, NEIGHBOURHOOD * radius
    values, gradients, straight = _linear(geometry, mode, part, pose, step, way)
    on_bound = max(ON_BOUND * radius, 2.0 * REACH_TOLERANCE)
    legs = _leg_count(geometry, mode)
    zero = np.abs(values) <= on_bound
    zero[0] = True
    shells = np.flatnonzero(zero[1 : 1 + legs]) + 1
    nearest = values[1 : 1 + legs].min()
    if shells.size:
        u, v, w = 0.0, 0.0, 0.0
        for n in shells:
            u, v, w = u - gradients[n, 0], v - gradients[n, 1], w - gradients[n, 2]
        way = OUTSIDE * radius
        share = way / math.sqrt(u * u + v * v + w * w)
        pose = pose[0] + share * u, pose[1] + share * v, pose[2] + share * w
        values, gradients, straight = _linear(geometry, mode, part, pose, SHARE_OUTSIDE * way, way)
        for n in shells:
            if not values[n] < 0.0:
                zero[:] = False
    elif SHARE_INSIDE * nearest < step:
        _, gradients, straight = _linear(geometry, mode, part, pose, SHARE_INSIDE * nearest, way)
    held = np.flatnonzero(zero)
    return pose, held, gradients[held], straight[held], held <= legs


@short_kernel
def _weighed(geometry, mode, part, pose, held, multipliers):  # type: ignore[no-untyped-def]
    """Σ multiplier · condition at a pose (3,)."""
    conditions = np.empty(_condition_count(geometry, mode))
    x, y, z = pose
    _write_conditions(geometry, mode, part, x, y, z, conditions)
    total = 0.0
    for n in range(held.size):
        total += multipliers[n] * conditions[held[n]]
    return total


@dataclass(frozen=True)
class LocusMotion:
    """Distance to the locus of determinant ``part`` in a mode for machines and places near those where it is
    ``value`` (m). ``offset``: pose (m) from the region's centre at which conditions are taken; ``held``:
    which of them hold the locus point, with their ``multipliers`` and their own ``weighed`` sum."""

    value: float
    signs: Any
    part: int
    offset: Triple
    held: NDArray[np.int64]
    multipliers: FloatArray
    weighed: float = 0.0

    def distance(self, mechanism: Mechanism, region: PlacedRegion) -> float:
        """Signed distance (m), to first order, for another machine of the kind and the region elsewhere."""
        return self.value - (self.sum_for(mechanism, region) - self.weighed)

    def sum_for(self, mechanism: Mechanism, region: PlacedRegion) -> float:
        """Σ multiplier · condition (m) of another machine, the region elsewhere."""
        (a, b, c), (x, y, z) = self.offset, region.centre
        pose = a + x, b + y, c + z
        found: float = _weighed(mechanism.geometry, self.signs, self.part, pose, self.held, self.multipliers)
        return found


def locus_motion(
    mechanism: Mechanism, mode: Mode, region: PlacedRegion, part: int, found: LocusDistance
) -> LocusMotion | None:
    """What ``found`` becomes nearby; None where the distance has no slope that could be told: at a point that
    is not stationary, or where conditions are too curved or their gradients depend on each other."""
    if found.pose is None:
        return None
    radius = mechanism.reach_radius()
    pose, conditions, gradients, straight, two_sided = _at_locus(
        mechanism.geometry, mode.signs, part, found.pose, radius
    )
    normals = outward_normals(region, found.pose)
    multipliers = multipliers_of(gradients, normals, radius, usable=straight, two_sided=two_sided)
    if multipliers is None:
        return None
    places, weights = multipliers
    centre = region.centre
    offset = pose[0] - centre[0], pose[1] - centre[1], pose[2] - centre[2]
    motion = LocusMotion(found.value, mode.signs, part, offset, conditions[places], weights)
    return replace(motion, weighed=motion.sum_for(mechanism, region))
