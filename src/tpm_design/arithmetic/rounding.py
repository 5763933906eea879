"""Whether this thread computes as the interval arithmetic takes for granted."""

from __future__ import annotations

import numpy as np

from tpm_design.errors import RefusedError

REMEDY = "Prove in a process of its own: another library in this one has changed the arithmetic."


def check_rounding() -> None:
    """Raises RefusedError where floats are not rounded to nearest or small ones become zero: libraries
    that are loaded into the same process may change that, and no bound would hold."""
    # arrays, so that nothing is computed before it runs
    one, half_ulp, smallest = np.array([1.0, 2.0**-53, 5e-324])
    nearest = (
        one + half_ulp == one
        and -one - half_ulp == -one
        and one + 1.5 * half_ulp > one
        and -one - 1.5 * half_ulp < -one
    )
    if not nearest:
        raise RefusedError(
            "Floating-point numbers are not rounded to nearest in this process.", remedy=REMEDY
        )
    if not (smallest > 0.0 and 2.0 * smallest > smallest):
        raise RefusedError("Very small floating-point numbers become zero in this process.", remedy=REMEDY)
