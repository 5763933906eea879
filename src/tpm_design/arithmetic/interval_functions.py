"""Enclosures of the scalar functions over intervals, each as tight as rounding allows for one argument.

Square roots are correctly rounded by IEEE 754. Sine, cosine and arctangent of the C library are taken to be
good to two ulps (common libraries: below one) and are widened by four.
"""

from __future__ import annotations

import math
from typing import Any

from tpm_design.arithmetic.compilation import PRIMITIVE, STRICT, is_number
from tpm_design.arithmetic.interval import (
    EPSILON,
    INFINITY,
    SMALLEST,
    Interval,
    bounded,
    down,
    down_sum,
    hull,
    is_interval,
    least,
    most,
    up,
    up_sum,
)

# isort: split
from numba.extending import overload, register_jitable

PI_BELOW, PI_ABOVE = 3.141592653589793, 3.1415926535897936  # π = 3.14159265358979323846…
TURN = 2 * math.pi
# beyond it, counting turns in floats is no longer worth trusting
LARGEST_ANGLE = 1e5
# below it, a sum of squares may have lost digits to underflow
LEAST_SQUARE = 1e-280


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


@register_jitable(**PRIMITIVE)
def largest_magnitude(x: Interval) -> float:
    return most(-x.lo, x.hi)


@register_jitable(**PRIMITIVE)
def least_magnitude(x: Interval) -> float:
    return most(most(0.0, x.lo), -x.hi)


@register_jitable(**PRIMITIVE)
def four_down(x: float) -> float:
    return x - abs(x) * (4 * EPSILON) - 4 * SMALLEST


@register_jitable(**PRIMITIVE)
def four_up(x: float) -> float:
    return x + abs(x) * (4 * EPSILON) + 4 * SMALLEST


@register_jitable(**PRIMITIVE)
def sqr(x: Interval) -> Interval:
    near, far = least_magnitude(x), largest_magnitude(x)
    return bounded(most(0.0, down(near * near)), up(far * far))


@register_jitable(**PRIMITIVE)
def root(x: Interval) -> Interval:
    return bounded(down_sum(math.sqrt(most(0.0, x.lo))), up_sum(math.sqrt(most(0.0, x.hi))))


def root_slope(x: Interval) -> Interval:
    """Derivatives of √max(x, 0): half a line where the argument reaches 0."""
    if x.hi <= 0:
        return bounded(0.0, 0.0)
    slope = 1 / (2 * root(x))
    return slope if x.lo > 0 else bounded(0.0, INFINITY)


def pos(x: Interval) -> Interval:
    return bounded(most(0.0, x.lo), most(0.0, x.hi))


def pos_slope(x: Interval) -> Interval:
    return bounded(1.0 if x.lo > 0 else 0.0, 1.0 if x.hi > 0 else 0.0)


def magnitude(x: Interval) -> Interval:
    return bounded(least_magnitude(x), largest_magnitude(x))


def magnitude_slope(x: Interval) -> Interval:
    return bounded(1.0 if x.lo >= 0 else -1.0, 1.0 if x.hi >= 0 else -1.0)


def lesser(a: Any, b: Any) -> Interval:
    u, v = as_interval(a), as_interval(b)
    return bounded(least(u.lo, v.lo), least(u.hi, v.hi))


def greater(a: Any, b: Any) -> Interval:
    u, v = as_interval(a), as_interval(b)
    return bounded(most(u.lo, v.lo), most(u.hi, v.hi))


def of_lesser(a: Interval, b: Interval, x: Interval, y: Interval) -> Interval:
    """x where a < b, y where a > b, and their hull where that is open."""
    if a.hi < b.lo:
        return x
    return y if b.hi < a.lo else hull(x, y)


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


@register_jitable(**STRICT)
def direction_cosine(p: Any, q: Any) -> Interval:
    """Rises with p; with |q| it falls where p > 0 and rises where p < 0."""
    u, v = as_interval(p), as_interval(q)
    near, far = least_magnitude(v), largest_magnitude(v)
    p_lo, p_hi = u.lo, u.hi
    lo = cosine_at(p_lo, far if p_lo > 0 else near)
    hi = cosine_at(p_hi, near if p_hi > 0 else far)
    return bounded(
        most(0.0 if p_lo >= 0 else -1.0, four_down(lo)), least(0.0 if p_hi <= 0 else 1.0, four_up(hi))
    )


@register_jitable(**STRICT)
def keeps_away(x: Interval) -> bool:
    return (x.lo > 0) | (x.hi < 0)


@register_jitable(**PRIMITIVE)
def fraction_within(p: float, inverse: float, other: float, inverse_other: float) -> tuple[float, float]:
    """Bounds from p·inverse and other·inverse_other, both in [0, 1]."""
    return most(0.0, four_down(p * inverse)), least(1.0, four_up(other * inverse_other))


@register_jitable(**PRIMITIVE)
def turned(lo: float, hi: float, like: Interval) -> Interval:
    """[lo, hi], mirrored at 0 where ``like`` is negative."""
    return bounded(lo, hi) if like.lo > 0 else bounded(-hi, -lo)


@register_jitable(**STRICT)
def direction_near_axis(p: Interval, q: Interval) -> tuple[Interval, Interval]:
    return direction_cosine(p, q), direction_cosine(q, p)


def direction(p: Any, q: Any) -> tuple[Interval, Interval]:
    """Two lengths serve the four bounds of a box inside one quadrant."""
    u, v = as_interval(p), as_interval(q)
    p_near, p_far, q_near, q_far = (
        least_magnitude(u),
        largest_magnitude(u),
        least_magnitude(v),
        largest_magnitude(v),
    )
    low, high = p_near * p_near + q_far * q_far, p_far * p_far + q_near * q_near
    ordinary = (low > LEAST_SQUARE) & (low < INFINITY) & (high > LEAST_SQUARE) & (high < INFINITY)
    if ordinary & keeps_away(u) & keeps_away(v):
        shallow, steep = 1 / math.sqrt(high), 1 / math.sqrt(low)
        cosine_lo, cosine_hi = fraction_within(p_near, steep, p_far, shallow)
        sine_lo, sine_hi = fraction_within(q_near, shallow, q_far, steep)
        return turned(cosine_lo, cosine_hi, u), turned(sine_lo, sine_hi, v)
    return direction_near_axis(u, v)


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
    low = -1.0 if reaches(lo, hi, crest + math.pi) else most(-1.0, four_down(least(at_lo, at_hi)))
    high = 1.0 if reaches(lo, hi, crest) else least(1.0, four_up(most(at_lo, at_hi)))
    return bounded(low, high)


@register_jitable(**STRICT)
def turns_countable(x: Interval) -> bool:
    return (x.lo >= -LARGEST_ANGLE) & (x.hi <= LARGEST_ANGLE)


def sine(x: Interval) -> Interval:
    if turns_countable(x):
        return wave(x.lo, x.hi, math.sin(x.lo), math.sin(x.hi), math.pi / 2)
    return bounded(-1.0, 1.0)


def cosine(x: Interval) -> Interval:
    if turns_countable(x):
        return wave(x.lo, x.hi, math.cos(x.lo), math.cos(x.hi), 0.0)
    return bounded(-1.0, 1.0)


def arctangent2(y: Any, x: Any) -> Interval:
    """The whole circle where the box meets the cut (y < 0 ≤ … beside x < 0); atan2(0, x < 0) = π."""
    v, u = as_interval(y), as_interval(x)
    # adding 0 turns −0 into 0, which is above the cut
    y_lo, y_hi = v.lo + 0.0, v.hi + 0.0
    x_lo, x_hi = u.lo + 0.0, u.hi + 0.0
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
        return bounded(-PI_ABOVE, PI_ABOVE)
    return bounded(most(-PI_ABOVE, four_down(lo)), least(PI_ABOVE, four_up(hi)))
