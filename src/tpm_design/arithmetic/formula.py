"""How a mechanism registers its equations: written once, compiled for the arguments they are given.

A formula is declared as a stub, an ordinary function ``stub(geometry, …)``, and implemented once per
mechanism, whose parameters are a ``NamedTuple`` class of its own::

    def reach(geometry, x, y, z):
        '''Reach margin (m).'''
        raise NotImplementedError

    @formula(reach, UruGeometry)
    def uru_reach(geometry, x, y, z):
        ...

Compiled code that calls ``reach`` gets the implementation of the geometry's class, specialised for floats,
intervals or duals: floats for speed, strictly by IEEE 754 as soon as any argument holds an interval.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from tpm_design.arithmetic.compilation import FAST, STRICT, keep_apart
from tpm_design.arithmetic.dual import is_dual
from tpm_design.arithmetic.interval import is_interval

# isort: split
from numba import types
from numba.extending import overload

Implementation = TypeVar("Implementation", bound=Callable[..., Any])

_implemented: dict[Callable[..., Any], set[type]] = {}


def involves_interval(kind: Any) -> bool:
    """Whether a Numba type is an interval or holds one, at any depth of tuples and duals."""
    if isinstance(kind, types.BaseTuple):
        members: Any = kind
        return any(involves_interval(member) for member in members)
    return is_interval(kind.element) if is_dual(kind) else is_interval(kind)


def formula(stub: Callable[..., Any], geometry_class: type) -> Callable[[Implementation], Implementation]:
    """Register the decorated function as ``stub`` for geometries of ``geometry_class`` (a NamedTuple class).

    The implementation has the stub's parameters, the geometry first. It is returned unchanged.
    """
    _implemented.setdefault(stub, set()).add(geometry_class)
    if stub.__module__.startswith("tpm_design."):
        keep_apart(geometry_class.__module__)
    return _registered(stub, lambda given: given is geometry_class)


def derived(stub: Callable[..., Any]) -> Callable[[Implementation], Implementation]:
    """Register the decorated function as ``stub`` for every geometry class that has no formula of its own."""
    return _registered(
        stub, lambda given: given is not None and given not in _implemented.setdefault(stub, set())
    )


def _registered(
    stub: Callable[..., Any], serves: Callable[[type | None], bool]
) -> Callable[[Implementation], Implementation]:
    parameters = list(inspect.signature(stub).parameters)

    def register(implementation: Implementation) -> Implementation:
        if list(inspect.signature(implementation).parameters) != parameters:
            raise TypeError(
                f"{implementation.__name__} must have the parameters of {stub.__name__}: {parameters}"
            )

        def select(strict: bool, arguments: tuple[Any, ...]) -> Implementation | None:
            if not serves(getattr(arguments[0], "instance_class", None)):
                return None
            return implementation if any(map(involves_interval, arguments)) == strict else None

        def for_floats(*arguments: Any) -> Implementation | None:
            return select(False, arguments)

        def for_intervals(*arguments: Any) -> Implementation | None:
            return select(True, arguments)

        overload(stub, jit_options=FAST, strict=False)(for_floats)
        overload(stub, jit_options=STRICT, strict=False)(for_intervals)
        return implementation

    return register
