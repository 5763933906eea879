"""What a parallelogram of rods holds: the platform does not turn about the normal of its plane."""

from __future__ import annotations

from typing import Any

from tpm_design.arithmetic import root, sqr
from tpm_design.arithmetic.algebra import determinant
from tpm_design.arithmetic.compilation import STRICT

# isort: split
from numba.extending import register_jitable


@register_jitable(**STRICT)
def _unit_normal(rod: Any, bar: Any) -> Any:
    x = rod[1] * bar[2] - rod[2] * bar[1]
    y = rod[2] * bar[0] - rod[0] * bar[2]
    z = rod[0] * bar[1] - rod[1] * bar[0]
    length = root(sqr(x) + sqr(y) + sqr(z))
    return x / length, y / length, z / length


@register_jitable(**STRICT)
def rotation_determinant(rods: Any, bars: Any) -> Any:
    """det of the unit normals n_i ∥ rod_i × bar_i, unit vectors along the rods and the short bars of three
    parallelograms: where it vanishes, the platform is free to turn."""
    a, b, c = _unit_normal(rods[0], bars[0]), _unit_normal(rods[1], bars[1]), _unit_normal(rods[2], bars[2])
    return determinant(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2])
