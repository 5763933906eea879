"""Directions and joint ranges by cosines and sines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from flint import arb

from tpm_design.checker.balls import Enclosure, Triple, constant
from tpm_design.checker.mechanisms.mechanism import LimitValue

QUARTER = math.pi / 2.0
SAME_ANGLE = 1e-15
"""Rounding of an angle written in degrees: a multiple of 90° is meant to be one."""
QUARTERS = ((1, 0), (0, 1), (-1, 0), (0, -1))

Vector = tuple[arb, arb, arb]


class Angle(NamedTuple):
    cos: arb
    sin: arb


def exact_angle(value: float) -> Angle:
    """Of an angle (rad) without tolerance: 0 and ±1 exactly at multiples of 90°."""
    quarters = round(value / QUARTER)
    if abs(value - quarters * QUARTER) <= SAME_ANGLE * max(1.0, abs(value)):
        cos, sin = QUARTERS[quarters % 4]
        return Angle(arb(cos), arb(sin))
    return Angle(arb(value).cos(), arb(value).sin())


class AngleRange(NamedTuple):
    """An angle is within its range where cos θ · ``cosine`` + sin θ · ``sine`` ≥ ``bound``: the cosine of the
    angle to the middle of the range against that of half its width."""

    cosine: arb
    sine: arb
    bound: arb

    def margin(self, cos: Enclosure, sin: Enclosure) -> Enclosure:
        """≥ 0 where the angle with this cosine and sine is within the range."""
        return cos.times(self.cosine) + sin.times(self.sine) - constant(self.bound)


def angle_range(low: float, high: float) -> AngleRange | None:
    """None where the range holds every angle."""
    middle, half = (arb(low) + arb(high)) / 2, (arb(high) - arb(low)) / 2
    if not half < arb.pi():
        return None
    return AngleRange(middle.cos(), middle.sin(), half.cos())


def angle_ranges(limits: Mapping[str, LimitValue], names: tuple[str, ...]) -> dict[str, AngleRange]:
    """Those of the named limits that hold something back."""
    found = {}
    for name in names:
        limit = limits.get(name)
        bounded = angle_range(*limit) if isinstance(limit, tuple) else None
        if bounded is not None:
            found[name] = bounded
    return found


class Azimuth(NamedTuple):
    """The vertical plane of a limb: ε = (cos, sin, 0) outward, τ = ẑ × ε across it."""

    angle: Angle

    def outward(self, pose: Triple) -> Enclosure:
        return pose[0].times(self.angle.cos) + pose[1].times(self.angle.sin)

    def across(self, pose: Triple) -> Enclosure:
        return pose[1].times(self.angle.cos) - pose[0].times(self.angle.sin)

    def placed(self, outward: Enclosure, across: Enclosure, up: Enclosure) -> Triple:
        """Components along ε, τ, ẑ as components along x, y, z."""
        cos, sin = self.angle
        return (
            outward.times(cos) - across.times(sin),
            outward.times(sin) + across.times(cos),
            up,
        )
