"""Ranges of joint angles, compared as cosines so that the same line serves floats and intervals.

A joint is within its range where cos(θ − middle) ≥ bound, the cosine of half the range's width.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from tpm_design.arithmetic import Interval, cosine, sine

JointRange = tuple[float, float]

FULL_TURN = (-math.pi, math.pi)
# a bound on a cosine that every angle is above
NO_LIMIT = -2.0


def range_numbers(joint: JointRange | None) -> tuple[float, float, float]:
    """Cosine and sine of the middle of a range (rad), and the bound; None: no limit."""
    low, high = FULL_TURN if joint is None else joint
    middle, half = 0.5 * (low + high), min(math.pi, 0.5 * (high - low))
    return math.cos(middle), math.sin(middle), NO_LIMIT if joint is None else math.cos(half)


def enclosed_range(joint: JointRange | None) -> tuple[Interval, Interval, Interval]:
    """The same as Intervals."""
    low, high = FULL_TURN if joint is None else joint
    middle = 0.5 * (Interval(low, low) + high)
    half = 0.5 * (Interval(high, high) - low)
    half = Interval(min(math.pi, half.lo), min(math.pi, half.hi))
    bound = Interval(NO_LIMIT, NO_LIMIT) if joint is None else cosine(half)
    return cosine(middle), sine(middle), bound


def joint_range(limits: Mapping[str, Any], name: str) -> JointRange | None:
    """The range of one joint (rad) that a study's limits give, if any."""
    if name not in limits:
        return None
    low, high = limits[name]
    return float(low), float(high)
