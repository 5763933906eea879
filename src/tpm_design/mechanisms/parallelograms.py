"""What a parallelogram of rods holds: the platform does not turn about the normal of its plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tpm_design.arithmetic import Interval, formula, root, sine, sqr
from tpm_design.arithmetic.algebra import determinant
from tpm_design.arithmetic.compilation import FAST, STRICT, is_number
from tpm_design.mechanisms import equations

# isort: split
from numba import types
from numba.extending import overload

# a sine that every angle is below
NO_LIMIT = 2.0


def unit_normal(rod: Any, bar: Any) -> Any:
    """Unit vector of rod × bar. In compiled code."""
    raise NotImplementedError


def _unit_normal(rod: Any, bar: Any) -> Any:
    x = rod[1] * bar[2] - rod[2] * bar[1]
    y = rod[2] * bar[0] - rod[0] * bar[2]
    z = rod[0] * bar[1] - rod[1] * bar[0]
    scale = 1.0 / root(sqr(x) + sqr(y) + sqr(z))
    return x * scale, y * scale, z * scale


def rotation_determinant(rods: Any, bars: Any) -> Any:
    """det of the unit normals n_i ∥ rod_i × bar_i, unit vectors along the rods and the short bars of three
    parallelograms: where it vanishes, the platform is free to turn. In compiled code."""
    raise NotImplementedError


def _rotation_determinant(rods: Any, bars: Any) -> Any:
    a, b, c = unit_normal(rods[0], bars[0]), unit_normal(rods[1], bars[1]), unit_normal(rods[2], bars[2])
    return determinant(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2])


def _numbers(kind: Any) -> bool:
    """Whether a Numba type is a plain number or a tuple of such, at any depth."""
    return all(map(_numbers, kind)) if isinstance(kind, types.BaseTuple) else is_number(kind)


def _register(stub: Any, implementation: Any) -> None:
    def for_floats(*arguments: Any) -> Any:
        return implementation if all(map(_numbers, arguments)) else None

    def for_others(*arguments: Any) -> Any:
        return None if all(map(_numbers, arguments)) else implementation

    overload(stub, jit_options=FAST, strict=False)(for_floats)
    overload(stub, jit_options=STRICT, strict=False)(for_others)


_register(unit_normal, _unit_normal)
_register(rotation_determinant, _rotation_determinant)


def _singularity_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """det of the unit rods, det of the unit normals of the parallelograms."""
    (a, b, c), _, _ = equations.unit_velocity_map(geometry, mode, 1.0, x, y, z)
    return (
        determinant(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]),
        rotation_determinant((a, b, c), geometry.hinge),
    )


def parallelogram_equations(geometry_class: type) -> None:
    """Register the singularities of rods in parallelograms for a geometry with ``hinge``, the unit vectors
    along their short bars."""
    formula(equations.singularity_margins, geometry_class)(_singularity_margins)


def outward_and_hinge(azimuths: Sequence[Any], zero: Any) -> tuple[Any, Any]:
    """ε_i and τ_i = ẑ × ε_i of all limbs from the cosines and sines of their azimuths."""
    return tuple((c, s, zero) for c, s in azimuths), tuple((-s, c, zero) for c, s in azimuths)


def swing_sine(swing: float | None) -> float:
    """Sine of the limit of the rods' swing (rad), None: more than any has."""
    return NO_LIMIT if swing is None else math.sin(swing)


def enclosed_swing_sine(swing: float | None) -> Interval:
    """The same as an Interval."""
    return Interval(NO_LIMIT, NO_LIMIT) if swing is None else sine(Interval(swing, swing))
