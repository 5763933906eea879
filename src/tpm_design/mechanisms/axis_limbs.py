"""Limbs that are driven along an axis and are free across it: a carriage and two links that turn about it.

With w_i = p + b_i − a_i0 from the base point to the platform joint, the carriage of limb i is at
a_i0 + S_i d_i, S_i = s_i·w_i / s_i·d_i, and two links f_i, r_i with all joint axes along s_i join it to the
platform joint, in the plane across s_i. Seen from the carriage, in that plane along unit vectors g_i, h_i,
the joint is at α_i = g_i'·w_i, β_i = h_i'·w_i with g_i' = g_i − (g_i·d_i / s_i·d_i) s_i, h_i' likewise. Where
the carriage moves along the axis, d_i = s_i, these are g_i and h_i themselves.

Source: X. Kong, C. M. Gosselin, Kinematics and Singularity Analysis of a Novel Type of 3-CRR 3-DOF
Translational Parallel Manipulator, Int. J. Robotics Research 21(9), 2002.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tpm_design.arithmetic import formula, magnitude, root, sqr
from tpm_design.arithmetic.lifting import replaced
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.two_link import distal_link

Triple = tuple[Any, ...]


class ElbowSigns(NamedTuple):
    """A working mode: on which side of the line from carriage to platform joint each elbow is, +1 or −1."""

    elbows: tuple[float, ...]


class LimbDirections(NamedTuple):
    """Per limb: ``axis`` s_i, ``slide`` d_i, ``advance`` s_i·d_i, unit vectors ``across`` g_i and ``beyond``
    h_i with g_i × h_i = s_i, and ``first_form`` g_i', ``second_form`` h_i'."""

    axis: tuple[Triple, ...]
    slide: tuple[Triple, ...]
    advance: Triple
    across: tuple[Triple, ...]
    beyond: tuple[Triple, ...]
    first_form: tuple[Triple, ...]
    second_form: tuple[Triple, ...]


class LimbLimits(NamedTuple):
    """``hole``: per limb 1.0 where |f − r| bounds its reach from within, else 0.0. ``…_limited``: 1.0 where
    the bounds that follow count. ``folded``, ``stretched``: 1 − cos of the least and the greatest angle
    between the links."""

    hole: tuple[float, ...]
    stroke_limited: float
    lowest: float
    highest: float
    folded_limited: float
    folded: Any
    stretched_limited: float
    stretched: Any


class AxisLimbGeometry(NamedTuple):
    """Per limb: lengths of the links, coordinates of a_i0 − b_i, which is all that its motion knows of both
    points, and the platform point b_i (m)."""

    first: Triple
    second: Triple
    offset_x: Triple
    offset_y: Triple
    offset_z: Triple
    platform: tuple[Triple, ...]
    directions: LimbDirections
    limits: LimbLimits
    link_radius: float


def limb_offset(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """w of one limb, see the implementation."""
    raise NotImplementedError


def limb_point(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """α, β and ρ² of one limb, see the implementation."""
    raise NotImplementedError


def limb_reach(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """Outer and inner margin of one limb (m), see the implementation."""
    raise NotImplementedError


def limb_sides(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """Margins of the limits of one limb (m), see the implementation."""
    raise NotImplementedError


def limb_bend(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """|sin| of the angle between the links of one limb, see the implementation."""
    raise NotImplementedError


def axis_row(geometry, limb, x):  # type: ignore[no-untyped-def]
    """s_i, of the kind of number that the pose is, see the implementation."""
    raise NotImplementedError


def _limb_offset(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    return x - geometry.offset_x[limb], y - geometry.offset_y[limb], z - geometry.offset_z[limb]


def _limb_point(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    wx, wy, wz = limb_offset(geometry, limb, x, y, z)
    gx, gy, gz = geometry.directions.first_form[limb]
    hx, hy, hz = geometry.directions.second_form[limb]
    alpha = gx * wx + gy * wy + gz * wz
    beta = hx * wx + hy * wy + hz * wz
    return alpha, beta, sqr(alpha) + sqr(beta)


def _limb_actuator(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """S_i (m), equation (2) of the source: either elbow is above the same carriage."""
    wx, wy, wz = limb_offset(geometry, limb, x, y, z)
    sx, sy, sz = geometry.directions.axis[limb]
    return (sx * wx + sy * wy + sz * wz) / geometry.directions.advance[limb]


def _limb_reach(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """f + r − ρ and ρ − |f − r|, times |s·d|: ρ changes by at most 1/|s·d| of the way of the pose."""
    _, _, square = limb_point(geometry, limb, x, y, z)
    rho = root(square)
    f, r = geometry.first[limb], geometry.second[limb]
    share = magnitude(geometry.directions.advance[limb])
    outer = share * (f + r - rho)
    if geometry.limits.hole[limb] == 0.0:
        return outer, outer
    return outer, share * (rho - magnitude(f - r))


def _limb_sides(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """Both ends of the stroke; ρ against its values at the limits of the angle E between the links, by
    ρ² = (f − r)² + 2 f r (1 − cos E)."""
    limits = geometry.limits
    # a metre to spare where there is no limit
    spare = 1.0 + 0.0 * x
    above, below, bent, straight = spare, spare, spare, spare
    if limits.stroke_limited != 0.0:
        stroke = equations.limb_actuator(geometry, limb, 1.0, x, y, z)
        above, below = stroke - limits.lowest, limits.highest - stroke
    _, _, square = limb_point(geometry, limb, x, y, z)
    f, r = geometry.first[limb], geometry.second[limb]
    hole, product = sqr(f - r), 2.0 * (f * r)
    if limits.folded_limited != 0.0:
        bent = root(square) - root(hole + product * limits.folded)
    if limits.stretched_limited != 0.0:
        straight = root(hole + product * limits.stretched) - root(square)
    return above, below, bent, straight


def _limb_bend(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """√(1 − cos²), cos = (ρ² − f² − r²)/(2 f r)."""
    _, _, square = limb_point(geometry, limb, x, y, z)
    f, r = geometry.first[limb], geometry.second[limb]
    return root(1.0 - sqr((square - (sqr(f) + sqr(r))) / (2.0 * (f * r))))


def _limb_joints(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """a + S d, p + b − r (a g + c h) and p + b, with (a, c) the direction of the second link."""
    alpha, beta, square = limb_point(geometry, limb, x, y, z)
    r = geometry.second[limb]
    a, c, _ = distal_link(alpha, beta, square, geometry.first[limb], r, sign)
    stroke = equations.limb_actuator(geometry, limb, sign, x, y, z)
    dx, dy, dz = geometry.directions.slide[limb]
    gx, gy, gz = geometry.directions.across[limb]
    hx, hy, hz = geometry.directions.beyond[limb]
    bx, by, bz = geometry.platform[limb]
    px, py, pz = x + bx, y + by, z + bz
    return (
        (
            geometry.offset_x[limb] + bx + stroke * dx,
            geometry.offset_y[limb] + by + stroke * dy,
            geometry.offset_z[limb] + bz + stroke * dz,
        ),
        (px - r * (a * gx + c * hx), py - r * (a * gy + c * hy), pz - r * (a * gz + c * hz)),
        (px, py, pz),
    )


def _axis_row(geometry, limb, x):  # type: ignore[no-untyped-def]
    sx, sy, sz = geometry.directions.axis[limb]
    nothing = 0.0 * x
    return sx + nothing, sy + nothing, sz + nothing


def _leg_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Section 8.1 of the source: two concentric cylinders for each limb."""
    outer1, inner1 = limb_reach(geometry, 0, x, y, z)
    outer2, inner2 = limb_reach(geometry, 1, x, y, z)
    outer3, inner3 = limb_reach(geometry, 2, x, y, z)
    return outer1, inner1, outer2, inner2, outer3, inner3


def _mode_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Limits of strokes and elbows; both elbows of a limb reach the same."""
    return (
        limb_sides(geometry, 0, x, y, z) + limb_sides(geometry, 1, x, y, z) + limb_sides(geometry, 2, x, y, z)
    )


def _unit_velocity_map(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    """s_i · ẋ = (s_i · d_i) Ṡ_i, equation (3) of the source: constant."""
    nothing = 0.0 * x
    a, b, c = geometry.directions.advance
    return (
        (axis_row(geometry, 0, x), axis_row(geometry, 1, x), axis_row(geometry, 2, x)),
        (a + nothing, b + nothing, c + nothing),
        (1.0, 1.0, 1.0),
    )


def _serial_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Section 6.1 of the source: a limb stretched or folded."""
    return (
        limb_bend(geometry, 0, x, y, z),
        limb_bend(geometry, 1, x, y, z),
        limb_bend(geometry, 2, x, y, z),
    )


def _input_transmission(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """|s_i · d_i|: the carriage drives the limb along its axis, in whatever pose."""
    _, (a, b, c), _ = equations.unit_velocity_map(geometry, mode, 1.0, x, y, z)
    return magnitude(a), magnitude(b), magnitude(c)


def _length_error_gains(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Carriages locked: s_i · dx = s_i · (da_i − db_i), for errors of base and platform points by
    themselves; the links' lengths do not matter."""
    gain = math.sqrt(2.0) + 0.0 * x
    return gain, gain, gain


def _limb_parameters(geometry, limb):  # type: ignore[no-untyped-def]
    """f, r, and the coordinates of a − b."""
    return (
        geometry.first[limb],
        geometry.second[limb],
        geometry.offset_x[limb],
        geometry.offset_y[limb],
        geometry.offset_z[limb],
    )


def axis_limb_equations(geometry_class: type) -> None:
    """Register what all mechanisms of this kind have in common for a geometry that has what
    ``AxisLimbGeometry`` has. It gives ``with_limb_parameters`` itself."""
    formula(limb_offset, geometry_class)(_limb_offset)
    formula(limb_point, geometry_class)(_limb_point)
    formula(equations.limb_actuator, geometry_class)(_limb_actuator)
    formula(limb_reach, geometry_class)(_limb_reach)
    formula(limb_sides, geometry_class)(_limb_sides)
    formula(limb_bend, geometry_class)(_limb_bend)
    formula(equations.limb_joints, geometry_class)(_limb_joints)
    formula(axis_row, geometry_class)(_axis_row)
    formula(equations.leg_margins, geometry_class)(_leg_margins)
    formula(equations.mode_margins, geometry_class)(_mode_margins)
    formula(equations.unit_velocity_map, geometry_class)(_unit_velocity_map)
    formula(equations.serial_margins, geometry_class)(_serial_margins)
    formula(equations.input_transmission, geometry_class)(_input_transmission)
    formula(equations.length_error_gains, geometry_class)(_length_error_gains)
    formula(equations.limb_parameters, geometry_class)(_limb_parameters)


axis_limb_equations(AxisLimbGeometry)


@formula(equations.with_limb_parameters, AxisLimbGeometry)
def _with_limb_parameters(geometry, limb, values):  # type: ignore[no-untyped-def]
    """f, r, and a − b of one limb replaced."""
    return AxisLimbGeometry(
        replaced(geometry.first, limb, values[0]),
        replaced(geometry.second, limb, values[1]),
        replaced(geometry.offset_x, limb, values[2]),
        replaced(geometry.offset_y, limb, values[3]),
        replaced(geometry.offset_z, limb, values[4]),
        geometry.platform,
        geometry.directions,
        geometry.limits,
        geometry.link_radius,
    )
