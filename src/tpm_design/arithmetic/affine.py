"""Linear forms with an error that stay true over a box: affine arithmetic in three coordinates.

``Affine``: over the box |t_i| ≤ 1 the quantity is centre + by_first·t₁ + by_second·t₂ + by_third·t₃ within
± error. Every operation keeps that true, its own rounding counted into the error; what is not linear becomes
a linear part and a remainder of second order. In place of bounds of derivatives: dependencies cancel in the
linear part, and a root has a finite form where its slope is infinite.

J. Stolfi, L. H. de Figueiredo, Self-Validated Numerical Methods and Applications, 21st Brazilian Mathematics
Colloquium, 1997, with one error term for all remainders.
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from typing import Any

from tpm_design.arithmetic import algebra, functions
from tpm_design.arithmetic.compilation import STRICT, Function, is_number, register_operator, register_unary
from tpm_design.arithmetic.dual import is_constant
from tpm_design.arithmetic.interval import (
    EPSILON,
    INFINITY,
    Interval,
    down_sum,
    is_interval,
    up_sum,
)
from tpm_design.arithmetic.interval_functions import as_interval

# isort: split
from numba import types
from numba.core import cgutils
from numba.extending import (
    lower_builtin,
    make_attribute_wrapper,
    models,
    overload,
    register_jitable,
    register_model,
    type_callable,
)

# relative: more than the rounding of the sums of at most ten non-negative terms that give an error
GROWTH = 1.0 + 16.0 * EPSILON
# more than what underflow takes from the products of one operation
UNDERFLOW = 1e-300


@dataclass(frozen=True, slots=True)
class Affine:
    """A linear form over a box and its error. Only compiled code computes with it."""

    centre: float
    by_first: float
    by_second: float
    by_third: float
    error: float


class AffineType(types.Type):
    """Numba's type of an Affine."""

    def __init__(self) -> None:
        super().__init__(name="Affine")


affine_type = AffineType()
NUMBERS = ("centre", "by_first", "by_second", "by_third", "error")


def is_affine(kind: Any) -> bool:
    """Whether a Numba type is the affine type."""
    return isinstance(kind, AffineType)


@register_model(AffineType)
class _AffineModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [(name, types.float64) for name in NUMBERS])


for _name in NUMBERS:
    make_attribute_wrapper(AffineType, _name, _name)


@type_callable(Affine)
def _type_constructor(context: Any) -> Any:
    def typer(centre: Any, first: Any, second: Any, third: Any, error: Any) -> Any:
        return affine_type if all(map(is_number, (centre, first, second, third, error))) else None

    return typer


@lower_builtin(Affine, types.Number, types.Number, types.Number, types.Number, types.Number)
def _lower_constructor(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    form = cgutils.create_struct_proxy(affine_type)(context, builder)
    for name, argument, kind in zip(NUMBERS, arguments, signature.args, strict=True):
        setattr(form, name, context.cast(builder, argument, kind, types.float64))
    return form._getvalue()


@register_jitable(**STRICT)
def slopes_size(a: Affine) -> float:
    return abs(a.by_first) + abs(a.by_second) + abs(a.by_third)


@register_jitable(**STRICT)
def bounds(a: Affine) -> Interval:
    """What the form allows; without bounds where it is not finite."""
    radius = (slopes_size(a) + a.error) * GROWTH
    return Interval(down_sum(a.centre - radius), up_sum(a.centre + radius))


@register_jitable(**STRICT)
def constant_form(value: Any) -> Any:
    """What is known to be in an Interval, and no more."""
    centre = 0.5 * value.lo + 0.5 * value.hi
    return Affine(centre, 0.0, 0.0, 0.0, max(value.hi - centre, centre - value.lo) * GROWTH)


@register_jitable(**STRICT)
def coordinate_form(lo: float, hi: float, axis: int) -> Any:
    """The ``axis``-th coordinate (0, 1, 2) of the box, from lo to hi; their middle has to be exact."""
    half = 0.5 * (hi - lo)
    first, second = half if axis == 0 else 0.0, half if axis == 1 else 0.0
    return Affine(0.5 * (lo + hi), first, second, half if axis == 2 else 0.0, 0.0)


def _number_form(x: Any) -> Any:
    return Affine(x, 0.0, 0.0, 0.0, 0.0)


def _interval_form(x: Any) -> Any:
    return constant_form(x)


def _form_itself(x: Any) -> Any:
    return x


def as_affine(x: Any) -> Any:
    """A number or an Interval as a form without slopes; a form as it is."""
    raise NotImplementedError


@overload(as_affine, jit_options=STRICT, strict=False)
def _overload_as_affine(x: Any) -> Function | None:
    if is_affine(x):
        return _form_itself
    if is_interval(x):
        return _interval_form
    return _number_form if is_number(x) else None


def negate(a: Any) -> Any:
    return Affine(-a.centre, -a.by_first, -a.by_second, -a.by_third, a.error)


def add(a: Any, b: Any) -> Any:
    centre = a.centre + b.centre
    first, second, third = a.by_first + b.by_first, a.by_second + b.by_second, a.by_third + b.by_third
    rounding = EPSILON * (abs(centre) + abs(first) + abs(second) + abs(third))
    error = (a.error + b.error + rounding) * GROWTH
    return Affine(centre, first, second, third, error)


def subtract(a: Any, b: Any) -> Any:
    centre = a.centre - b.centre
    first, second, third = a.by_first - b.by_first, a.by_second - b.by_second, a.by_third - b.by_third
    rounding = EPSILON * (abs(centre) + abs(first) + abs(second) + abs(third))
    error = (a.error + b.error + rounding) * GROWTH
    return Affine(centre, first, second, third, error)


def multiply(a: Any, b: Any) -> Any:
    p, q = a.centre, b.centre
    size_a, size_b = slopes_size(a), slopes_size(b)
    linear = abs(p) * size_b + abs(q) * size_a
    rounding = 2.0 * EPSILON * (abs(p * q) + linear)
    remainder = (size_a + a.error) * (size_b + b.error)
    error = (abs(p) * b.error + abs(q) * a.error + remainder + rounding) * GROWTH + UNDERFLOW
    return Affine(
        p * q,
        p * b.by_first + q * a.by_first,
        p * b.by_second + q * a.by_second,
        p * b.by_third + q * a.by_third,
        error,
    )


@register_jitable(**STRICT)
def linearised(a: Any, p: float, shift: Any) -> Any:
    """p·a + shift, an Interval, for a number p."""
    middle = 0.5 * shift.lo + 0.5 * shift.hi
    spread = max(shift.hi - middle, middle - shift.lo)
    centre = p * a.centre + middle
    rounding = 2.0 * EPSILON * (abs(p) * (abs(a.centre) + slopes_size(a)) + abs(middle))
    error = (abs(p) * a.error + spread + rounding) * GROWTH + UNDERFLOW
    return Affine(centre, p * a.by_first, p * a.by_second, p * a.by_third, error)


@register_jitable(**STRICT)
def exact(x: float) -> Any:
    return Interval(x, x)


@register_jitable(**STRICT)
def inverse(a: Any) -> Any:
    """1/x − p x, x > 0, is convex with its least value 2√−p, its greatest at an end; 1/x = −1/−x."""
    within = bounds(a)
    if not (within.lo > 0.0 or within.hi < 0.0):
        return constant_form(1.0 / within)
    p = -1.0 / (within.lo * within.hi)
    slope = exact(-p)
    lo, hi = exact(within.lo), exact(within.hi)
    least = 2.0 * functions.root(slope)
    if within.lo > 0.0:
        most = max((1.0 / lo + slope * lo).hi, (1.0 / hi + slope * hi).hi)
        return linearised(a, p, Interval(least.lo, most))
    most = min((1.0 / lo + slope * lo).lo, (1.0 / hi + slope * hi).lo)
    return linearised(a, p, Interval(most, -least.lo))


def divide(a: Any, b: Any) -> Any:
    return a * inverse(b)


def _add_constant(a: Any, b: Any) -> Any:
    return add(a, as_affine(b))


def _constant_add(a: Any, b: Any) -> Any:
    return add(as_affine(a), b)


def _subtract_constant(a: Any, b: Any) -> Any:
    return subtract(a, as_affine(b))


def _constant_subtract(a: Any, b: Any) -> Any:
    return subtract(as_affine(a), b)


def _multiply_constant(a: Any, b: Any) -> Any:
    return multiply(a, as_affine(b))


def _constant_multiply(a: Any, b: Any) -> Any:
    return multiply(as_affine(a), b)


def _divide_constant(a: Any, b: Any) -> Any:
    return multiply(a, constant_form(1.0 / as_interval(b)))


def _constant_divide(a: Any, b: Any) -> Any:
    return multiply(as_affine(a), inverse(b))


for _function in (add, subtract, multiply):
    register_jitable(**STRICT)(_function)

register_operator(operator.add, is_affine, is_constant, add, _add_constant, _constant_add)
register_operator(operator.sub, is_affine, is_constant, subtract, _subtract_constant, _constant_subtract)
register_operator(operator.mul, is_affine, is_constant, multiply, _multiply_constant, _constant_multiply)
register_operator(operator.truediv, is_affine, is_constant, divide, _divide_constant, _constant_divide)
register_unary(operator.neg, is_affine, negate)
register_unary(operator.pos, is_affine, _form_itself)


def sqr(a: Any) -> Any:
    """(c + d)² = c² + 2 c d + d² with d² between 0 and its greatest value."""
    c = a.centre
    size = slopes_size(a)
    half = 0.5 * (size + a.error) * (size + a.error)
    rounding = 2.0 * EPSILON * (c * c + half + 2.0 * abs(c) * size)
    error = (2.0 * abs(c) * a.error + half + rounding) * GROWTH + UNDERFLOW
    twice = 2.0 * c
    return Affine(c * c + half, twice * a.by_first, twice * a.by_second, twice * a.by_third, error)


def root(a: Any) -> Any:
    """The chord's slope p between the ends: √x − p x is concave, its greatest value 1/4p."""
    within = bounds(a)
    lo, hi = exact(max(0.0, within.lo)), exact(max(0.0, within.hi))
    width = math.sqrt(lo.lo) + math.sqrt(hi.lo)
    if not 0.0 < width < INFINITY:
        return constant_form(functions.root(within))
    p = 1.0 / width
    slope = exact(p)
    least = min((functions.root(lo) - slope * lo).lo, (functions.root(hi) - slope * hi).lo)
    most = (0.25 / slope).hi
    if within.lo < 0.0:
        most = max(most, (slope * (-within.lo)).hi)
    return linearised(a, p, Interval(least, most))


@register_jitable(**STRICT)
def pos(a: Any) -> Any:
    """The chord's slope p between the ends: max(x, 0) − p x is convex with the least value 0."""
    within = bounds(a)
    if within.lo >= 0.0:
        return a
    p = within.hi / (within.hi - within.lo)
    if not 0.0 < p < 1.0:
        return constant_form(functions.pos(within))
    lo, hi = exact(within.lo), exact(within.hi)
    slope = exact(p)
    most = max((-lo * slope).hi, (hi - hi * slope).hi)
    return linearised(a, p, Interval(0.0, most))


def magnitude(a: Any) -> Any:
    """|x| = 2 max(x, 0) − x."""
    within = bounds(a)
    if within.lo >= 0.0:
        return a
    return -a if within.hi <= 0.0 else 2.0 * pos(a) - a


@register_jitable(**STRICT)
def lesser_of_forms(a: Any, b: Any) -> Any:
    """min(a, b) = a − max(a − b, 0)."""
    difference = a - b
    within = bounds(difference)
    if within.hi <= 0.0:
        return a
    return b if within.lo >= 0.0 else a - pos(difference)


def lesser(a: Any, b: Any) -> Any:
    return lesser_of_forms(as_affine(a), as_affine(b))


def greater(a: Any, b: Any) -> Any:
    return -lesser_of_forms(-as_affine(a), -as_affine(b))


@register_jitable(**STRICT)
def direction_of_forms(a: Any, b: Any) -> Any:
    """Cosine and sine of φ₀ + φ, φ₀ at the centre, at distance ρ from the origin, and tan φ = t/(ρ + r) for a
    displacement r along the ray from the origin and t across it. With τ = |tan φ| at most,
    cos φ = 1 − τ²/4 ± τ²/4 and sin φ = t/ρ ± (τ³/2 + τ r/ρ). A scale of both a and b changes r alone."""
    distance = math.sqrt(a.centre * a.centre + b.centre * b.centre)
    c, s = a.centre / distance, b.centre / distance
    first = (c * b.by_first - s * a.by_first) / distance
    second = (c * b.by_second - s * a.by_second) / distance
    third = (c * b.by_third - s * a.by_third) / distance
    along = (
        abs(c * a.by_first + s * b.by_first)
        + abs(c * a.by_second + s * b.by_second)
        + abs(c * a.by_third + s * b.by_third)
    ) / distance
    rounding = 16.0 * EPSILON * (1.0 + (slopes_size(a) + slopes_size(b)) / distance)
    off = (abs(s) * a.error + abs(c) * b.error) / distance + rounding
    along += (abs(c) * a.error + abs(s) * b.error) / distance + rounding
    if not (along < 0.5 and distance > UNDERFLOW):
        cosine, sine = functions.direction(bounds(a), bounds(b))
        return constant_form(cosine), constant_form(sine)
    tangent = (abs(first) + abs(second) + abs(third) + off) * GROWTH / (1.0 - along * GROWTH)
    squared = tangent * tangent
    turned = off + tangent * (0.5 * squared + along)
    quarter = 0.25 * squared
    across = (abs(s) * turned + abs(c) * quarter + rounding) * GROWTH
    beyond = (abs(c) * turned + abs(s) * quarter + rounding) * GROWTH
    short = 1.0 - quarter
    return (
        Affine(c * short, -s * first, -s * second, -s * third, across),
        Affine(s * short, c * first, c * second, c * third, beyond),
    )


def direction(p: Any, q: Any) -> Any:
    return direction_of_forms(as_affine(p), as_affine(q))


def direction_cosine(p: Any, q: Any) -> Any:
    return direction_of_forms(as_affine(p), as_affine(q))[0]


@register_jitable(**STRICT)
def minor(a: float, b: float, c: float, d: float) -> float:
    return a * d - b * c


@register_jitable(**STRICT)
def permanent(a: float, b: float, c: float, d: float) -> float:
    return a * d + b * c


@register_jitable(**STRICT)
def spread(a: Any) -> float:
    return slopes_size(a) + a.error


def determinant(
    a11: Any, a12: Any, a13: Any, a21: Any, a22: Any, a23: Any, a31: Any, a32: Any, a33: Any
) -> Any:
    """Linear in each entry: the cofactors at the centre carry slopes and errors, so that nearly parallel rows
    damp the errors of all rows; products of two and three deviations are remainder."""
    a, b, c, d, e, f, g, h, i = a11, a12, a13, a21, a22, a23, a31, a32, a33
    a0, b0, c0, d0, e0, f0 = a.centre, b.centre, c.centre, d.centre, e.centre, f.centre
    g0, h0, i0 = g.centre, h.centre, i.centre
    ka, kb, kc = minor(e0, f0, h0, i0), -minor(d0, f0, g0, i0), minor(d0, e0, g0, h0)
    kd, ke, kf = -minor(b0, c0, h0, i0), minor(a0, c0, g0, i0), -minor(a0, b0, g0, h0)
    kg, kh, ki = minor(b0, c0, e0, f0), -minor(a0, c0, d0, f0), minor(a0, b0, d0, e0)
    first = (
        (ka * a.by_first + kb * b.by_first + kc * c.by_first)
        + (kd * d.by_first + ke * e.by_first + kf * f.by_first)
        + (kg * g.by_first + kh * h.by_first + ki * i.by_first)
    )
    second = (
        (ka * a.by_second + kb * b.by_second + kc * c.by_second)
        + (kd * d.by_second + ke * e.by_second + kf * f.by_second)
        + (kg * g.by_second + kh * h.by_second + ki * i.by_second)
    )
    third = (
        (ka * a.by_third + kb * b.by_third + kc * c.by_third)
        + (kd * d.by_third + ke * e.by_third + kf * f.by_third)
        + (kg * g.by_third + kh * h.by_third + ki * i.by_third)
    )
    errors = (
        (abs(ka) * a.error + abs(kb) * b.error + abs(kc) * c.error)
        + (abs(kd) * d.error + abs(ke) * e.error + abs(kf) * f.error)
        + (abs(kg) * g.error + abs(kh) * h.error + abs(ki) * i.error)
    )
    ra, rb, rc, rd, re, rf = spread(a), spread(b), spread(c), spread(d), spread(e), spread(f)
    rg, rh, ri = spread(g), spread(h), spread(i)
    pa, pb, pc = permanent(re, rf, rh, ri), permanent(rd, rf, rg, ri), permanent(rd, re, rg, rh)
    remainder = (
        (abs(a0) + ra) * pa
        + (abs(b0) + rb) * pb
        + (abs(c0) + rc) * pc
        + abs(d0) * permanent(rb, rc, rh, ri)
        + abs(e0) * permanent(ra, rc, rg, ri)
        + abs(f0) * permanent(ra, rb, rg, rh)
        + abs(g0) * permanent(rb, rc, re, rf)
        + abs(h0) * permanent(ra, rc, rd, rf)
        + abs(i0) * permanent(ra, rb, rd, re)
    )
    largest = (
        (abs(a0) + ra + abs(b0) + rb + abs(c0) + rc)
        * (abs(d0) + rd + abs(e0) + re + abs(f0) + rf)
        * (abs(g0) + rg + abs(h0) + rh + abs(i0) + ri)
    )
    # every sum above has at most ten terms, each a share of this product
    error = (errors + remainder + 64.0 * EPSILON * largest) * GROWTH + UNDERFLOW
    return Affine(a0 * ka + b0 * kb + c0 * kc, first, second, third, error)


@overload(algebra.determinant, jit_options=STRICT, strict=False)
def _overload_determinant(
    a11: Any, a12: Any, a13: Any, a21: Any, a22: Any, a23: Any, a31: Any, a32: Any, a33: Any
) -> Function | None:
    rows = (a11, a12, a13, a21, a22, a23, a31, a32, a33)
    return determinant if all(map(is_affine, rows)) else None


def _serve(function: Function, implementation: Function, count: int) -> None:
    def one(x: Any) -> Function | None:
        return implementation if is_affine(x) else None

    def two(a: Any, b: Any) -> Function | None:
        known = all(is_affine(kind) or is_constant(kind) for kind in (a, b))
        return implementation if known and (is_affine(a) or is_affine(b)) else None

    overload(function, jit_options=STRICT, strict=False)(one if count == 1 else two)


for _function, _implementation, _count in (
    (functions.sqr, sqr, 1),
    (functions.root, root, 1),
    (functions.pos, pos, 1),
    (functions.magnitude, magnitude, 1),
    (functions.lesser, lesser, 2),
    (functions.greater, greater, 2),
    (functions.direction, direction, 2),
    (functions.direction_cosine, direction_cosine, 2),
):
    _serve(_function, _implementation, _count)
