"""LaMaViP 3-URU: three universal–revolute–universal limbs, motors on the base.

Source: R. Di Gregorio, "A Novel 3-URU Architecture with Actuators on the Base: Kinematics and
Singularity Analysis", Robotics 9(3), 60, 2020. Equation numbers in brackets are that paper's; eq. (34)
is used with its indices corrected.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike

from tpm_design.arithmetic import (
    Interval,
    arctangent2,
    cosine,
    direction,
    direction_cosine,
    formula,
    lesser,
    magnitude,
    root,
    sine,
    sqr,
)
from tpm_design.arithmetic.algebra import determinant
from tpm_design.arithmetic.compilation import STRICT
from tpm_design.arithmetic.lifting import constant, replaced
from tpm_design.mechanisms import equations, forward
from tpm_design.mechanisms.angles import NEXT_AXIS
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.base import Drawing, Limit, MechanismKind, ModeField, Parameter, Singularity
from tpm_design.mechanisms.joint_limits import enclosed_range, joint_range, range_numbers
from tpm_design.mechanisms.mechanism import FloatArray, Mechanism, Mode
from tpm_design.mechanisms.outer_reach import Affine, OuterReach, Ranges, ReachCone, Values
from tpm_design.mechanisms.parameters import enclosed_values, limb_values, span, three_numbers
from tpm_design.mechanisms.symmetry import IDENTITY, SignedPermutation, mode_orbits, symmetries
from tpm_design.mechanisms.two_link import distal_link

Triple = tuple[float, ...]
Quadruple = tuple[float, ...]


class UruGeometry(NamedTuple):
    """Dimensions of the three limbs (m; gear ratios dimensionless) and the limits of their joints.

    ``limit_cosine``, ``limit_sine``: middle of the range of joints θ_i1 … θ_i4, ``limit_bound``: cosine of
    its half width, so that a joint is inside its range where cos(θ − middle) ≥ bound.
    """

    base: Triple
    platform: Triple
    proximal: Triple
    distal: Triple
    gear: Triple
    limited: float
    limit_cosine: Quadruple
    limit_sine: Quadruple
    limit_bound: Quadruple
    link_radius: float


class UruSigns(NamedTuple):
    """A working mode: sides of the coordinate planes (0: any) and elbows, each +1 or −1."""

    octant: Triple
    elbows: Triple


def limb_chain(geometry, limb, elbow, p, pj, pk):  # type: ignore[no-untyped-def]
    """Planar chain of one limb in its plane (e_i, h_i), see the implementation for what it returns."""
    raise NotImplementedError


@formula(limb_chain, UruGeometry)
def _limb_chain(geometry, limb, elbow, p, pj, pk):  # type: ignore[no-untyped-def]
    """(a, c, γ, β, ρ², α): v_i = a e_i + c h_i (unit), γ_i = f_i sin θ_i3, inverse position (A1)–(A2)
    without inverse trigonometry."""
    f = geometry.proximal[limb]
    r = geometry.distal[limb]
    alpha = p + (geometry.platform[limb] - geometry.base[limb])
    beta_squared = sqr(pj) + sqr(pk)
    beta = root(beta_squared)
    rho_squared = sqr(alpha) + beta_squared
    a, c, gamma = distal_link(alpha, beta, rho_squared, f, r, elbow)
    return a, c, gamma, beta, rho_squared, alpha


def limb_margins(geometry, limb, p, pj, pk):  # type: ignore[no-untyped-def]
    """Leg space (29) of one limb in metres, see the implementation."""
    raise NotImplementedError


@formula(limb_margins, UruGeometry)
def _limb_margins(geometry, limb, p, pj, pk):  # type: ignore[no-untyped-def]
    """(f_i + r_i − ρ_i, ρ_i − |f_i − r_i|)."""
    f = geometry.proximal[limb]
    r = geometry.distal[limb]
    alpha = p + (geometry.platform[limb] - geometry.base[limb])
    rho = root(sqr(alpha) + (sqr(pj) + sqr(pk)))
    return f + r - rho, rho - magnitude(f - r)


@formula(equations.leg_margins, UruGeometry)
def _leg_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """(29), outer and inner bound of each limb."""
    outer1, inner1 = limb_margins(geometry, 0, x, y, z)
    outer2, inner2 = limb_margins(geometry, 1, y, z, x)
    outer3, inner3 = limb_margins(geometry, 2, z, x, y)
    return outer1, inner1, outer2, inner2, outer3, inner3


def limit_margin(geometry, joint, cosine, sine):  # type: ignore[no-untyped-def]
    """Signed distance to the limits of one joint, see the implementation."""
    raise NotImplementedError


@formula(limit_margin, UruGeometry)
def _limit_margin(geometry, joint, cosine, sine):  # type: ignore[no-untyped-def]
    """cos(θ − middle) − cos(half width), ≥ 0 inside the joint's range."""
    return (
        cosine * geometry.limit_cosine[joint]
        + sine * geometry.limit_sine[joint]
        - geometry.limit_bound[joint]
    )


def limb_limit_margin(geometry, limb, elbow, p, pj, pk, cosine_first, sine_first):  # type: ignore[no-untyped-def]
    """Joint limits of one limb in metres, see the implementation."""
    raise NotImplementedError


@formula(limb_limit_margin, UruGeometry)
def _limb_limit_margin(geometry, limb, elbow, p, pj, pk, cosine_first, sine_first):  # type: ignore[no-untyped-def]
    """Least limit margin of θ_i1 … θ_i4 times f_i; θ_i4 = −(θ_i2 + θ_i3) keeps the platform parallel."""
    a, c, gamma, beta, rho_squared, alpha = limb_chain(geometry, limb, elbow, p, pj, pk)
    f = geometry.proximal[limb]
    r = geometry.distal[limb]
    first = limit_margin(geometry, 0, cosine_first, sine_first)
    second = limit_margin(geometry, 1, (alpha - r * a) / f, (beta - r * c) / f)
    third = limit_margin(geometry, 2, (rho_squared - sqr(f) - sqr(r)) / (2.0 * f * r), gamma / f)
    fourth = limit_margin(geometry, 3, a, -c)
    return f * lesser(lesser(first, second), lesser(third, fourth))


def octant_margin(geometry, sign, coordinate):  # type: ignore[no-untyped-def]
    """Signed distance to a coordinate plane, see the implementation."""
    raise NotImplementedError


@formula(octant_margin, UruGeometry)
def _octant_margin(geometry, sign, coordinate):  # type: ignore[no-untyped-def]
    """Positive on the octant's side; 1 m everywhere for sign 0, any side."""
    return sign * coordinate + (1.0 - sign * sign)


@formula(equations.mode_margins, UruGeometry)
def _mode_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Signed distance to each plane of the octant, then the joint limits of each limb."""
    side1 = octant_margin(geometry, mode.octant[0], x)
    side2 = octant_margin(geometry, mode.octant[1], y)
    side3 = octant_margin(geometry, mode.octant[2], z)
    if geometry.limited == 0.0:
        return side1, side2, side3, side1, side2, side3
    k1, k2, k3 = mode.elbows
    # g_i = cos θ_i1 · … + sin θ_i1 · …: the paper's phase references differ from limb to limb
    limb1 = limb_limit_margin(geometry, 0, k1, x, y, z, -direction_cosine(z, y), direction_cosine(y, z))
    limb2 = limb_limit_margin(geometry, 1, k2, y, z, x, -direction_cosine(z, x), -direction_cosine(x, z))
    limb3 = limb_limit_margin(geometry, 2, k3, z, x, y, -direction_cosine(y, x), direction_cosine(x, y))
    return side1, side2, side3, limb1, limb2, limb3


def limb_rows(geometry, limb, elbow, p, pj, pk):  # type: ignore[no-untyped-def]
    """Unit rows of V and W of one limb along e_i, e_j, e_k, see the implementation."""
    raise NotImplementedError


@formula(limb_rows, UruGeometry)
def _limb_rows(geometry, limb, elbow, p, pj, pk):  # type: ignore[no-untyped-def]
    """v_i, w_i/|w_i| and h_i's component along e_j. With w_i = v_i + (k_i γ_i/β_i) g_i and g_i ⟂ v_i the unit
    row is cos ψ v_i + sin ψ g_i, tan ψ = k_i γ_i/β_i: no pole on the axis e_i."""
    a, c, gamma, beta, _, _ = limb_chain(geometry, limb, elbow, p, pj, pk)
    hj, hk = direction(pj, pk)
    toward, across = direction(beta, geometry.gear[limb] * gamma)
    v = (a, c * hj, c * hk)
    w = (toward * v[0], toward * v[1] - across * hk, toward * v[2] + across * hj)
    return v, w, hj


@formula(equations.singularity_margins, UruGeometry)
def _singularity_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """det V (20), det W/∏|w_i| (36), det H (17)."""
    k1, k2, k3 = mode.elbows
    (v11, v12, v13), (w11, w12, w13), h12 = limb_rows(geometry, 0, k1, x, y, z)
    (v22, v23, v21), (w22, w23, w21), h23 = limb_rows(geometry, 1, k2, y, z, x)
    (v33, v31, v32), (w33, w31, w32), h31 = limb_rows(geometry, 2, k3, z, x, y)
    translation = determinant(v11, v12, v13, v21, v22, v23, v31, v32, v33)
    actuation = determinant(w11, w12, w13, w21, w22, w23, w31, w32, w33)
    return translation, actuation, 2.0 * h12 * h23 * h31


@formula(equations.serial_margins, UruGeometry)
def _serial_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """|sin θ_i3| (27)."""
    k1, k2, k3 = mode.elbows
    _, _, gamma1, _, _, _ = limb_chain(geometry, 0, k1, x, y, z)
    _, _, gamma2, _, _, _ = limb_chain(geometry, 1, k2, y, z, x)
    _, _, gamma3, _, _, _ = limb_chain(geometry, 2, k3, z, x, y)
    f1, f2, f3 = geometry.proximal
    return magnitude(gamma1 / f1), magnitude(gamma2 / f2), magnitude(gamma3 / f3)


def limb_velocity(geometry, limb, elbow, motor, p, pj, pk):  # type: ignore[no-untyped-def]
    """Row of A along e_i, e_j, e_k and entry of b of one limb, see the implementation."""
    raise NotImplementedError


@formula(limb_velocity, UruGeometry)
def _limb_velocity(geometry, limb, elbow, motor, p, pj, pk):  # type: ignore[no-untyped-def]
    """Joints: v_i and γ_i (18). Motors: w_i = v_i + (k_i γ_i/β_i) g_i and k_i γ_i (19)."""
    a, c, gamma, beta, _, _ = limb_chain(geometry, limb, elbow, p, pj, pk)
    hj, hk = direction(pj, pk)
    gear = geometry.gear[limb]
    swing = (motor * gear) * gamma / beta
    row = (a, c * hj - swing * hk, c * hk + swing * hj)
    return row, (1.0 + motor * (gear - 1.0)) * gamma


@formula(equations.velocity_map, UruGeometry)
def _velocity_map(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    """V ṗ = diag(γ) θ̇_2 (18), W ṗ = diag(k γ) θ̇_M (19)."""
    k1, k2, k3 = mode.elbows
    (a11, a12, a13), b1 = limb_velocity(geometry, 0, k1, motor, x, y, z)
    (a22, a23, a21), b2 = limb_velocity(geometry, 1, k2, motor, y, z, x)
    (a33, a31, a32), b3 = limb_velocity(geometry, 2, k3, motor, z, x, y)
    return ((a11, a12, a13), (a21, a22, a23), (a31, a32, a33)), (b1, b2, b3)


def limb_unit_velocity(geometry, limb, elbow, motor, p, pj, pk):  # type: ignore[no-untyped-def]
    """Unit row along e_i, e_j, e_k, entry of b, and factor of one limb, see the implementation."""
    raise NotImplementedError


@formula(limb_unit_velocity, UruGeometry)
def _limb_unit_velocity(geometry, limb, elbow, motor, p, pj, pk):  # type: ignore[no-untyped-def]
    """cos ψ v_i + sin ψ g_i and k_i γ_i cos ψ, with tan ψ = k_i γ_i/β_i for motors and 0 for joints."""
    a, c, gamma, beta, _, _ = limb_chain(geometry, limb, elbow, p, pj, pk)
    hj, hk = direction(pj, pk)
    toward, across = direction(beta, (motor * geometry.gear[limb]) * gamma)
    row = (toward * a, toward * (c * hj) - across * hk, toward * (c * hk) + across * hj)
    # lever · cos ψ = β sin ψ keeps its digits where the lever is long
    entry = motor * (beta * across) + (1.0 - motor) * gamma
    return row, entry, toward


@formula(equations.unit_velocity_map, UruGeometry)
def _unit_velocity_map(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    """(18) as it is, (19) with each row divided by |w_i|."""
    k1, k2, k3 = mode.elbows
    (a11, a12, a13), b1, u1 = limb_unit_velocity(geometry, 0, k1, motor, x, y, z)
    (a22, a23, a21), b2, u2 = limb_unit_velocity(geometry, 1, k2, motor, y, z, x)
    (a33, a31, a32), b3, u3 = limb_unit_velocity(geometry, 2, k3, motor, z, x, y)
    return ((a11, a12, a13), (a21, a22, a23), (a31, a32, a33)), (b1, b2, b3), (u1, u2, u3)


def limb_angles(geometry, limb, elbow, p, pj, pk):  # type: ignore[no-untyped-def]
    """θ_i2, θ_i3 and θ_i4 of one limb (rad), see the implementation."""
    raise NotImplementedError


@formula(limb_angles, UruGeometry)
def _limb_angles(geometry, limb, elbow, p, pj, pk):  # type: ignore[no-untyped-def]
    """(A1)–(A2): θ_i2 unwrapped in (−π, 2π), θ_i3 = ∓ the angle at the elbow, θ_i4 = −(θ_i2 + θ_i3)."""
    f = geometry.proximal[limb]
    r = geometry.distal[limb]
    alpha = p + (geometry.platform[limb] - geometry.base[limb])
    beta_squared = pj * pj + pk * pk
    rho_squared = alpha * alpha + beta_squared
    if rho_squared == 0.0:
        return math.nan, math.nan, math.nan
    at_base = (rho_squared + f * f - r * r) / (2.0 * f * math.sqrt(rho_squared))
    at_elbow = (rho_squared - f * f - r * r) / (2.0 * f * r)
    second = math.atan2(math.sqrt(beta_squared), alpha) + elbow * math.acos(min(1.0, max(-1.0, at_base)))
    third = -elbow * math.acos(min(1.0, max(-1.0, at_elbow)))
    return second, third, -(second + third)


def joint_angles(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Joint angles of all limbs (rad), see the implementation."""
    raise NotImplementedError


@formula(joint_angles, UruGeometry)
def _joint_angles(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """θ_i1 … θ_i5 of each limb; θ_i5 = −θ_i1 keeps the platform parallel."""
    k1, k2, k3 = mode.elbows
    first1 = math.atan2(y, -z) if y != 0.0 or z != 0.0 else math.nan
    first2 = math.atan2(-x, -z) if z != 0.0 or x != 0.0 else math.nan
    first3 = math.atan2(x, -y) if x != 0.0 or y != 0.0 else math.nan
    second1, third1, fourth1 = limb_angles(geometry, 0, k1, x, y, z)
    second2, third2, fourth2 = limb_angles(geometry, 1, k2, y, z, x)
    second3, third3, fourth3 = limb_angles(geometry, 2, k3, z, x, y)
    return (
        (first1, second1, third1, fourth1, -first1),
        (first2, second2, third2, fourth2, -first2),
        (first3, second3, third3, fourth3, -first3),
    )


@formula(equations.actuators, UruGeometry)
def _actuators(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    """Joints: θ_i2. Motors: θ_iM = θ_i2/k_i + θ_i1 (11), the encoder's zero taken as 0."""
    limb1, limb2, limb3 = joint_angles(geometry, mode, x, y, z)
    if motor == 0.0:
        return limb1[1], limb2[1], limb3[1]
    k1, k2, k3 = geometry.gear
    return limb1[1] / k1 + limb1[0], limb2[1] / k2 + limb2[0], limb3[1] / k3 + limb3[0]


def limb_closure(geometry, limb, motor, q, size, first, d, dj, dk):  # type: ignore[no-untyped-def]
    """Loop closure of one limb, see the implementation."""
    raise NotImplementedError


@formula(limb_closure, UruGeometry)
def _limb_closure(geometry, limb, motor, q, size, first, d, dj, dk):  # type: ignore[no-untyped-def]
    """(α_i − f_i cos θ_i2)² + (β_i − f_i sin θ_i2)² − r_i² at the pose size · (d, dj, dk), with θ_i2 the
    actuator itself or, driven by the motors, k_i (θ_iM − θ_i1) (11); and how far that θ_i2 is outside
    (−π, 2π), where no pose has it."""
    f = geometry.proximal[limb]
    r = geometry.distal[limb]
    centred = geometry.platform[limb] == geometry.base[limb] and f == r
    # enclosed: a sum of two lengths is rounded
    f, r = constant(f, size), constant(r, size)
    offset = constant(geometry.platform[limb], size) - geometry.base[limb]
    across = root(sqr(dj) + sqr(dk))
    second = (motor * constant(geometry.gear[limb], size)) * (q - first) + (1.0 - motor) * q
    excess = magnitude(second - 0.5 * math.pi) - 1.5 * math.pi
    if centred:
        # closed at the origin for every θ_i2: that factor is divided out
        plain = size * (sqr(d) + sqr(across)) - 2.0 * f * (d * cosine(second) + across * sine(second))
        return plain, excess
    along = size * d + offset - f * cosine(second)
    return sqr(along) + sqr(size * across - f * sine(second)) - sqr(r), excess


@register_jitable(**STRICT)
def chart_direction(chart, v, w):  # type: ignore[no-untyped-def]
    """Point of the cube's face ``chart``: which coordinate is the largest, 0, 1 or 2, and its sign. The
    others are v, w of either sign."""
    axis, side = chart
    one = 0.0 * v + side
    if axis == 0.0:
        return one, v, w
    if axis == 1.0:
        return w, one, v
    return v, w, one


@formula(equations.closure, UruGeometry)
def _closure(geometry, motor, q, chart, u, v, w):  # type: ignore[no-untyped-def]
    """The pose is u times a point of the unit cube's surface: θ_i1 depends on that point alone, so that the
    bounds do not degrade towards the origin. v and w keep their signs: θ_i1 then stays in its quadrant."""
    dx, dy, dz = chart_direction(chart, v, w)
    first, excess1 = limb_closure(geometry, 0, motor, q[0], u, arctangent2(dy, -dz), dx, dy, dz)
    second, excess2 = limb_closure(geometry, 1, motor, q[1], u, arctangent2(-dx, -dz), dy, dz, dx)
    third, excess3 = limb_closure(geometry, 2, motor, q[2], u, arctangent2(dx, -dy), dz, dx, dy)
    return (first, second, third), (excess1, excess2, excess3)


@formula(equations.limb_parameters, UruGeometry)
def _limb_parameters(geometry, limb):  # type: ignore[no-untyped-def]
    """d_b, d_p, f, r, k."""
    return (
        geometry.base[limb],
        geometry.platform[limb],
        geometry.proximal[limb],
        geometry.distal[limb],
        geometry.gear[limb],
    )


@formula(equations.with_limb_parameters, UruGeometry)
def _with_limb_parameters(geometry, limb, values):  # type: ignore[no-untyped-def]
    """d_b, d_p, f, r, k of one limb replaced."""
    return UruGeometry(
        replaced(geometry.base, limb, values[0]),
        replaced(geometry.platform, limb, values[1]),
        replaced(geometry.proximal, limb, values[2]),
        replaced(geometry.distal, limb, values[3]),
        replaced(geometry.gear, limb, values[4]),
        geometry.limited,
        geometry.limit_cosine,
        geometry.limit_sine,
        geometry.limit_bound,
        geometry.link_radius,
    )


@formula(equations.joint_centres, UruGeometry)
def _joint_centres(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """A_i = d_b e_i, B_i = p + d_p e_i and C_i = B_i − r_i v_i of each limb."""
    k1, k2, k3 = mode.elbows
    (v11, v12, v13), _, _ = limb_rows(geometry, 0, k1, x, y, z)
    (v22, v23, v21), _, _ = limb_rows(geometry, 1, k2, y, z, x)
    (v33, v31, v32), _, _ = limb_rows(geometry, 2, k3, z, x, y)
    b1, b2, b3 = geometry.base
    p1, p2, p3 = geometry.platform
    r1, r2, r3 = geometry.distal
    return (
        ((b1, 0.0, 0.0), (x + p1 - r1 * v11, y - r1 * v12, z - r1 * v13), (x + p1, y, z)),
        ((0.0, b2, 0.0), (x - r2 * v21, y + p2 - r2 * v22, z - r2 * v23), (x, y + p2, z)),
        ((0.0, 0.0, b3), (x - r3 * v31, y - r3 * v32, z + p3 - r3 * v33), (x, y, z + p3)),
    )


def limb_error_gain(geometry, limb, elbow, p, pj, pk):  # type: ignore[no-untyped-def]
    """Norm of one limb's length-error coefficients, see the implementation."""
    raise NotImplementedError


@formula(limb_error_gain, UruGeometry)
def _limb_error_gain(geometry, limb, elbow, p, pj, pk):  # type: ignore[no-untyped-def]
    """Loop closure with locked actuators: w_i·dx = −(v_i·e_i)(dd_p − dd_b) + (v_i·u_i) df + dr, where
    v_i·u_i = cos θ_i3."""
    a, _, _, _, rho_squared, _ = limb_chain(geometry, limb, elbow, p, pj, pk)
    f = geometry.proximal[limb]
    r = geometry.distal[limb]
    bend = (rho_squared - sqr(f) - sqr(r)) / (2.0 * f * r)
    return root(2.0 * sqr(a) + sqr(bend) + 1.0)


@formula(equations.length_error_gains, UruGeometry)
def _length_error_gains(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """For errors of d_b, d_p, f, r of each limb by itself."""
    k1, k2, k3 = mode.elbows
    return (
        limb_error_gain(geometry, 0, k1, x, y, z),
        limb_error_gain(geometry, 1, k2, y, z, x),
        limb_error_gain(geometry, 2, k3, z, x, y),
    )


ELBOWS: tuple[Triple, ...] = tuple(itertools.product((1.0, -1.0), (1.0, -1.0), (1.0, -1.0)))

# charts overlap, so that an assembly with two equal coordinates lies inside one
FACE = 1.05
NEAREST = 1e-12


def cube_charts(radius: float) -> list[tuple[tuple[float, float], FloatArray]]:
    """The charts of ``chart_direction`` with the limits (3, 2) of their coordinates, that together hold every
    pose within ``radius`` off the coordinate planes."""
    ranges = ((NEAREST, FACE), (-FACE, -NEAREST))
    return [
        ((axis, side), np.array([(NEAREST * radius, radius), v, w]))
        for axis, side, v, w in itertools.product((0.0, 1.0, 2.0), (1.0, -1.0), ranges, ranges)
    ]


def chart_assemblies(found: forward.Candidates) -> list[Assembly]:
    """The candidates of a chart as poses with boxes."""
    assemblies = []
    for (size, v, w), sides, unique in zip(found.coordinates, found.boxes, found.unique, strict=True):
        pose = [float(size * d) for d in chart_direction(found.chart, v, w)]
        along, across, last = (Interval(float(low), float(high)) for low, high in sides)
        box = tuple((side.lo, side.hi) for side in _chart_box(found.chart, along, across, last))
        assemblies.append(Assembly((pose[0], pose[1], pose[2]), box, bool(unique)))
    return assemblies


def _chart_box(chart: tuple[float, ...], u: Interval, v: Interval, w: Interval) -> list[Interval]:
    return [u * direction for direction in chart_direction(chart, v, w)]


def shaft_possible(angle: float, gear: float) -> bool:
    """Whether θ_iM = θ_i2/k_i + θ_i1 can be with θ_i2 in (−π, 2π) and θ_i1 in (−π, π]."""
    ends = (-math.pi / gear, 2.0 * math.pi / gear)
    return min(ends) - math.pi <= angle <= max(ends) + math.pi


@dataclass(frozen=True)
class Uru(Mechanism):
    """A LaMaViP 3-URU with dimensions. Pose: (x, y, z) of the platform's point P."""

    signs_class = UruSigns

    geometry: UruGeometry
    joint_ranges: tuple[tuple[float, float] | None, ...]

    def mode(self, *, octant: str, elbows: str) -> Mode:
        """The working mode on the given sides of the coordinate planes (``"any"``: all octants) with the
        given elbows; elbow + has sin θ_i3 < 0. Raises ParameterError on anything but three signs."""
        return self.mode_of({"octant": octant, "elbows": elbows})

    def single_octants(self, mode: Mode) -> tuple[Mode, ...]:
        """det H = 0 (17) on the coordinate planes."""
        sides = [(side,) if side else (1.0, -1.0) for side in mode.signs.octant]
        return tuple(
            Mode(mode.label, mode.signs._replace(octant=octant)) for octant in itertools.product(*sides)
        )

    def reach_radius(self) -> float:
        g = self.geometry
        return min(
            f + r + abs(p - b) for f, r, p, b in zip(g.proximal, g.distal, g.platform, g.base, strict=True)
        )

    def enclosed_geometry(self, tolerance: Mapping[str, float]) -> Any:
        held = enclosed_values(self.kind, self.parameters, tolerance)
        middles, across, bounds = zip(*map(enclosed_range, self.joint_ranges), strict=True)
        intervals: dict[str, Any] = {
            "base": held["db"],
            "platform": held["dp"],
            "proximal": held["f"],
            "distal": held["r"],
            "gear": held["k"],
            "limit_cosine": middles,
            "limit_sine": across,
            "limit_bound": bounds,
        }
        return self.geometry._replace(**intervals)

    def assemblies(
        self, q: ArrayLike, mode: Mode | None = None, *, drive: str = "motor"
    ) -> tuple[Assembly, ...]:
        """A complete search: no assembly is missed but those within 1e-12 of a coordinate plane, as a share
        of the reach. Motors: the shaft angles that ``ik`` gives, which count turns. Joints: modulo 2π, the
        same machine.
        """
        motor = self.motor_weight(drive)
        angles = three_numbers(q, "q", "Give three actuator coordinates in rad.")
        if motor == 0.0:
            angles = np.remainder(angles + math.pi, 2.0 * math.pi) - math.pi
        elif not all(map(shaft_possible, angles, self.geometry.gear)):
            return ()
        radius = self.reach_radius()
        coordinates = (float(angles[0]), float(angles[1]), float(angles[2]))
        octant = (0.0, 0.0, 0.0) if mode is None else mode.signs.octant
        found = [
            assembly
            for part in forward.candidates(self.geometry, motor, coordinates, cube_charts(radius))
            for assembly in chart_assemblies(part)
            if all(
                abs(value) > NEAREST * radius and value * side >= 0.0
                for value, side in zip(assembly.pose, octant, strict=True)
            )
        ]
        elbows = ELBOWS if mode is None else (mode.signs.elbows,)
        modes = [UruSigns(octant=octant, elbows=signs) for signs in elbows]
        turn = 0.0 if motor else 2.0 * math.pi
        return forward.confirmed(self, found, modes, angles, motor, turn)


def build(parameters: Mapping[str, float | Sequence[float]], limits: Mapping[str, Any]) -> Uru:
    """A 3-URU from SI values: db, dp, f, r (m), k, each one number or three; limits as declared."""
    values = limb_values(KIND, parameters)
    joint_ranges = tuple(joint_range(limits, f"theta{joint}") for joint in (1, 2, 3, 4))
    middles, across, bounds = zip(*map(range_numbers, joint_ranges), strict=True)
    geometry = UruGeometry(
        base=values["db"],
        platform=values["dp"],
        proximal=values["f"],
        distal=values["r"],
        gear=values["k"],
        limited=0.0 if all(joint is None for joint in joint_ranges) else 1.0,
        limit_cosine=middles,
        limit_sine=across,
        limit_bound=bounds,
        link_radius=float(limits.get("link_radius", 0.0)),
    )
    return Uru(kind=KIND, parameters=values, geometry=geometry, joint_ranges=joint_ranges)


def farthest_reach(ranges: Mapping[str, tuple[float, float]]) -> float:
    """Largest f + r + |d_p − d_b| that the ranges allow (m)."""
    base, platform = span(ranges, "db"), span(ranges, "dp")
    offset = max(abs(platform[1] - base[0]), abs(platform[0] - base[1]))
    return span(ranges, "f")[1] + span(ranges, "r")[1] + offset


def mode_candidates(ranges: Mapping[str, tuple[float, float]], isotropic: bool) -> tuple[dict[str, str], ...]:
    """Sign strings of one mode per orbit of the symmetries that every design of the ranges has.

    All 64 unless ``isotropic``: a region that stays in its place tells equal modes apart. A caller whose
    region, home pose or joint limits are not the same along the three axes should ask for all as well.
    """
    shared = {IDENTITY}
    if isotropic:
        random = np.random.default_rng(0)
        shared = set.intersection(*(set(_random_symmetries(ranges, random)) for _ in range(3)))
    return tuple(orbit[0] for orbit in mode_orbits(shared))


def _random_symmetries(
    ranges: Mapping[str, tuple[float, float]], random: np.random.Generator
) -> tuple[SignedPermutation, ...]:
    """Symmetries of a machine with random dimensions in the ranges: symmetry by chance has measure 0."""
    values = {name: float(random.uniform(low, high)) for name, (low, high) in ranges.items()}
    return symmetries(build(values, {}).geometry)


AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def reach_cones(values: Values, limits: Mapping[str, Any]) -> tuple[ReachCone, ...]:
    """ρ_i ≤ f_i + r_i (29)."""
    cones = []
    for limb in range(3):
        sides = [Affine({}, axis) for axis in AXES]
        sides[limb] = Affine({("dp", limb): 1.0, ("db", limb): -1.0}, AXES[limb])
        cones.append(ReachCone(tuple(sides), Affine({("f", limb): 1.0, ("r", limb): 1.0})))
    return tuple(cones)


def planes_are_singular(
    ranges: Ranges, limits: Mapping[str, Any], edges: Sequence[float], distance: float
) -> bool:
    """Whether the planes within ``distance`` of a box are seen by its distance to det H = 0, which counts
    poses within closed reach alone.

    Let the box begin at x = m < distance, its face there [y, y + 2s] × [z, z + 2t], and move the face's
    middle to x = 0. ρ_1² changes by |m² + 2 δ_1 m|; from the middle to the face's nearest and farthest corner
    it changes by s² + t² or more. ρ_2² and ρ_3² fall by m²; from the middle to the face's nearest edge they
    fall by t² and s² or more. So where these are no less, each ρ_i lies between values that it has in the
    box, and all limbs reach the point. Limits of joints might still rule it out.
    """
    if any(name.startswith("theta") for name in limits):
        return False
    for limb in range(3):
        (lowest, highest), (nearest, farthest) = ranges[("dp", limb)], ranges[("db", limb)]
        offset = max(abs(highest - nearest), abs(farthest - lowest))
        s, t = 0.5 * edges[(limb + 1) % 3], 0.5 * edges[(limb + 2) % 3]
        if distance**2 + 2.0 * offset * distance > s * s + t * t or distance > min(s, t):
            return False
    return True


KIND = MechanismKind(
    name="uru",
    title="LaMaViP 3-URU",
    source=(
        "R. Di Gregorio, A Novel 3-URU Architecture with Actuators on the Base: Kinematics and "
        "Singularity Analysis, Robotics 9(3), 60, 2020"
    ),
    parameters=(
        Parameter("db", "d_b", "length", "non-negative", "distance of the base joints A_i from the origin O"),
        Parameter(
            "dp", "d_p", "length", "non-negative", "distance of the platform joints B_i from its point P"
        ),
        Parameter("f", "f_i", "length", "positive", "proximal link A_iC_i", moving_link=True),
        Parameter("r", "r_i", "length", "positive", "distal link C_iB_i", moving_link=True),
        Parameter("k", "k_i", "ratio", "non-zero", "gear ratio of the bevel gearbox, either sign"),
    ),
    pose=("x", "y", "z"),
    actuator_unit="rad",
    drives=("motor", "joint"),
    mode_fields=(
        ModeField("octant", 3, "sides of the planes x = 0, y = 0, z = 0", any_allowed=True),
        ModeField("elbows", 3, "elbow of each limb; + has sin θ_i3 < 0"),
    ),
    limits=(
        Limit("theta1", "angle", "range", "first base joint θ_i1"),
        Limit("theta2", "angle", "range", "actuated joint θ_i2"),
        Limit("theta3", "angle", "range", "elbow θ_i3"),
        Limit("theta4", "angle", "range", "platform joint θ_i4 = −(θ_i2 + θ_i3)"),
        Limit("link_radius", "length", "number", "radius of every link, for clearance"),
    ),
    determinants=("translation", "actuation", "rotation"),
    transmission_drive="joint",
    limb_rotation=NEXT_AXIS,
    singularities=(
        Singularity("serial", "a limb stretched or folded, sin θ_i3 = 0", "(27)"),
        Singularity("translation", "det V = 0: uncontrolled if driven at the joints", "(20), (25)"),
        Singularity("actuation", "det W = 0: uncontrolled if driven by the motors", "(35), (36)"),
        Singularity("rotation", "det H = 0: the coordinate planes, platform free to rotate", "(14), (17)"),
    ),
    example=MappingProxyType({"db": 0.1, "dp": 0.06, "f": 0.25, "r": 0.25, "k": 1.0}),
    build=build,
    farthest_reach=farthest_reach,
    outer_reach=OuterReach(reach_cones, planes_are_singular=planes_are_singular),
    mode_candidates=mode_candidates,
    drawing=Drawing(
        joints=("A", "C", "B"),
        driven="A",
        marks=MappingProxyType(
            {
                "f": ("A", "C"),
                "r": ("C", "B"),
                "db": ("O", "A"),
                "dp": ("P", "B"),
                "k": ("A",),
                "θ_i2": ("+x", "A", "C"),
            }
        ),
        pose=(0.06, 0.19, 0.08),
    ),
)
