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

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import short_kernel
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.indices import determinant_at
from tpm_design.workspace.loci import REACH_TOLERANCE, LocusDistance
from tpm_design.workspace.region_geometry import PlacedRegion
from tpm_design.workspace.region_normals import outward_normals

FloatArray = NDArray[np.float64]

# lengths as shares of the reach radius: of differences, of what counts as on a bound, of the way outside
DIFFERENCE = 1e-6
ON_BOUND = 1e-7
OUTSIDE = 1e-6
# differences keep within these shares of the way to where the root begins or ends
SHARE_INSIDE, SHARE_OUTSIDE = 0.05, 0.2
# how far neighbouring designs move the locus, and what a slope may change by on that way, or on that outside
NEIGHBOURHOOD = 1e-7
CURVED = 1e-2
NOT_STATIONARY = 1e-3
DEPENDENT = 1e-6
# three independent gradients make up every other
MOST_CONDITIONS = 3
STENCIL = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])


@short_kernel
def _conditions(geometry, mode, part, points):  # type: ignore[no-untyped-def]
    """(table (N, 1 + L + M), L) at poses (N, 3): one determinant, the margins of the legs and of the mode."""
    x, y, z = points[0]
    leg_count = len(equations.leg_margins(geometry, mode, x, y, z))
    out = np.empty((points.shape[0], 1 + leg_count + len(equations.mode_margins(geometry, mode, x, y, z))))
    for n in range(points.shape[0]):
        x, y, z = points[n]
        out[n, 0] = determinant_at(geometry, mode, part, x, y, z)
        column = 1
        for margin in equations.leg_margins(geometry, mode, x, y, z):
            out[n, column] = margin
            column += 1
        for margin in equations.mode_margins(geometry, mode, x, y, z):
            out[n, column] = margin
            column += 1
    return out, leg_count


@dataclass(frozen=True)
class LocusMotion:
    """Distance to the locus of determinant ``part`` in a mode for machines and places near those where it is
    ``value`` (m). ``offset`` (3,): pose (m) from the region's centre at which conditions are taken;
    ``held``: which of them hold the locus point, with their ``multipliers`` and their own ``weighed`` sum."""

    value: float
    signs: Any
    part: int
    offset: FloatArray
    held: NDArray[np.intp]
    multipliers: FloatArray
    weighed: float

    def distance(self, mechanism: Mechanism, region: PlacedRegion) -> float:
        """Signed distance (m), to first order, for another machine of the kind and the region elsewhere."""
        pose = self.offset + region.centre
        conditions = _conditions_at(mechanism, self.signs, self.part, pose, self.held)
        return self.value - (float(conditions @ self.multipliers) - self.weighed)


def _conditions_at(
    mechanism: Mechanism, signs: object, part: int, pose: FloatArray, held: NDArray[np.intp]
) -> FloatArray:
    table, _ = _conditions(mechanism.geometry, signs, part, pose.reshape(1, 3))
    return np.asarray(table[0, held])


@dataclass(frozen=True)
class _Linear:
    """Conditions near a pose (3,): values (C,), gradients (3, C), and whether each is as good as linear over
    the way that matters (C,). ``legs``: how many of them, after the determinant, are margins of legs."""

    pose: FloatArray
    values: FloatArray
    gradients: FloatArray
    straight: NDArray[np.bool_]
    legs: int


def locus_motion(
    mechanism: Mechanism, mode: Mode, region: PlacedRegion, part: int, found: LocusDistance
) -> LocusMotion | None:
    """What ``found`` becomes nearby; None where the distance has no slope that could be told: at a point that
    is not stationary, or where conditions are too curved or their gradients depend on each other."""
    if found.pose is None:
        return None
    radius = mechanism.reach_radius()

    def linear(pose: FloatArray, step: float, way: float) -> _Linear:
        table, legs = _conditions(mechanism.geometry, mode.signs, part, pose + step * STENCIL)
        rises, bends = table[1:4] - table[4:7], table[1:4] + table[4:7] - 2.0 * table[0]
        straight = way / step * np.abs(bends).max(axis=0) <= CURVED * np.abs(rises).max(axis=0)
        return _Linear(pose, table[0], 0.5 * rises / step, straight, legs)

    pose = np.array(found.pose)
    step, neighbourhood = DIFFERENCE * radius, NEIGHBOURHOOD * radius
    at_point = linear(pose, step, neighbourhood)
    on_bound = max(ON_BOUND * radius, 2.0 * REACH_TOLERANCE)
    bounds = [int(n) for n in np.flatnonzero(np.abs(at_point.values[1:]) <= on_bound) + 1]
    shells = [n for n in bounds if n <= at_point.legs]
    least = float(at_point.values[1 : at_point.legs + 1].min())
    if shells:
        outward = -at_point.gradients[:, shells].sum(axis=1)
        way = OUTSIDE * radius
        at_point = linear(pose + way * outward / np.linalg.norm(outward), SHARE_OUTSIDE * way, way)
        if not (at_point.values[shells] < 0.0).all():
            return None
    elif SHARE_INSIDE * least < step:
        at_point = linear(pose, SHARE_INSIDE * least, neighbourhood)
    if not np.isfinite(at_point.gradients[:, [0, *bounds]]).all():
        return None
    found_multipliers = _multipliers(at_point, outward_normals(region, found.pose), bounds, radius)
    if found_multipliers is None:
        return None
    held, multipliers = found_multipliers
    offset = at_point.pose - region.centre
    own = _conditions_at(mechanism, mode.signs, part, offset + region.centre, held)
    return LocusMotion(
        found.value, mode.signs, part, offset, held, multipliers, weighed=float(own @ multipliers)
    )


def _multipliers(
    near: _Linear, normals: Sequence[FloatArray], bounds: Sequence[int], radius: float
) -> tuple[NDArray[np.intp], FloatArray] | None:
    """The fewest conditions with their multipliers that make a convex combination of the normals: n = λ ∇g +
    Σ μ_i ∇m_i + Σ w_j (n − n_j)."""
    for count in range(1, MOST_CONDITIONS + 1):
        best, residual = None, NOT_STATIONARY
        for first, others, chosen in _choices(normals, bounds, count):
            held = [0, *chosen]
            gradients = near.gradients[:, held]
            gradients[:, 0] *= radius
            columns = np.column_stack([gradients, *(first - other for other in others)])
            solution, _, _, sizes = np.linalg.lstsq(columns, first, rcond=None)
            weights = solution[len(held) :]
            pushing = [m for n, m in zip(held, solution, strict=False) if n > near.legs]
            if (
                not sizes[-1] > DEPENDENT * sizes[0]
                or min((*weights, 1.0 - weights.sum()), default=0.0) < -NOT_STATIONARY
                # the side of a mode can only hold back; on the rim of a shell the locus ends
                or min(pushing, default=0.0) < -NOT_STATIONARY
                or not near.straight[held].all()
            ):
                continue
            missing = float(np.linalg.norm(columns @ solution - first))
            if missing < residual:
                multipliers = np.array(solution[: len(held)], np.float64)
                multipliers[0] *= radius
                best, residual = (np.array(held, np.intp), multipliers), missing
        if best is not None:
            return best
    return None


def _choices(
    normals: Sequence[FloatArray], bounds: Sequence[int], count: int
) -> Iterator[tuple[FloatArray, Sequence[FloatArray], tuple[int, ...]]]:
    """One normal, others beside it, and bounds: ``count`` with the determinant."""
    for beside in range(count):
        for chosen in itertools.combinations(bounds, count - 1 - beside):
            for first, *others in itertools.combinations(normals, 1 + beside):
                yield first, others, chosen
