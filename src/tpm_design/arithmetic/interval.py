"""Intervals with outward rounding, in Python and in compiled code.

``Interval(lo, hi)`` stands for the real numbers between its bounds; −∞ below and +∞ above stand for a missing
bound, and so does a NaN that enters compiled code; an infinite number there lies beyond all floats. Every
operation encloses the exact result for all members of its operands. Processors round to nearest, half an ulp
off at most; each bound is therefore moved outward by one to two ulps, x ∓ (|x|·2⁻⁵² + 2⁻¹⁰⁷⁴), which needs no
change of rounding mode. Numbers mixed in are exact.

The functions below are the only implementation: Python calls them as they are, Numba compiles them.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass
from typing import Any

from tpm_design.arithmetic.compilation import (
    PRIMITIVE,
    STRICT,
    is_number,
    register_operator,
    register_unary,
)
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
    overload,
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
    """The real numbers from ``lo`` to ``hi``. Raises ParameterError where there are none.

    ``+ − * /`` with intervals and numbers; numbers (integers up to 2⁵³) are exact.
    """

    # a NumPy number on the left leaves the operation to this class
    __array_ufunc__ = None

    lo: float
    hi: float

    def __post_init__(self) -> None:
        if not self.lo <= self.hi or self.lo == INFINITY or self.hi == -INFINITY:
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


def bounded(lo: float, hi: float) -> Interval:
    """``Interval(lo, hi)``, in compiled code without a look at the bounds."""
    return Interval(lo, hi)


@type_callable(bounded)
def _type_bounded(context: Any) -> Any:
    def typer(lo: Any, hi: Any) -> Any:
        return interval_type if is_number(lo) and is_number(hi) else None

    return typer


@lower_builtin(bounded, types.Number, types.Number)
def _lower_bounded(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    interval = cgutils.create_struct_proxy(interval_type)(context, builder)
    interval.lo = context.cast(builder, arguments[0], signature.args[0], types.float64)
    interval.hi = context.cast(builder, arguments[1], signature.args[1], types.float64)
    return interval._getvalue()


# a function with options of its own, so that fast-math licences of the caller do not void the look for NaN
@overload(Interval, jit_options=PRIMITIVE, strict=False)
def _overload_constructor(lo: Any, hi: Any) -> Any:
    def constructor(lo: Any, hi: Any) -> Any:
        x, y = float(lo), float(hi)
        return bounded(least(LARGEST, most(-INFINITY, x)), most(-LARGEST, least(INFINITY, y)))

    return constructor if is_number(lo) and is_number(hi) else None


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


# In compiled code no bound is NaN, no lower bound +∞ and no upper bound −∞: the constructor sees to that, and
# every operation keeps it. ``least`` and ``most`` pass over a NaN in second place.


@register_jitable(**PRIMITIVE)
def least(a: float, b: float) -> float:
    return b if b < a else a


@register_jitable(**PRIMITIVE)
def most(a: float, b: float) -> float:
    return b if b > a else a


@register_jitable(**PRIMITIVE)
def down(x: float) -> float:
    """A float below every real number that rounds to ``x``."""
    finite = least(x, LARGEST)
    return finite - abs(finite) * EPSILON - SMALLEST


@register_jitable(**PRIMITIVE)
def up(x: float) -> float:
    """A float above every real number that rounds to ``x``."""
    finite = most(x, -LARGEST)
    return finite + abs(finite) * EPSILON + SMALLEST


@register_jitable(**PRIMITIVE)
def down_sum(x: float) -> float:
    """``down`` for sums and square roots: they never underflow, so that a zero is exact and stays."""
    finite = least(x, LARGEST)
    return finite - abs(finite) * EPSILON


@register_jitable(**PRIMITIVE)
def up_sum(x: float) -> float:
    """``up`` for sums and square roots."""
    finite = most(x, -LARGEST)
    return finite + abs(finite) * EPSILON


def negate(a: Interval) -> Interval:
    return bounded(-a.hi, -a.lo)


def identity(a: Any) -> Any:
    return a


def add(a: Interval, b: Interval) -> Interval:
    return bounded(down_sum(a.lo + b.lo), up_sum(a.hi + b.hi))


def add_number(a: Interval, b: float) -> Interval:
    return a + Interval(b, b)


def add_to_number(a: float, b: Interval) -> Interval:
    return Interval(a, a) + b


def subtract(a: Interval, b: Interval) -> Interval:
    return bounded(down_sum(a.lo - b.hi), up_sum(a.hi - b.lo))


def subtract_number(a: Interval, b: float) -> Interval:
    return a - Interval(b, b)


def subtract_from_number(a: float, b: Interval) -> Interval:
    return Interval(a, a) - b


def multiply(a: Interval, b: Interval) -> Interval:
    """0·∞ is NaN and stands for 0, as an infinite bound stands for arbitrarily large real numbers. Passing
    over it is enough: where it is not the first product, 0 lies between the others."""
    p, q, r, s = a.lo * b.lo, a.lo * b.hi, a.hi * b.lo, a.hi * b.hi
    p = p if p == p else 0.0  # noqa: PLR0124  (NaN)
    return bounded(down(least(least(least(p, q), r), s)), up(most(most(most(p, q), r), s)))


def multiply_number(a: Interval, b: float) -> Interval:
    if 0.0 < b <= LARGEST:
        return bounded(down(a.lo * b), up(a.hi * b))
    return a * Interval(b, b)


def multiply_by_number(a: float, b: Interval) -> Interval:
    return b * a


@register_jitable(**PRIMITIVE)
def quotient(a_lo: float, a_hi: float, b_lo: float, b_hi: float) -> Interval:
    """Bounds of a/b for b > 0, or b ≥ 0 where a keeps away from 0 (b = 0 is then a missing bound)."""
    below = b_hi if a_lo >= 0 else b_lo
    above = b_lo if a_hi >= 0 else b_hi
    lo = down(a_lo / below) if below > 0 else -INFINITY
    hi = up(a_hi / above) if above > 0 else INFINITY
    return bounded(lo, hi)


@register_jitable(**STRICT)
def general_quotient(a: Interval, b: Interval) -> Interval:
    """a/b; half a line where b has 0 at one end and a keeps away from 0, else the whole line if 0 is in b."""
    away = (a.lo > 0) | (a.hi < 0)
    if (b.lo > 0) | ((b.lo == 0) & (b.hi > 0) & away):
        return quotient(a.lo, a.hi, b.lo, b.hi)
    if (b.hi < 0) | ((b.hi == 0) & (b.lo < 0) & away):
        return quotient(-a.hi, -a.lo, -b.hi, -b.lo)
    return bounded(-INFINITY, INFINITY)


def divide(a: Interval, b: Interval) -> Interval:
    """As ``general_quotient``, in line where b > 0."""
    if b.lo > 0:
        below = b.hi if a.lo >= 0 else b.lo
        above = b.lo if a.hi >= 0 else b.hi
        return bounded(down(a.lo / below), up(a.hi / above))
    return general_quotient(a, b)


def divide_by_number(a: Interval, b: float) -> Interval:
    return a / Interval(b, b)


def divide_number(a: float, b: Interval) -> Interval:
    return Interval(a, a) / b


@register_jitable(**PRIMITIVE)
def hull(a: Interval, b: Interval) -> Interval:
    """The smallest interval that holds both."""
    return bounded(least(a.lo, b.lo), most(a.hi, b.hi))


register_operator(operator.add, is_interval, is_number, add, add_number, add_to_number)
register_operator(operator.sub, is_interval, is_number, subtract, subtract_number, subtract_from_number)
register_operator(operator.mul, is_interval, is_number, multiply, multiply_number, multiply_by_number)
register_operator(operator.truediv, is_interval, is_number, divide, divide_by_number, divide_number)
register_unary(operator.neg, is_interval, negate)
register_unary(operator.pos, is_interval, identity)
