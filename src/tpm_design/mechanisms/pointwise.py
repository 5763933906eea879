"""Compiled loops over arrays of poses. Arrays x, y, z are (N,) in metres."""

from __future__ import annotations

import math

import numpy as np

from tpm_design.arithmetic import fast_kernel, inner, kernel, short_kernel
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.velocity import inverse_condition_frobenius, jacobian


@inner
def rows_of(points):  # type: ignore[no-untyped-def]
    """x, y, z (N,) of poses (N, 3), each contiguous."""
    count = points.shape[0]
    x, y, z = np.empty(count), np.empty(count), np.empty(count)
    for n in range(count):
        x[n], y[n], z[n] = points[n, 0], points[n, 1], points[n, 2]
    return x, y, z


@fast_kernel
def reach_row(geometry, mode, x, y, z, legs, side):  # type: ignore[no-untyped-def]
    """Least leg margin and least mode margin (N,), written in place."""
    for n in range(x.size):
        leg_margins = equations.leg_margins(geometry, mode, x[n], y[n], z[n])
        least = leg_margins[0]
        for margin in leg_margins:
            least = min(least, margin)
        legs[n] = least
    # a loop of its own: what does not depend on the pose in these margins is then decided once
    for n in range(x.size):
        mode_margins = equations.mode_margins(geometry, mode, x[n], y[n], z[n])
        least = mode_margins[0]
        for margin in mode_margins:
            least = min(least, margin)
        side[n] = least


@fast_kernel
def singularity_row(geometry, mode, x, y, z, determinants):  # type: ignore[no-untyped-def]
    """Signed determinants (D, N), written in place."""
    for n in range(x.size):
        values = equations.singularity_margins(geometry, mode, x[n], y[n], z[n])
        for k in range(len(values)):
            determinants[k, n] = values[k]


@short_kernel
def determinant_table(geometry, mode, points):  # type: ignore[no-untyped-def]
    """Signed determinants (D, N) at poses (N, 3), 0 where undefined."""
    x, y, z = rows_of(points)
    count = len(equations.singularity_margins(geometry, mode, 0.0, 0.0, 0.0))
    out = np.empty((count, x.size))
    singularity_row(geometry, mode, x, y, z, out)
    for k in range(count):
        for n in range(x.size):
            if math.isnan(out[k, n]):
                out[k, n] = 0.0
    return out


@short_kernel
def kept_sides(determinants):  # type: ignore[no-untyped-def]
    """Of each row (D, N) the side, ±1, of its least and its greatest value together."""
    sides = np.empty(determinants.shape[0])
    for k in range(sides.size):
        least, greatest = math.inf, -math.inf
        for value in determinants[k]:
            least, greatest = min(least, value), max(greatest, value)
        sides[k] = 1.0 if least + greatest >= 0.0 else -1.0
    return sides


@fast_kernel
def margins_row(geometry, mode, x, y, z, legs, side, determinants):  # type: ignore[no-untyped-def]
    """``reach_row`` and ``singularity_row`` in one go."""
    for n in range(x.size):
        # nothing is written before all is computed: what the equations have in common is then computed once
        px, py, pz = x[n], y[n], z[n]
        leg_margins = equations.leg_margins(geometry, mode, px, py, pz)
        mode_margins = equations.mode_margins(geometry, mode, px, py, pz)
        values = equations.singularity_margins(geometry, mode, px, py, pz)
        least = leg_margins[0]
        for margin in leg_margins:
            least = min(least, margin)
        legs[n] = least
        least = mode_margins[0]
        for margin in mode_margins:
            least = min(least, margin)
        side[n] = least
        for k in range(len(values)):
            determinants[k, n] = values[k]


@kernel
def frobenius_row(geometry, mode, motor, x, y, z, out):  # type: ignore[no-untyped-def]
    """1/κ_F (N,), written in place; NaN where undefined."""
    for n in range(x.size):
        rows, b = equations.velocity_map(geometry, mode, motor, x[n], y[n], z[n])
        out[n] = inverse_condition_frobenius(rows, b)


@inner
def least_margin(margins):  # type: ignore[no-untyped-def]
    """Least of a tuple of margins; NaN counts as −inf, so that an undefined pose is outside."""
    least = math.inf
    for margin in margins:
        least = min(least, margin) if margin == margin else -math.inf  # noqa: PLR0124
    return least


@kernel
def serial_row(geometry, mode, x, y, z, out):  # type: ignore[no-untyped-def]
    """Least serial margin (N,), written in place."""
    for n in range(x.size):
        out[n] = least_margin(equations.serial_margins(geometry, mode, x[n], y[n], z[n]))


@kernel
def actuators_row(geometry, mode, motor, x, y, z, out):  # type: ignore[no-untyped-def]
    """Actuator coordinates (N, 3), written in place."""
    for n in range(x.size):
        values = equations.actuators(geometry, mode, motor, x[n], y[n], z[n])
        for k in range(3):
            out[n, k] = values[k]


@kernel
def jacobian_row(geometry, mode, motor, x, y, z, out):  # type: ignore[no-untyped-def]
    """J (N, 3, 3), written in place."""
    for n in range(x.size):
        rows, b = equations.velocity_map(geometry, mode, motor, x[n], y[n], z[n])
        values = jacobian(rows, b)
        for i in range(3):
            for j in range(3):
                out[n, i, j] = values[i][j]


@kernel
def centres_at(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Joint centres at one pose, nested tuples as the mechanism gives them."""
    return equations.joint_centres(geometry, mode, x, y, z)


def columns(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y, z of an (N, 3) array, contiguous."""
    table = np.ascontiguousarray(np.asarray(points, dtype=np.float64).reshape(-1, 3).T)
    return table[0], table[1], table[2]
