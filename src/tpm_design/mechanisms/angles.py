"""Cosines and sines of design angles, exact for quarter turns."""

from __future__ import annotations

import math

from tpm_design.arithmetic import Interval, cosine, sine

QUARTER = 0.5 * math.pi
# a right angle that was written in degrees is one
ROUNDING = 1e-15
QUARTER_TURNS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))

# rows of rotations: x to y to z to x, and by 120° about z
NEXT_AXIS = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
THIRD_TURN = (
    (-0.5, -math.sqrt(0.75), 0.0),
    (math.sqrt(0.75), -0.5, 0.0),
    (0.0, 0.0, 1.0),
)

Vector = tuple[float, float, float]
EnclosedVector = tuple[Interval, Interval, Interval]


def _quarter_turn(angle: float) -> tuple[float, float] | None:
    turns = round(angle / QUARTER)
    if abs(angle - turns * QUARTER) > ROUNDING * max(1.0, abs(angle)):
        return None
    return QUARTER_TURNS[turns % 4]


def cosine_sine(angle: float) -> tuple[float, float]:
    """Cosine and sine of an angle (rad); one that is a multiple of 90° to rounding counts as just that."""
    return _quarter_turn(angle) or (math.cos(angle), math.sin(angle))


def enclosed_cosine_sine(angle: float) -> tuple[Interval, Interval]:
    """The same as Intervals."""
    exact = _quarter_turn(angle)
    if exact is not None:
        return Interval(exact[0], exact[0]), Interval(exact[1], exact[1])
    return cosine(Interval(angle, angle)), sine(Interval(angle, angle))


def unit_vector(azimuth: float, elevation: float) -> Vector:
    """The direction at ``azimuth`` from x towards y and ``elevation`` above the plane z = 0 (rad)."""
    (ca, sa), (ce, se) = cosine_sine(azimuth), cosine_sine(elevation)
    return ca * ce, sa * ce, se


def enclosed_unit_vector(azimuth: float, elevation: float) -> EnclosedVector:
    """The same as Intervals."""
    (ca, sa), (ce, se) = enclosed_cosine_sine(azimuth), enclosed_cosine_sine(elevation)
    return ca * ce, sa * ce, se
