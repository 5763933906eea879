"""Numbers that are known to lie in a ball, with the balls of their derivatives.

The balls are those of Arb (F. Johansson, Arb: efficient arbitrary-precision midpoint-radius interval
arithmetic, IEEE Transactions on Computers 66(8), 2017): every operation encloses the exact result. What
cannot be bounded is a ball without bounds, of which no comparison is true: nothing is ever proved by it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from flint import arb

Slope = dict[str, arb]
Triple = tuple["Enclosure", "Enclosure", "Enclosure"]

ZERO, UNBOUNDED = arb(0), arb.nan()
WHOLE_UNIT = arb(0, 1)


class Enclosure:
    """``value`` holds a quantity at every point of a box, ``slope[v]`` its derivative in the variable v; a
    variable that is not listed has the derivative 0."""

    __slots__ = ("slope", "value")

    def __init__(self, value: arb, slope: Slope) -> None:
        self.value = value
        self.slope = slope

    def __add__(self, other: Enclosure) -> Enclosure:
        slope = dict(self.slope)
        for name, part in other.slope.items():
            slope[name] = slope[name] + part if name in slope else part
        return Enclosure(self.value + other.value, slope)

    def __sub__(self, other: Enclosure) -> Enclosure:
        slope = dict(self.slope)
        for name, part in other.slope.items():
            slope[name] = slope[name] - part if name in slope else -part
        return Enclosure(self.value - other.value, slope)

    def __mul__(self, other: Enclosure) -> Enclosure:
        return chained(self.value * other.value, ((other.value, self), (self.value, other)))

    def __truediv__(self, other: Enclosure) -> Enclosure:
        reciprocal = inverse(other.value)
        value = self.value * reciprocal
        if not self.slope and not other.slope:
            return Enclosure(value, {})
        return chained(value, ((reciprocal, self), (-value * reciprocal, other)))

    def __neg__(self) -> Enclosure:
        return Enclosure(-self.value, {name: -part for name, part in self.slope.items()})

    def times(self, factor: arb) -> Enclosure:
        """The quantity times a number without derivatives."""
        return Enclosure(self.value * factor, {name: part * factor for name, part in self.slope.items()})


def chained(value: arb, terms: Iterable[tuple[arb, Enclosure]]) -> Enclosure:
    """The chain rule: a function's value and, for each argument, its partial derivative and the argument."""
    slope: Slope = {}
    for partial, argument in terms:
        for name, part in argument.slope.items():
            term = partial * part
            slope[name] = slope[name] + term if name in slope else term
    return Enclosure(value, slope)


def constant(value: arb) -> Enclosure:
    return Enclosure(value, {})


def square(argument: Enclosure) -> Enclosure:
    return chained(wide_square(argument.value), ((2 * argument.value, argument),))


def product(one: Enclosure, other: Enclosure) -> Enclosure:
    """As ``*``, and bounded by the ends where signs are known."""
    return chained(wide_product(one.value, other.value), ((other.value, one), (one.value, other)))


def root(argument: Enclosure) -> Enclosure:
    """Square root, of 0 where the argument is negative. Without a bound on the slope where it may be 0."""
    value = argument.value
    if value > 0:
        result = wide_root(value)
        return (
            chained(result, ((inverse(2 * result), argument),)) if argument.slope else Enclosure(result, {})
        )
    if value <= 0:
        return Enclosure(ZERO, {})
    return Enclosure(ZERO.union(value.upper().sqrt()), unbounded(argument))


def magnitude(argument: Enclosure) -> Enclosure:
    if argument.value >= 0:
        return argument
    if argument.value <= 0:
        return -argument
    # the absolute value has slopes between minus and plus those of its argument
    return Enclosure(abs(argument.value), {name: part * WHOLE_UNIT for name, part in argument.slope.items()})


def direction(x: Enclosure, y: Enclosure) -> tuple[Enclosure, Enclosure, Enclosure]:
    """(x/L, y/L, L) with L = √(x² + y²). Where L may be 0 the first two may be any numbers of [−1, 1]."""
    length_squared = wide_square(x.value) + wide_square(y.value)
    if not length_squared > 0:
        slope = unbounded(x) | unbounded(y)
        either = Enclosure(WHOLE_UNIT, slope)
        return either, either, root(Enclosure(length_squared, slope))
    length = wide_root(length_squared)
    cos, sin = share(x.value, y.value, length), share(y.value, x.value, length)
    if not x.slope and not y.slope:
        return Enclosure(cos, {}), Enclosure(sin, {}), Enclosure(length, {})
    around = inverse(length)
    turn = chained(ZERO, ((cos * around, y), (-sin * around, x)))
    return chained(cos, ((-sin, turn),)), chained(sin, ((cos, turn),)), chained(length, ((cos, x), (sin, y)))


def share(part: arb, other: arb, length: arb) -> arb:
    """part/√(part² + other²), without naming the part twice where that can be."""
    if part > 0:
        return inverse(wide_root(1 + wide_square(other * inverse(part))))
    if part < 0:
        return -inverse(wide_root(1 + wide_square(other * inverse(part))))
    return part * inverse(length)


def inverse(ball: arb) -> arb:
    """1/ball from its ends: a wide ball's own quotient reaches much farther than it must."""
    if ball > 0 or ball < 0:
        return (1 / ball.lower()).union(1 / ball.upper())
    return UNBOUNDED


def wide_root(ball: arb) -> arb:
    """√ball from its ends, of a ball > 0."""
    return ball.lower().sqrt().union(ball.upper().sqrt())


def wide_square(ball: arb) -> arb:
    """ball² from its ends."""
    return (ball.abs_lower() ** 2).union(ball.abs_upper() ** 2)


def wide_product(ball: arb, other: arb) -> arb:
    """ball · other from their ends where neither holds 0: it then keeps their signs."""
    if not ((ball > 0 or ball < 0) and (other > 0 or other < 0)):
        return ball * other
    size = (ball.abs_lower() * other.abs_lower()).union(ball.abs_upper() * other.abs_upper())
    return size if (ball > 0) == (other > 0) else -size


def unbounded(argument: Enclosure) -> Slope:
    return dict.fromkeys(argument.slope, UNBOUNDED)


def dot(u: Sequence[Enclosure], v: Sequence[Enclosure]) -> Enclosure:
    value = ZERO
    terms = []
    for one, other in zip(u, v, strict=True):
        value = value + one.value * other.value
        terms += [(other.value, one), (one.value, other)]
    return chained(value, terms)


def combination(factors: Sequence[arb], parts: Sequence[Enclosure]) -> Enclosure:
    """Σ of numbers without derivatives times quantities."""
    value = ZERO
    terms = []
    for factor, part in zip(factors, parts, strict=True):
        if not factor.is_zero():
            value = value + factor * part.value
            terms.append((factor, part))
    return chained(value, terms)


def norm_squared(u: Sequence[Enclosure]) -> Enclosure:
    value = ZERO
    terms = []
    for part in u:
        value = value + wide_square(part.value)
        terms.append((2 * part.value, part))
    return chained(value, terms)


def minor(a: Enclosure, b: Enclosure, c: Enclosure, d: Enclosure) -> Enclosure:
    """a d − b c."""
    return chained(
        a.value * d.value - b.value * c.value, ((d.value, a), (a.value, d), (-c.value, b), (-b.value, c))
    )


def cross(u: Triple, v: Triple) -> Triple:
    return minor(u[1], u[2], v[1], v[2]), minor(u[2], u[0], v[2], v[0]), minor(u[0], u[1], v[0], v[1])


def determinant(rows: Sequence[Triple]) -> Enclosure:
    """Of three rows; its derivative in an entry is that entry's cofactor."""
    (a, b, c), (d, e, f), (g, h, i) = ([entry.value for entry in row] for row in rows)
    first = (e * i - f * h, f * g - d * i, d * h - e * g)
    value = a * first[0] + b * first[1] + c * first[2]
    if not any(entry.slope for row in rows for entry in row):
        return Enclosure(value, {})
    second = (h * c - i * b, i * a - g * c, g * b - h * a)
    third = (b * f - c * e, c * d - a * f, a * e - b * d)
    cofactors = (*first, *second, *third)
    return chained(value, zip(cofactors, (*rows[0], *rows[1], *rows[2]), strict=True))


class Symmetric(NamedTuple):
    """A symmetric 3 × 3 matrix: its diagonal, and the entries (23, 31, 12) beside it."""

    diagonal: Triple
    beside: Triple


def full(matrix: Symmetric) -> list[list[Enclosure]]:
    """Its three rows."""
    (p, q, r), (u, v, w) = matrix
    return [[p, w, v], [w, q, u], [v, u, r]]
