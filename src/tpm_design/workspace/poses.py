"""What one pose is: inside the mode's workspace or not, and on which side of every singularity."""

from __future__ import annotations

import math

from tpm_design.arithmetic import inner, kernel
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.pointwise import least_margin


@inner
def workspace_margin(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Metres, ≥ 0 where the pose is reachable in the mode."""
    legs = least_margin(equations.leg_margins(geometry, mode, x, y, z))
    return min(legs, least_margin(equations.mode_margins(geometry, mode, x, y, z)))


@inner
def side_code(geometry, mode, floor, x, y, z):  # type: ignore[no-untyped-def]
    """0 where a determinant's margin is not above ``floor``, else 1 + one bit per positive determinant."""
    code = 1
    bit = 1
    for value in equations.singularity_margins(geometry, mode, x, y, z):
        if value > floor:
            code += bit
        elif not value < -floor:
            return 0
        bit *= 2
    return code


@kernel
def aspect_code(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """``side_code`` of a reachable pose, 0 of any other."""
    if workspace_margin(geometry, mode, x, y, z) < 0.0:
        return 0
    return side_code(geometry, mode, 0.0, x, y, z)


@inner
def side_margin(geometry, mode, code, floor, x, y, z):  # type: ignore[no-untyped-def]
    """≥ 0 where every determinant has the sign ``code`` (> 0) says, beyond ``floor``."""
    least = math.inf
    bits = code - 1
    for value in equations.singularity_margins(geometry, mode, x, y, z):
        signed = value if bits % 2 == 1 else -value
        bits //= 2
        least = min(least, signed - floor) if signed == signed else -math.inf  # noqa: PLR0124
    return least
