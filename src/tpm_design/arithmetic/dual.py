"""Values that carry their derivatives: forward differentiation of floats and of intervals.

``Dual(value, derivatives)``: the derivatives are a tuple of the value's own kind, and how many there are is
part of the compiled type. Numbers and plain elements mixed in are constants.
"""

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tpm_design.arithmetic.compilation import (
    STRICT,
    Function,
    is_number,
    register_operator,
    register_unary,
)
from tpm_design.arithmetic.interval import Interval, is_interval

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
    register_model,
    type_callable,
    typeof_impl,
    unbox,
)


@dataclass(frozen=True, slots=True)
class Dual:
    """A value (float or Interval) and its partial derivatives, a tuple of the same kind."""

    # a NumPy number on the left leaves the operation to this class
    __array_ufunc__ = None

    value: Any
    derivatives: tuple[Any, ...]

    def __add__(self, other: Any) -> Dual:
        return add(self, other) if isinstance(other, Dual) else add_constant(self, other)

    def __radd__(self, other: Any) -> Dual:
        return add_to_constant(other, self)

    def __sub__(self, other: Any) -> Dual:
        return subtract(self, other) if isinstance(other, Dual) else subtract_constant(self, other)

    def __rsub__(self, other: Any) -> Dual:
        return subtract_from_constant(other, self)

    def __mul__(self, other: Any) -> Dual:
        return multiply(self, other) if isinstance(other, Dual) else multiply_constant(self, other)

    def __rmul__(self, other: Any) -> Dual:
        return multiply_by_constant(other, self)

    def __truediv__(self, other: Any) -> Dual:
        return divide(self, other) if isinstance(other, Dual) else divide_by_constant(self, other)

    def __rtruediv__(self, other: Any) -> Dual:
        return divide_constant(other, self)

    def __neg__(self) -> Dual:
        return negate(self)

    def __pos__(self) -> Dual:
        return self


class DualType(types.Type):
    """Numba's type of a Dual with ``count`` derivatives."""

    def __init__(self, element: Any, count: int) -> None:
        self.element = element
        self.count = count
        super().__init__(name=f"Dual({element}, {count})")

    @property
    def derivatives(self) -> Any:
        return types.UniTuple(self.element, self.count)


def is_dual(kind: Any) -> bool:
    """Whether a Numba type is a dual type."""
    return isinstance(kind, DualType)


def is_constant(kind: Any) -> bool:
    """Whether a Numba type is one that has no derivatives."""
    return is_number(kind) or is_interval(kind)


@typeof_impl.register(Dual)
def _typeof_dual(value: Any, context: Any) -> Any:
    return DualType(typeof_impl(value.value, context), len(value.derivatives))


@register_model(DualType)
class _DualModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("value", kind.element), ("derivatives", kind.derivatives)])


make_attribute_wrapper(DualType, "value", "value")
make_attribute_wrapper(DualType, "derivatives", "derivatives")


@type_callable(Dual)
def _type_constructor(context: Any) -> Any:
    def typer(value: Any, derivatives: Any) -> Any:
        if isinstance(derivatives, types.UniTuple) and derivatives.dtype == value and is_constant(value):
            return DualType(value, derivatives.count)
        return None

    return typer


@lower_builtin(Dual, types.Any, types.UniTuple)
def _lower_constructor(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    dual = cgutils.create_struct_proxy(signature.return_type)(context, builder)
    dual.value, dual.derivatives = arguments
    return dual._getvalue()


@unbox(DualType)
def _unbox_dual(kind: Any, value: Any, c: Any) -> Any:
    dual = cgutils.create_struct_proxy(kind)(c.context, c.builder)
    failed = cgutils.alloca_once_value(c.builder, cgutils.false_bit)
    for name, member in (("value", kind.element), ("derivatives", kind.derivatives)):
        attribute = c.pyapi.object_getattr_string(value, name)
        native = c.unbox(member, attribute)
        c.pyapi.decref(attribute)
        setattr(dual, name, native.value)
        c.builder.store(c.builder.or_(c.builder.load(failed), native.is_error), failed)
    return NativeValue(dual._getvalue(), is_error=c.builder.load(failed))


@box(DualType)
def _box_dual(kind: Any, value: Any, c: Any) -> Any:
    dual = cgutils.create_struct_proxy(kind)(c.context, c.builder, value=value)
    members = [c.box(kind.element, dual.value), c.box(kind.derivatives, dual.derivatives)]
    constructor = c.pyapi.unserialize(c.pyapi.serialize_object(Dual))
    result = c.pyapi.call_function_objargs(constructor, members)
    for reference in (*members, constructor):
        c.pyapi.decref(reference)
    return result


def written(name: str, parameters: str, expression: str, scope: dict[str, Any]) -> Function:
    """The function ``name`` of these parameters that returns ``expression``, compiled from text."""
    namespace: dict[str, Function] = {}
    exec(f"def {name}({parameters}):\n    return {expression}", scope, namespace)
    return namespace[name]


def componentwise(term: str) -> Callable[[Function], Function]:
    """Make the decorated function give a tuple of ``term`` for every index ``[i]`` of its tuple parameters.

    Compiled code gets the terms written out for the tuple's length: loops over tuples do not vectorise.
    """

    def register(declared: Function) -> Function:
        names = list(inspect.signature(declared).parameters)
        parameters = ", ".join(names)
        scope = declared.__globals__

        def choose(*arguments: Any) -> Function | None:
            count = next((len(a) for a in arguments if isinstance(a, types.UniTuple)), 0)
            terms = "".join(term.replace("[i]", f"[{i}]") + ", " for i in range(count))
            return written(declared.__name__, parameters, f"({terms})", scope) if count else None

        first = next(name for name in names if f"{name}[i]" in term)
        stub = written(declared.__name__, parameters, f"tuple({term} for i in range(len({first})))", scope)
        stub.__doc__ = declared.__doc__
        overload(stub, strict=False, jit_options=STRICT)(choose)
        return stub

    return register


@componentwise("a[i] + b[i]")
def sums(a: Any, b: Any) -> Any: ...


@componentwise("a[i] - b[i]")
def differences(a: Any, b: Any) -> Any: ...


@componentwise("-a[i]")
def negatives(a: Any) -> Any: ...


@componentwise("f * a[i]")
def multiples(f: Any, a: Any) -> Any: ...


@componentwise("a[i] / f")
def quotients(a: Any, f: Any) -> Any: ...


@componentwise("f * a[i] + g * b[i]")
def combinations(f: Any, a: Any, g: Any, b: Any) -> Any:
    """The chain rule for two arguments."""


@componentwise("(a[i] - q * b[i]) / f")
def quotient_rule(a: Any, q: Any, b: Any, f: Any) -> Any: ...


def negate(a: Dual) -> Dual:
    return Dual(-a.value, negatives(a.derivatives))


def identity(a: Any) -> Any:
    return a


def add(a: Dual, b: Dual) -> Dual:
    return Dual(a.value + b.value, sums(a.derivatives, b.derivatives))


def add_constant(a: Dual, b: Any) -> Dual:
    return Dual(a.value + b, a.derivatives)


def add_to_constant(a: Any, b: Dual) -> Dual:
    return Dual(a + b.value, b.derivatives)


def subtract(a: Dual, b: Dual) -> Dual:
    return Dual(a.value - b.value, differences(a.derivatives, b.derivatives))


def subtract_constant(a: Dual, b: Any) -> Dual:
    return Dual(a.value - b, a.derivatives)


def subtract_from_constant(a: Any, b: Dual) -> Dual:
    return Dual(a - b.value, negatives(b.derivatives))


def multiply(a: Dual, b: Dual) -> Dual:
    return Dual(a.value * b.value, combinations(a.value, b.derivatives, b.value, a.derivatives))


def multiply_constant(a: Dual, b: Any) -> Dual:
    return Dual(a.value * b, multiples(b, a.derivatives))


def multiply_by_constant(a: Any, b: Dual) -> Dual:
    return Dual(a * b.value, multiples(a, b.derivatives))


def divide(a: Dual, b: Dual) -> Dual:
    quotient = a.value / b.value
    return Dual(quotient, quotient_rule(a.derivatives, quotient, b.derivatives, b.value))


def divide_by_constant(a: Dual, b: Any) -> Dual:
    return Dual(a.value / b, quotients(a.derivatives, b))


def divide_constant(a: Any, b: Dual) -> Dual:
    quotient = a / b.value
    return Dual(quotient, multiples(-quotient / b.value, b.derivatives))


register_operator(operator.add, is_dual, is_constant, add, add_constant, add_to_constant)
register_operator(operator.sub, is_dual, is_constant, subtract, subtract_constant, subtract_from_constant)
register_operator(operator.mul, is_dual, is_constant, multiply, multiply_constant, multiply_by_constant)
register_operator(operator.truediv, is_dual, is_constant, divide, divide_by_constant, divide_constant)
register_unary(operator.neg, is_dual, negate)
register_unary(operator.pos, is_dual, identity)


def same_kind(x: Any, like: Any) -> Any:
    """A number as an Interval if ``like`` is one, else as a float; an Interval as it is."""
    if isinstance(x, Interval):
        return x
    return Interval(x, x) if isinstance(like, Interval) else float(x)


def _interval_itself(x: Any, like: Any) -> Any:
    return x


def _number_as_interval(x: Any, like: Any) -> Any:
    return Interval(x, x)


def _number_as_float(x: Any, like: Any) -> Any:
    return float(x)


@overload(same_kind, jit_options=STRICT, strict=False)
def _overload_same_kind(x: Any, like: Any) -> Any:
    if is_interval(x):
        return _interval_itself
    return _number_as_interval if is_interval(like) else _number_as_float


@componentwise("same_kind(0.0, a[i])")
def zeros(a: Any) -> Any: ...


def as_dual(x: Any, like: Any) -> Dual:
    """A constant as a Dual without slope, of the kind of ``like`` where that is a Dual; a Dual as it is."""
    return x if isinstance(x, Dual) else _constant_as_dual(x, like)


def _dual_itself(x: Any, like: Any) -> Any:
    return x


def _constant_as_dual(x: Any, like: Any) -> Any:
    return Dual(same_kind(x, like.value), zeros(like.derivatives))


@overload(as_dual, jit_options=STRICT, strict=False)
def _overload_as_dual(x: Any, like: Any) -> Any:
    return _dual_itself if is_dual(x) else _constant_as_dual


def variables(values: tuple[Any, ...]) -> tuple[Dual, ...]:
    """The values (all floats or all Intervals) as Duals, each with slope 1 in itself and 0 in the others.

    ``x, y, z = variables((x, y, z))`` makes a pose's coordinates the variables, here and in compiled code.
    """
    units = range(len(values))
    return tuple(
        Dual(value, tuple(same_kind(float(i == j), value) for j in units)) for i, value in enumerate(values)
    )


@overload(variables, jit_options=STRICT, strict=False)
def _overload_variables(values: Any) -> Function | None:
    if not isinstance(values, types.UniTuple):
        return None
    units = range(values.count)
    duals = [
        f"Dual(values[{i}], ({', '.join(f'same_kind({float(i == j)}, values[0])' for j in units)},))"
        for i in units
    ]
    return written("variables", "values", f"({', '.join(duals)},)", globals())
