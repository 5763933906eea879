"""The outer bounds of a mechanism's reach that are convex in lengths and pose together.

A limb that is stretched is as far as it can go: ‖an affine map of lengths and pose‖ ≤ an affine form of
lengths, a second-order cone. Inner bounds (folded limbs) and most limits of joints are not convex, and are
left out: whatever is reachable satisfies the cones, not the other way round.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from tpm_design.errors import ParameterError

Length = tuple[str, int]
"""A length of one limb: the parameter's name and the limb, from 0."""

Values = Mapping[str, tuple[float, ...]]
Ranges = Mapping[Length, tuple[float, float]]


@dataclass(frozen=True)
class Affine:
    """Σ ``lengths``[ℓ] ℓ + ``pose`` · p + ``constant`` (m)."""

    lengths: Mapping[Length, float] = field(default_factory=lambda: MappingProxyType({}))
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    constant: float = 0.0


@dataclass(frozen=True)
class ReachCone:
    """‖``across``‖ ≤ ``within`` at every reachable pose; without ``across``: a half-space, 0 ≤ ``within``.
    Raises ParameterError where the bound on a norm depends on the pose."""

    across: tuple[Affine, ...]
    within: Affine

    def __post_init__(self) -> None:
        if self.across and any(self.within.pose):
            raise ParameterError("The bound on the norm of a reach cone depends on the pose.")


@dataclass(frozen=True)
class OuterReach:
    """``cones(values, limits)``: the cones of one mechanism, from the limits and the SI values per limb of
    the parameters named in ``angles``, which place the cones and cannot be variables of a convex program.

    ``planes_are_singular(ranges, limits, edges, distance)``: whether a box with these edges (m) that is
    reachable in one octant is at least ``distance`` (m) from every coordinate plane whenever that is its
    distance to the rotation singularity, for every design of the ranges (SI, by parameter and limb). None:
    nothing of the kind is known.
    """

    cones: Callable[[Values, Mapping[str, Any]], tuple[ReachCone, ...]]
    angles: tuple[str, ...] = ()
    planes_are_singular: Callable[[Ranges, Mapping[str, Any], Sequence[float], float], bool] | None = None


def swing_share(limits: Mapping[str, Any]) -> float:
    """Sine of the limit ``swing``, 1 where there is none."""
    return math.sin(float(limits["swing"])) if "swing" in limits else 1.0


def axis_limb_cones(
    forms: Sequence[Sequence[Sequence[float]]],
    strokes: Sequence[Sequence[float]],
    limits: Mapping[str, Any],
) -> tuple[ReachCone, ...]:
    """For limbs of two links f, r that turn across an axis: ‖forms_i (p + b_i − a_i)‖ ≤ f_i + r_i, and the
    ends of the stroke strokes_i · (p + b_i − a_i) where it is limited. ``forms``: two rows per limb."""

    def along(limb: int, row: Sequence[float]) -> Affine:
        x, y, z = (float(side) for side in row)
        sides = zip("xyz", (x, y, z), strict=True)
        lengths = {
            (f"{point}{axis}", limb): sign * side
            for axis, side in sides
            for point, sign in (("b", 1.0), ("a", -1.0))
            if side != 0.0
        }
        return Affine(lengths, (x, y, z))

    cones = []
    for limb, (rows, stroke) in enumerate(zip(forms, strokes, strict=True)):
        stretched = Affine({("f", limb): 1.0, ("r", limb): 1.0})
        cones.append(ReachCone(tuple(along(limb, row) for row in rows), stretched))
        if "stroke" in limits:
            low, high = (float(end) for end in limits["stroke"])
            travel = along(limb, stroke)
            cones += [
                ReachCone((), _plus(travel, -low, 1.0)),
                ReachCone((), _plus(travel, high, -1.0)),
            ]
    return tuple(cones)


def _plus(form: Affine, constant: float, sign: float) -> Affine:
    """sign · form + constant."""
    x, y, z = form.pose
    lengths = {length: sign * share for length, share in form.lengths.items()}
    return Affine(lengths, (sign * x, sign * y, sign * z), sign * form.constant + constant)
