"""Scalar fields over the pose space: everything whose least or greatest value over a region is asked."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import inner, kernel
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.pointwise import frobenius_row, least_margin
from tpm_design.mechanisms.velocity import (
    inverse_condition_2,
    inverse_condition_frobenius,
    output_transmission,
    singular_values,
)
from tpm_design.workspace.poses import workspace_margin

(
    REACH,
    LEGS,
    DETERMINANT,
    SINGULARITY,
    SERIAL,
    CONDITION_2,
    CONDITION_FROBENIUS,
    FASTEST,
    SLOWEST,
    TRANSMISSION,
    SENSITIVITY,
    CLEARANCE,
    ACTUATOR,
    EXTENT,
) = range(14)


class Index(NamedTuple):
    """Which field. ``part``: determinant, actuator or axis; ``motor``: 1 motors, 0
    joints; ``sign``: −1 turns the search for the least value into one for the greatest."""

    quantity: int
    part: int = 0
    motor: float = 1.0
    sign: float = 1.0


@inner
def determinant_at(geometry, mode, part, x, y, z):  # type: ignore[no-untyped-def]
    """One signed determinant."""
    return equations.singularity_margins(geometry, mode, x, y, z)[part]


@inner
def _velocity(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    return equations.velocity_map(geometry, mode, motor, x, y, z)


@inner
def condition_at(geometry, mode, frobenius, motor, x, y, z):  # type: ignore[no-untyped-def]
    """1/κ in the 2-norm or the Frobenius norm; 0 at every singularity and where undefined."""
    rows, b = _velocity(geometry, mode, motor, x, y, z)
    value = inverse_condition_frobenius(rows, b) if frobenius else inverse_condition_2(rows, b)
    return value if value == value else 0.0  # noqa: PLR0124


@inner
def _transmission(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    rows, _ = _velocity(geometry, mode, 0.0, x, y, z)
    entering = least_margin(equations.input_transmission(geometry, mode, x, y, z))
    return min(entering, output_transmission(_unit_rows(rows)))


@inner
def _unit_rows(rows):  # type: ignore[no-untyped-def]
    a, b, c = rows
    u = 1.0 / math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    v = 1.0 / math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
    w = 1.0 / math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
    return (
        (a[0] * u, a[1] * u, a[2] * u),
        (b[0] * v, b[1] * v, b[2] * v),
        (c[0] * w, c[1] * w, c[2] * w),
    )


@inner
def _sensitivity(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    """Greatest singular value of A⁻¹ diag(gains): the length errors' coefficients are orthogonal between
    limbs, so their Gram matrix is diagonal."""
    rows, _ = _velocity(geometry, mode, motor, x, y, z)
    gains = equations.length_error_gains(geometry, mode, x, y, z)
    return singular_values(rows, gains)[0]


@inner
def _clearance(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    return equations.limb_clearance(geometry, mode, x, y, z)


@inner
def _actuator(geometry, mode, motor, part, x, y, z):  # type: ignore[no-untyped-def]
    return equations.actuators(geometry, mode, motor, x, y, z)[part]


@inner
def _extent(geometry, mode, axis, sign, x, y, z):  # type: ignore[no-untyped-def]
    """Lowest (sign +1) or highest (sign −1) coordinate of all joint centres along an axis."""
    least = math.inf
    for chain in equations.joint_centres(geometry, mode, x, y, z):
        for centre in chain:
            least = min(least, sign * centre[axis])
    return sign * least


@inner
def index_value(geometry, mode, index, x, y, z):  # type: ignore[no-untyped-def]
    """sign · field at a pose; +inf where undefined, so that it never is the least."""
    quantity = index.quantity
    if quantity == REACH:
        value = workspace_margin(geometry, mode, x, y, z)
    elif quantity == LEGS:
        value = least_margin(equations.leg_margins(geometry, mode, x, y, z))
    elif quantity == DETERMINANT:
        value = determinant_at(geometry, mode, index.part, x, y, z)
    elif quantity == SINGULARITY:
        value = abs(determinant_at(geometry, mode, index.part, x, y, z))
    elif quantity == SERIAL:
        value = least_margin(equations.serial_margins(geometry, mode, x, y, z))
    elif quantity in (CONDITION_2, CONDITION_FROBENIUS):
        value = condition_at(geometry, mode, quantity == CONDITION_FROBENIUS, index.motor, x, y, z)
    elif quantity in (FASTEST, SLOWEST):
        rows, b = _velocity(geometry, mode, index.motor, x, y, z)
        greatest, least = singular_values(rows, b)
        value = greatest if quantity == FASTEST else least
    elif quantity == TRANSMISSION:
        value = _transmission(geometry, mode, x, y, z)
    elif quantity == SENSITIVITY:
        value = _sensitivity(geometry, mode, index.motor, x, y, z)
    elif quantity == CLEARANCE:
        value = _clearance(geometry, mode, x, y, z)
    elif quantity == ACTUATOR:
        value = _actuator(geometry, mode, index.motor, index.part, x, y, z)
    else:
        value = _extent(geometry, mode, index.part, index.sign, x, y, z)
    signed = index.sign * value
    return signed if signed == signed else math.inf  # noqa: PLR0124


@inner
def values_at(geometry, mode, index, points):  # type: ignore[no-untyped-def]
    """``index_value`` at poses (N, 3)."""
    out = np.empty(points.shape[0])
    if index.quantity == CONDITION_FROBENIUS:
        # vectorised
        x, y, z = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
        frobenius_row(geometry, mode, index.motor, x, y, z, out)
        for n in range(out.size):
            out[n] = index.sign * (out[n] if out[n] == out[n] else 0.0)
        return out
    for n in range(points.shape[0]):
        out[n] = index_value(geometry, mode, index, points[n, 0], points[n, 1], points[n, 2])
    return out


@kernel
def _index_values(geometry, mode, index, points):  # type: ignore[no-untyped-def]
    return values_at(geometry, mode, index, points)


def index_values(
    geometry: object, signs: object, index: Index, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """``index_value`` at poses (N, 3)."""
    return np.asarray(_index_values(geometry, signs, index, points))
