"""The scalar functions that formulas are written in, for floats, Intervals and Duals of either.

The body of each function is its float version, plain arithmetic that vectorises. ``slope`` functions are
derivatives, and serve the Duals. Works in Python and in compiled code.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

from tpm_design.arithmetic import interval_functions as enclosure
from tpm_design.arithmetic.compilation import FAST, STRICT, Function, is_number
from tpm_design.arithmetic.dual import (
    Dual,
    as_dual,
    combinations,
    componentwise,
    is_constant,
    is_dual,
    multiples,
)
from tpm_design.arithmetic.interval import Interval, is_interval

# isort: split
from numba.extending import overload

# below this, p² + q² has lost its digits to underflow; it only keeps 0/0 away
LEAST_SQUARE = 1e-300


def scalar_function(intervals: Function, duals: Function | None = None) -> Callable[[Function], Function]:
    """Make the decorated float function serve Intervals and Duals through the given functions as well."""

    def register(floats: Function) -> Function:
        @functools.wraps(floats)
        def function(*arguments: Any) -> Any:
            if duals is not None and any(isinstance(a, Dual) for a in arguments):
                return duals(*arguments)
            if any(isinstance(a, Interval) for a in arguments):
                return intervals(*arguments)
            return floats(*arguments)

        def choose_fast(*arguments: Any) -> Function | None:
            return floats if all(is_number(a) for a in arguments) else None

        def choose_strict(*arguments: Any) -> Function | None:
            if any(is_dual(a) for a in arguments):
                return duals
            constants = all(is_constant(a) for a in arguments)
            return intervals if constants and any(is_interval(a) for a in arguments) else None

        for choose, options in ((choose_fast, FAST), (choose_strict, STRICT)):
            overload(function, jit_options=options, strict=False)(choose)
        return function

    return register


def _dual_sqr(x: Any) -> Any:
    return Dual(sqr(x.value), multiples(2 * x.value, x.derivatives))


@scalar_function(intervals=enclosure.sqr, duals=_dual_sqr)
def sqr(x: Any) -> Any:
    """x²."""
    return x * x


@scalar_function(intervals=enclosure.root_slope)
def root_slope(x: Any) -> Any:
    return 0.5 / math.sqrt(x) if x > 0 else 0.0


def _dual_root(x: Any) -> Any:
    return Dual(root(x.value), multiples(root_slope(x.value), x.derivatives))


@scalar_function(intervals=enclosure.root, duals=_dual_root)
def root(x: Any) -> Any:
    """√max(x, 0). The derivative at x ≤ 0 is 0; of an Interval that reaches 0 from above, [0, ∞]."""
    return math.sqrt(max(x, 0.0))


@scalar_function(intervals=enclosure.pos_slope)
def pos_slope(x: Any) -> Any:
    return 1.0 if x > 0 else 0.0


def _dual_pos(x: Any) -> Any:
    return Dual(pos(x.value), multiples(pos_slope(x.value), x.derivatives))


@scalar_function(intervals=enclosure.pos, duals=_dual_pos)
def pos(x: Any) -> Any:
    """max(x, 0). The derivative at 0 is 0."""
    return max(x, 0.0)


@scalar_function(intervals=enclosure.magnitude_slope)
def magnitude_slope(x: Any) -> Any:
    return 1.0 if x >= 0 else -1.0


def _dual_magnitude(x: Any) -> Any:
    return Dual(magnitude(x.value), multiples(magnitude_slope(x.value), x.derivatives))


@scalar_function(intervals=enclosure.magnitude, duals=_dual_magnitude)
def magnitude(x: Any) -> Any:
    """|x|. The derivative at 0 is 1."""
    return abs(x)


@scalar_function(intervals=enclosure.of_lesser)
def of_lesser(a: Any, b: Any, x: Any, y: Any) -> Any:
    """x where a ≤ b, otherwise y; for Intervals that overlap the hull of both."""
    return x if a <= b else y


@componentwise("of_lesser(a, b, x[i], y[i])")
def all_of_lesser(a: Any, b: Any, x: Any, y: Any) -> Any: ...


def _dual_lesser(a: Any, b: Any) -> Any:
    u, v = as_dual(a, b), as_dual(b, a)
    slopes = all_of_lesser(u.value, v.value, u.derivatives, v.derivatives)
    return Dual(lesser(u.value, v.value), slopes)


@scalar_function(intervals=enclosure.lesser, duals=_dual_lesser)
def lesser(a: Any, b: Any) -> Any:
    """min(a, b). The derivatives where both are equal are those of a."""
    return min(a, b)


def _dual_greater(a: Any, b: Any) -> Any:
    u, v = as_dual(a, b), as_dual(b, a)
    slopes = all_of_lesser(v.value, u.value, u.derivatives, v.derivatives)
    return Dual(greater(u.value, v.value), slopes)


@scalar_function(intervals=enclosure.greater, duals=_dual_greater)
def greater(a: Any, b: Any) -> Any:
    """max(a, b). The derivatives where both are equal are those of a."""
    return max(a, b)


@scalar_function(intervals=enclosure.inverse_length)
def inverse_length(p: Any, q: Any) -> Any:
    return 1 / math.sqrt(max(p * p + q * q, LEAST_SQUARE))


def _dual_direction_cosine(p: Any, q: Any) -> Any:
    u, v = as_dual(p, q), as_dual(q, p)
    across = direction_cosine(v.value, u.value)
    along = direction_cosine(u.value, v.value)
    scale = inverse_length(u.value, v.value)
    return Dual(
        along,
        combinations(sqr(across) * scale, u.derivatives, -(along * across) * scale, v.derivatives),
    )


@scalar_function(intervals=enclosure.direction_cosine, duals=_dual_direction_cosine)
def direction_cosine(p: Any, q: Any) -> Any:
    """p/√(p² + q²), the cosine of the angle between (p, q) and the first axis; 0 at the origin.

    Monotone in p and in |q| and bounded by 1: an Interval gets its exact range, with no pole at the origin.
    """
    return p / math.sqrt(max(p * p + q * q, LEAST_SQUARE))


def _dual_direction(p: Any, q: Any) -> Any:
    u, v = as_dual(p, q), as_dual(q, p)
    along, across = direction(u.value, v.value)
    scale = inverse_length(u.value, v.value)
    turn = combinations(-across * scale, u.derivatives, along * scale, v.derivatives)
    return Dual(along, multiples(-across, turn)), Dual(across, multiples(along, turn))


@scalar_function(intervals=enclosure.direction, duals=_dual_direction)
def direction(p: Any, q: Any) -> Any:
    """Cosine and sine of the angle between (p, q) and the first axis, (0, 0) at the origin; each as
    ``direction_cosine`` has it, in one go."""
    inverse = 1 / math.sqrt(max(p * p + q * q, LEAST_SQUARE))
    return p * inverse, q * inverse


def _dual_sine(x: Any) -> Any:
    return Dual(sine(x.value), multiples(cosine(x.value), x.derivatives))


@scalar_function(intervals=enclosure.sine, duals=_dual_sine)
def sine(x: Any) -> Any:
    """sin x, x in radians."""
    return math.sin(x)


def _dual_cosine(x: Any) -> Any:
    return Dual(cosine(x.value), multiples(-sine(x.value), x.derivatives))


@scalar_function(intervals=enclosure.cosine, duals=_dual_cosine)
def cosine(x: Any) -> Any:
    """cos x, x in radians."""
    return math.cos(x)


def _dual_arctangent2(y: Any, x: Any) -> Any:
    v, u = as_dual(y, x), as_dual(x, y)
    scale = inverse_length(u.value, v.value)
    by_y = direction_cosine(u.value, v.value) * scale
    by_x = -direction_cosine(v.value, u.value) * scale
    return Dual(arctangent2(v.value, u.value), combinations(by_y, v.derivatives, by_x, u.derivatives))


@scalar_function(intervals=enclosure.arctangent2, duals=_dual_arctangent2)
def arctangent2(y: Any, x: Any) -> Any:
    """The angle of the point (x, y), in (−π, π] rad; an Interval box that crosses the cut gets [−π, π]."""
    return math.atan2(y, x)
