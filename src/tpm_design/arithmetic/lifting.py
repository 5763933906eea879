"""Numbers of one kind beside numbers of another: constants among Duals, numbers among Intervals."""

from __future__ import annotations

from typing import Any

from tpm_design.arithmetic.compilation import STRICT
from tpm_design.arithmetic.dual import Dual, as_dual, is_dual, same_kind, written
from tpm_design.arithmetic.interval import is_interval

# isort: split
from numba.extending import overload, register_jitable


def lifted(x: Any, like: Any) -> Any:
    """``x`` as a constant of the kind of ``like``: a Dual without slope, an Interval, or ``x`` itself."""
    return as_dual(x, like) if isinstance(like, Dual) else same_kind(x, like)


def _to_dual(x: Any, like: Any) -> Any:
    return as_dual(x, like)


def _to_kind(x: Any, like: Any) -> Any:
    return same_kind(x, like)


@overload(lifted, jit_options=STRICT, strict=False)
def _overload_lifted(x: Any, like: Any) -> Any:
    if is_dual(like):
        return _to_dual
    return _to_kind if not is_dual(x) or is_interval(like) else None


def constant(x: Any, like: Any) -> Any:
    """A number as an Interval of no width where ``like`` is an Interval or a Dual of Intervals."""
    return same_kind(x, like.value) if isinstance(like, Dual) else same_kind(x, like)


def _beside_dual(x: Any, like: Any) -> Any:
    return same_kind(x, like.value)


@overload(constant, jit_options=STRICT, strict=False)
def _overload_constant(x: Any, like: Any) -> Any:
    return _beside_dual if is_dual(like) else _to_kind


def seeded(values: Any, like: Any) -> Any:
    """``variables(values)`` with as many derivatives as the Dual ``like`` has, the last ones 0."""
    raise NotImplementedError


@overload(seeded, jit_options=STRICT, strict=False)
def _overload_seeded(values: Any, like: Any) -> Any:
    slopes = [
        ", ".join(f"same_kind({float(i == j)}, values[0])" for j in range(like.count))
        for i in range(values.count)
    ]
    duals = [f"Dual(values[{i}], ({slope},))" for i, slope in enumerate(slopes)]
    return written("seeded", "values, like", f"({', '.join(duals)},)", globals())


POSE_COORDINATES = 3


def roomy_variables(values: Any) -> Any:
    """``variables(values)`` with room for a pose's coordinates: at least three derivatives, the last ones 0.
    In compiled code."""
    raise NotImplementedError


@overload(roomy_variables, jit_options=STRICT, strict=False)
def _overload_roomy_variables(values: Any) -> Any:
    slots = range(max(POSE_COORDINATES, values.count))
    duals = [
        f"Dual(values[{i}], ({', '.join(f'same_kind({float(i == j)}, values[0])' for j in slots)},))"
        for i in range(values.count)
    ]
    return written("roomy_variables", "values", f"({', '.join(duals)},)", globals())


@register_jitable(**STRICT)
def replaced(triple: Any, position: int, value: Any) -> Any:
    """The triple with ``value`` at one position, the others lifted to its kind."""
    return (
        value if position == 0 else lifted(triple[0], value),
        value if position == 1 else lifted(triple[1], value),
        value if position == 2 else lifted(triple[2], value),
    )
