"""Determinants expanded by hand, for any kind of number."""

from __future__ import annotations

from typing import Any

from tpm_design.arithmetic.functions import scalar_function


def _expanded(
    a11: Any, a12: Any, a13: Any, a21: Any, a22: Any, a23: Any, a31: Any, a32: Any, a33: Any
) -> Any:
    return a11 * (a22 * a33 - a23 * a32) - a12 * (a21 * a33 - a23 * a31) + a13 * (a21 * a32 - a22 * a31)


@scalar_function(intervals=_expanded, duals=_expanded)
def determinant(
    a11: Any, a12: Any, a13: Any, a21: Any, a22: Any, a23: Any, a31: Any, a32: Any, a33: Any
) -> Any:
    """Determinant of the 3 × 3 matrix with these rows."""
    return a11 * (a22 * a33 - a23 * a32) - a12 * (a21 * a33 - a23 * a31) + a13 * (a21 * a32 - a22 * a31)
