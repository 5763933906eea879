"""Determinants expanded by hand, for any kind of number."""

from __future__ import annotations

from typing import Any

from tpm_design.arithmetic import kernel_cache  # noqa: F401  (before Numba)

# isort: split
from numba.extending import register_jitable

from tpm_design.arithmetic.compilation import FAST


@register_jitable(**FAST)
def determinant(
    a11: Any, a12: Any, a13: Any, a21: Any, a22: Any, a23: Any, a31: Any, a32: Any, a33: Any
) -> Any:
    """Determinant of the 3 × 3 matrix with these rows."""
    return a11 * (a22 * a33 - a23 * a32) - a12 * (a21 * a33 - a23 * a31) + a13 * (a21 * a32 - a22 * a31)
