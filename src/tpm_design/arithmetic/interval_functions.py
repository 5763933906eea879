"""Enclosures of the scalar functions over intervals, each as tight as rounding allows for one argument.

Square roots are correctly rounded by IEEE 754. Sine, cosine and arctangent of the C library are taken to be
good to two ulps (common libraries: below one) and are widened by four.
"""

from __future__ import annotations

import math
from typing import Any

from tpm_design.arithmetic.compilation import STRICT, is_number
from tpm_design.arithmetic.interval import (
    EPSILON,
    INFINITY,
    SMALLEST,
    Interval,
    down,
    down_sum,
    hull,
    is_interval,
    known_hi,
    known_lo,
    up,
    up_sum,
)

# isort: split
from numba.extending import overload, register_jitable

PI_BELOW, PI_ABOVE = 3.141592653589793, 3.1415926535897936  # π = 3.14159265358979323846…
TURN = 2 * math.pi
# beyond it, counting turns in floats is no longer worth trusting
LARGEST_ANGLE = 1e5


def as_interval(x: Any) -> Interval:
    """A number as an interval of no width; an interval as it is."""
    return x if isinstance(x, Interval) else Interval(x, x)


def _number_as_interval(x: Any) -> Interval:
    return Interval(x, x)


def _interval_as_interval(x: Any) -> Any:
    return x


@overload(as_interval, jit_options=STRICT, strict=False)
def _overload_as_interval(x: Any) -> Any:
    if is_interval(x):
        return _interval_as_interval
    return _number_as_interval if is_number(x) else None


@register_jitable(**STRICT)
def largest_magnitude(x: Interval) -> float:
    return max(-known_lo(x), known_hi(x))


@register_jitable(**STRICT)
def least_magnitude(x: Interval) -> float:
    return max(0.0, known_lo(x), -known_hi(x))


@register_jitable(**STRICT)
def four_down(x: float) -> float:
    return x - (abs(x) * (4 * EPSILON) + 4 * SMALLEST)


@register_jitable(**STRICT)
def four_up(x: float) -> float:
    return x + (abs(x) * (4 * EPSILON) + 4 * SMALLEST)


@register_jitable(**STRICT)
def sqr(x: Interval) -> Interval:
    least, most = least_magnitude(x), largest_magnitude(x)
    return Interval(max(0.0, down(least * least)), up(most * most))


@register_jitable(**STRICT)
def root(x: Interval) -> Interval:
    return Interval(down_sum(math.sqrt(max(0.0, known_lo(x)))), up_sum(math.sqrt(max(0.0, known_hi(x)))))


def root_slope(x: Interval) -> Interval:
    """Derivatives of √max(x, 0): half a line where the argument reaches 0."""
    if known_hi(x) <= 0:
        return Interval(0.0, 0.0)
    slope = 1 / (2 * root(x))
    return slope if known_lo(x) > 0 else Interval(0.0, INFINITY)


def pos(x: Interval) -> Interval:
    return Interval(max(0.0, known_lo(x)), max(0.0, known_hi(x)))


def pos_slope(x: Interval) -> Interval:
    return Interval(1.0 if known_lo(x) > 0 else 0.0, 1.0 if known_hi(x) > 0 else 0.0)


def magnitude(x: Interval) -> Interval:
    return Interval(least_magnitude(x), largest_magnitude(x))


def magnitude_slope(x: Interval) -> Interval:
    return Interval(1.0 if known_lo(x) >= 0 else -1.0, 1.0 if known_hi(x) >= 0 else -1.0)


def lesser(a: Any, b: Any) -> Interval:
    u, v = as_interval(a), as_interval(b)
    return Interval(min(known_lo(u), known_lo(v)), min(known_hi(u), known_hi(v)))


def greater(a: Any, b: Any) -> Interval:
    u, v = as_interval(a), as_interval(b)
    return Interval(max(known_lo(u), known_lo(v)), max(known_hi(u), known_hi(v)))


def of_lesser(a: Interval, b: Interval, x: Interval, y: Interval) -> Interval:
    """x where a < b, y where a > b, and their hull where that is open."""
    if known_hi(a) < known_lo(b):
        return x
    return y if known_hi(b) < known_lo(a) else hull(x, y)


@register_jitable(**STRICT)
def cosine_at(p: float, q: float) -> float:
    """p/√(p² + q²) for q ≥ 0 to four ulps, without overflow; 0 at the origin."""
    size = abs(p)
    if size > q:
        tangent = q / size
        return math.copysign(1 / math.sqrt(1 + tangent * tangent), p)
    if p == 0:
        return 0.0
    tangent = p / q
    return tangent / math.sqrt(1 + tangent * tangent)


def direction_cosine(p: Any, q: Any) -> Interval:
    """Rises with p; with |q| it falls where p > 0 and rises where p < 0."""
    u, v = as_interval(p), as_interval(q)
    near, far = least_magnitude(v), largest_magnitude(v)
    p_lo, p_hi = known_lo(u), known_hi(u)
    lo = cosine_at(p_lo, far if p_lo > 0 else near)
    hi = cosine_at(p_hi, near if p_hi > 0 else far)
    return Interval(
        max(0.0 if p_lo >= 0 else -1.0, four_down(lo)), min(0.0 if p_hi <= 0 else 1.0, four_up(hi))
    )


def inverse_length(p: Any, q: Any) -> Interval:
    """1/√(p² + q²): half a line where the box holds the origin."""
    return 1 / root(sqr(as_interval(p)) + sqr(as_interval(q)))


@register_jitable(**STRICT)
def reaches(lo: float, hi: float, angle: float) -> bool:
    """Whether angle + 2πk may lie between lo and hi for a whole k: never wrongly false.

    Wrongly true only within 1e-9 rad, where an extremum differs from 1 by less than an ulp.
    """
    return math.ceil((lo - angle) / TURN - 1e-10) <= math.floor((hi - angle) / TURN + 1e-10)


@register_jitable(**STRICT)
def wave(lo: float, hi: float, at_lo: float, at_hi: float, crest: float) -> Interval:
    """Range of a sine wave with crests at crest + 2πk, from its values at both ends."""
    low = -1.0 if reaches(lo, hi, crest + math.pi) else max(-1.0, four_down(min(at_lo, at_hi)))
    high = 1.0 if reaches(lo, hi, crest) else min(1.0, four_up(max(at_lo, at_hi)))
    return Interval(low, high)


@register_jitable(**STRICT)
def turns_countable(x: Interval) -> bool:
    return (x.lo >= -LARGEST_ANGLE) & (x.hi <= LARGEST_ANGLE)


def sine(x: Interval) -> Interval:
    if turns_countable(x):
        return wave(x.lo, x.hi, math.sin(x.lo), math.sin(x.hi), math.pi / 2)
    return Interval(-1.0, 1.0)


def cosine(x: Interval) -> Interval:
    if turns_countable(x):
        return wave(x.lo, x.hi, math.cos(x.lo), math.cos(x.hi), 0.0)
    return Interval(-1.0, 1.0)


def arctangent2(y: Any, x: Any) -> Interval:
    """The whole circle where the box meets the cut (y < 0 ≤ … beside x < 0); atan2(0, x < 0) = π."""
    v, u = as_interval(y), as_interval(x)
    # adding 0 turns −0 into 0, which is above the cut
    y_lo, y_hi = known_lo(v) + 0.0, known_hi(v) + 0.0
    x_lo, x_hi = known_lo(u) + 0.0, known_hi(u) + 0.0
    if y_lo >= 0:
        lo = math.atan2(y_lo if x_hi >= 0 else y_hi, x_hi)
        hi = math.atan2(y_hi if x_lo >= 0 else y_lo, x_lo)
    elif y_hi < 0:
        lo = math.atan2(y_lo if x_lo >= 0 else y_hi, x_lo)
        hi = math.atan2(y_hi if x_hi >= 0 else y_lo, x_hi)
    elif x_lo >= 0:
        lo = math.atan2(y_lo, x_lo)
        hi = math.atan2(y_hi, x_lo)
    else:
        return Interval(-PI_ABOVE, PI_ABOVE)
    return Interval(max(-PI_ABOVE, four_down(lo)), min(PI_ABOVE, four_up(hi)))
