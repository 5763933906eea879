"""Intervals with outward rounding, in Python and in compiled code.

``Interval(lo, hi)`` stands for the real numbers between its bounds; −∞ and +∞ stand for a missing bound, and
so does a NaN that enters compiled code. Every operation encloses the exact result for all members of its
operands. Processors round to nearest, half an ulp off at most; each bound is therefore moved outward by one
to two ulps, x ∓ (|x|·2⁻⁵² + 2⁻¹⁰⁷⁴), which needs no change of rounding mode. Numbers mixed in are exact.

The functions below are the only implementation: Python calls them as they are, Numba compiles them.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass
from typing import Any

from tpm_design.arithmetic.compilation import STRICT, is_number, register_operator, register_unary
from tpm_design.errors import ParameterError

# isort: split
from numba import types
from numba.core import cgutils
from numba.extending import (
    NativeValue,
    box,
    lower_builtin,
    make_attribute_wrapper,
    models,
    register_jitable,
    register_model,
    type_callable,
    typeof_impl,
    unbox,
)

INFINITY = float("inf")
LARGEST = 1.7976931348623157e308
SMALLEST = 5e-324
EPSILON = 2.0**-52


@dataclass(frozen=True, slots=True)
class Interval:
    """The real numbers from ``lo`` to ``hi``. Raises ParameterError unless lo ≤ hi.

    ``+ − * /`` with intervals and numbers; numbers (integers up to 2⁵³) are exact.
    """

    # a NumPy number on the left leaves the operation to this class
    __array_ufunc__ = None

    lo: float
    hi: float

    def __post_init__(self) -> None:
        if not self.lo <= self.hi:
            raise ParameterError(
                f"An interval from {self.lo!r} to {self.hi!r} holds nothing.",
                remedy="Give two numbers, the lower bound first.",
            )

    def __contains__(self, number: float) -> bool:
        return self.lo <= number <= self.hi

    def __add__(self, other: Interval | float) -> Interval:
        return add(self, other) if isinstance(other, Interval) else add_number(self, other)

    def __radd__(self, other: float) -> Interval:
        return add_number(self, other)

    def __sub__(self, other: Interval | float) -> Interval:
        return subtract(self, other) if isinstance(other, Interval) else subtract_number(self, other)

    def __rsub__(self, other: float) -> Interval:
        return subtract_from_number(other, self)

    def __mul__(self, other: Interval | float) -> Interval:
        return multiply(self, other) if isinstance(other, Interval) else multiply_number(self, other)

    def __rmul__(self, other: float) -> Interval:
        return multiply_number(self, other)

    def __truediv__(self, other: Interval | float) -> Interval:
        return divide(self, other) if isinstance(other, Interval) else divide_by_number(self, other)

    def __rtruediv__(self, other: float) -> Interval:
        return divide_number(other, self)

    def __neg__(self) -> Interval:
        return negate(self)

    def __pos__(self) -> Interval:
        return self


class IntervalType(types.Type):
    """Numba's type of an Interval."""

    def __init__(self) -> None:
        super().__init__(name="Interval")


interval_type = IntervalType()


def is_interval(kind: Any) -> bool:
    """Whether a Numba type is the interval type."""
    return isinstance(kind, IntervalType)


@typeof_impl.register(Interval)
def _typeof_interval(value: Any, context: Any) -> IntervalType:
    return interval_type


@register_model(IntervalType)
class _IntervalModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("lo", types.float64), ("hi", types.float64)])


make_attribute_wrapper(IntervalType, "lo", "lo")
make_attribute_wrapper(IntervalType, "hi", "hi")


@type_callable(Interval)
def _type_constructor(context: Any) -> Any:
    def typer(lo: Any, hi: Any) -> Any:
        return interval_type if is_number(lo) and is_number(hi) else None

    return typer


@lower_builtin(Interval, types.Number, types.Number)
def _lower_constructor(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    interval = cgutils.create_struct_proxy(interval_type)(context, builder)
    interval.lo = context.cast(builder, arguments[0], signature.args[0], types.float64)
    interval.hi = context.cast(builder, arguments[1], signature.args[1], types.float64)
    return interval._getvalue()


@unbox(IntervalType)
def _unbox_interval(kind: Any, value: Any, c: Any) -> Any:
    interval = cgutils.create_struct_proxy(kind)(c.context, c.builder)
    failed = cgutils.alloca_once_value(c.builder, cgutils.false_bit)
    for name in ("lo", "hi"):
        bound = c.pyapi.object_getattr_string(value, name)
        native = c.unbox(types.float64, bound)
        c.pyapi.decref(bound)
        setattr(interval, name, native.value)
        c.builder.store(c.builder.or_(c.builder.load(failed), native.is_error), failed)
    return NativeValue(interval._getvalue(), is_error=c.builder.load(failed))


@box(IntervalType)
def _box_interval(kind: Any, value: Any, c: Any) -> Any:
    interval = cgutils.create_struct_proxy(kind)(c.context, c.builder, value=value)
    bounds = [c.box(types.float64, interval.lo), c.box(types.float64, interval.hi)]
    constructor = c.pyapi.unserialize(c.pyapi.serialize_object(Interval))
    result = c.pyapi.call_function_objargs(constructor, bounds)
    for reference in (*bounds, constructor):
        c.pyapi.decref(reference)
    return result


# The order of operands of min and max below decides what becomes of a NaN: both keep their first operand
# unless the second compares smaller (larger).


@register_jitable(**STRICT)
def down(x: float) -> float:
    """A float below every real number that rounds to ``x``; NaN, an unknown bound, gives −∞."""
    finite = min(x, LARGEST)
    return max(-INFINITY, finite - abs(finite) * EPSILON - SMALLEST)


@register_jitable(**STRICT)
def up(x: float) -> float:
    """A float above every real number that rounds to ``x``; NaN, an unknown bound, gives +∞."""
    finite = max(x, -LARGEST)
    return min(INFINITY, finite + abs(finite) * EPSILON + SMALLEST)


@register_jitable(**STRICT)
def down_sum(x: float) -> float:
    """``down`` for sums and square roots: they never underflow, so that a zero is exact and stays."""
    finite = min(x, LARGEST)
    return max(-INFINITY, finite - abs(finite) * EPSILON)


@register_jitable(**STRICT)
def up_sum(x: float) -> float:
    """``up`` for sums and square roots."""
    finite = max(x, -LARGEST)
    return min(INFINITY, finite + abs(finite) * EPSILON)


@register_jitable(**STRICT)
def product(a: float, b: float) -> float:
    """a·b with 0·∞ = 0: an infinite bound stands for arbitrarily large real numbers."""
    p = a * b
    return p if p == p else 0.0  # noqa: PLR0124  (NaN)


@register_jitable(**STRICT)
def known_lo(x: Interval) -> float:
    """The lower bound, −∞ in place of NaN."""
    return max(-INFINITY, x.lo)


@register_jitable(**STRICT)
def known_hi(x: Interval) -> float:
    """The upper bound, +∞ in place of NaN."""
    return min(INFINITY, x.hi)


def negate(a: Interval) -> Interval:
    return Interval(-a.hi, -a.lo)


def identity(a: Any) -> Any:
    return a


def add(a: Interval, b: Interval) -> Interval:
    return Interval(down_sum(a.lo + b.lo), up_sum(a.hi + b.hi))


def add_number(a: Interval, b: float) -> Interval:
    return Interval(down_sum(a.lo + b), up_sum(a.hi + b))


def add_to_number(a: float, b: Interval) -> Interval:
    return Interval(down_sum(a + b.lo), up_sum(a + b.hi))


def subtract(a: Interval, b: Interval) -> Interval:
    return Interval(down_sum(a.lo - b.hi), up_sum(a.hi - b.lo))


def subtract_number(a: Interval, b: float) -> Interval:
    return Interval(down_sum(a.lo - b), up_sum(a.hi - b))


def subtract_from_number(a: float, b: Interval) -> Interval:
    return Interval(down_sum(a - b.hi), up_sum(a - b.lo))


def multiply(a: Interval, b: Interval) -> Interval:
    a_lo, a_hi, b_lo, b_hi = known_lo(a), known_hi(a), known_lo(b), known_hi(b)
    p, q = product(a_lo, b_lo), product(a_lo, b_hi)
    r, s = product(a_hi, b_lo), product(a_hi, b_hi)
    return Interval(down(min(p, q, r, s)), up(max(p, q, r, s)))


def multiply_number(a: Interval, b: float) -> Interval:
    return a * Interval(b, b)


def multiply_by_number(a: float, b: Interval) -> Interval:
    return Interval(a, a) * b


@register_jitable(**STRICT)
def quotient(a_lo: float, a_hi: float, b_lo: float, b_hi: float) -> Interval:
    """Bounds of a/b for b > 0, or b ≥ 0 where a keeps away from 0 (b = 0 is then a missing bound)."""
    below = b_hi if a_lo >= 0 else b_lo
    above = b_lo if a_hi >= 0 else b_hi
    lo = down(a_lo / below) if below > 0 else -INFINITY
    hi = up(a_hi / above) if above > 0 else INFINITY
    return Interval(lo, hi)


def divide(a: Interval, b: Interval) -> Interval:
    """a/b; half a line where b has 0 at one end and a keeps away from 0, else the whole line if 0 is in b."""
    a_lo, a_hi, b_lo, b_hi = known_lo(a), known_hi(a), known_lo(b), known_hi(b)
    away = (a_lo > 0) | (a_hi < 0)
    if (b_lo > 0) | ((b_lo == 0) & (b_hi > 0) & away):
        return quotient(a_lo, a_hi, b_lo, b_hi)
    if (b_hi < 0) | ((b_hi == 0) & (b_lo < 0) & away):
        return quotient(-a_hi, -a_lo, -b_hi, -b_lo)
    return Interval(-INFINITY, INFINITY)


def divide_by_number(a: Interval, b: float) -> Interval:
    return a / Interval(b, b)


def divide_number(a: float, b: Interval) -> Interval:
    return Interval(a, a) / b


@register_jitable(**STRICT)
def hull(a: Interval, b: Interval) -> Interval:
    """The smallest interval that holds both."""
    return Interval(min(known_lo(a), known_lo(b)), max(known_hi(a), known_hi(b)))


register_operator(operator.add, is_interval, is_number, add, add_number, add_to_number)
register_operator(operator.sub, is_interval, is_number, subtract, subtract_number, subtract_from_number)
register_operator(operator.mul, is_interval, is_number, multiply, multiply_number, multiply_by_number)
register_operator(operator.truediv, is_interval, is_number, divide, divide_by_number, divide_number)
register_unary(operator.neg, is_interval, negate)
register_unary(operator.pos, is_interval, identity)
