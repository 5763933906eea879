"""3-PUU: two rotations and one translation, carriages on three rails that rise towards one point.

Source: Z. Chen, M. Li, X. Kong, C. Zhao, Kinematics analysis of a novel 2R1T 3-PUU parallel mechanism with
multiple rotation centers, Mechanism and Machine Theory 152, 2020; equation numbers are its own. A plane s,
the constraint plane, mirrors the platform onto a place where it never moves: the mirror image of platform
joint B_i lies on rail i. With n the unit normal of s, l = |P P'| (``rise``) and
β_i = (r cos φ_i, r sin φ_i, −o),

    D_i = l − 2 n·β_i,  B_i = B'_i + D_i n,  q_i = (R − r)/cos θ + D_i σ_i ∓ η_i,
    σ_i = n·u_i,  η_i² = L² − D_i² (1 − σ_i²),

which is its equation (20) without the cancellation. Poses are (α, β, d), inside (a, b, d): ``tilts.py``.
Below d = h two poses of the platform share (α, β, d); the one with l + h cos(β/2) ≥ 0 is meant, and forward
position leaves the other out.

Where this departs from the paper, and what the paper leaves out: ``REMARKS``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tpm_design.arithmetic import Interval, cosine, direction_cosine, formula, magnitude, root, sqr
from tpm_design.arithmetic.algebra import determinant
from tpm_design.arithmetic.lifting import replaced
from tpm_design.errors import ParameterError
from tpm_design.mechanisms import equations, forward
from tpm_design.mechanisms.angles import cosine_sine, enclosed_cosine_sine
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.base import Drawing, Limit, MechanismKind, ModeField, Parameter, Singularity
from tpm_design.mechanisms.cylinders import reach_of_cylinders
from tpm_design.mechanisms.mechanism import FloatArray, Mechanism, Mode
from tpm_design.mechanisms.parameters import enclosed_values, limb_values, span, swing_limit, three_numbers
from tpm_design.mechanisms.rails import CarriageSigns, Triple
from tpm_design.mechanisms.tilts import half_tilts, normal_rates, tilt_bounds, tilts

# tan(β/2) of the largest tilt that is considered, 120°
STEEPEST = math.tan(math.radians(60.0))
# a cosine that every angle is above
NO_LIMIT = -2.0
ROOT_OF_THREE_QUARTERS = math.sqrt(0.75)
CHART = (0.0,)


class PuuGeometry(NamedTuple):
    """``base``, ``platform``, ``offset``: R, r, o; ``strut``: L of each limb; ``outward``: cos φ_i, sin φ_i;
    ``rail``: u_i; ``meeting``: q_i at B'_i; ``height``: h of P' above O; ``apex``: height of the rails'
    common point a above P'; ``characteristic_length``: what rotations are multiplied by to be compared with
    translations (m)."""

    base: float
    platform: float
    offset: float
    strut: Triple
    outward: tuple[tuple[float, float], ...]
    rail: tuple[Triple, ...]
    meeting: float
    height: float
    apex: float
    limited: float
    lowest: float
    highest: float
    swing_cosine: float
    characteristic_length: float
    link_radius: float


def constraint_plane(geometry, a, b, d):  # type: ignore[no-untyped-def]
    """n, l and sin(β/2) of a pose, see the implementation."""
    raise NotImplementedError


def limb_bearing(geometry, limb, n, rise):  # type: ignore[no-untyped-def]
    """D_i, σ_i, √(1 − σ_i²) and η_i of one limb, see the implementation."""
    raise NotImplementedError


def limb_carriage(geometry, limb, side, n, rise):  # type: ignore[no-untyped-def]
    """Position q_i of one carriage (m), see the implementation."""
    raise NotImplementedError


def limb_wrench(geometry, limb, side, length, n, rise):  # type: ignore[no-untyped-def]
    """Row and b of one limb, not normalised, see the implementation."""
    raise NotImplementedError


def limb_wrenches(geometry, mode, length, a, b, d):  # type: ignore[no-untyped-def]
    """Unit rows and b of all limbs, see the implementation."""
    raise NotImplementedError


def limb_couple(geometry, limb, n):  # type: ignore[no-untyped-def]
    """Row of one limb's constraint, see the implementation."""
    raise NotImplementedError


def limb_swings(geometry, limb, side, n, rise):  # type: ignore[no-untyped-def]
    """Metres, ≥ 0 within the limit of both U joints, see the implementation."""
    raise NotImplementedError


def limb_joints(geometry, limb, side, n, rise):  # type: ignore[no-untyped-def]
    """Start of the rail, slider joint and platform joint of one limb, see the implementation."""
    raise NotImplementedError


@formula(constraint_plane, PuuGeometry)
def _constraint_plane(geometry, a, b, d):  # type: ignore[no-untyped-def]
    """n = (a, b, 1)/√(1 + a² + b²); l = −h cos(β/2) + √(d² − h² sin²(β/2)), the triangle O P' P."""
    square = sqr(a) + sqr(b)
    cosine_of_half = 1.0 / root(1.0 + square)
    # the quotient of a and a root of a² has no wider bounds than a itself
    n = direction_cosine(a, root(1.0 + sqr(b))), direction_cosine(b, root(1.0 + sqr(a))), cosine_of_half
    sine_of_half = root(square) * cosine_of_half
    h = geometry.height
    rise = root(sqr(d) - sqr(h * sine_of_half)) - h * cosine_of_half
    return n, rise, sine_of_half


@formula(limb_bearing, PuuGeometry)
def _limb_bearing(geometry, limb, n, rise):  # type: ignore[no-untyped-def]
    c, s = geometry.outward[limb]
    ux, uy, uz = geometry.rail[limb]
    nx, ny, nz = n
    distance = rise - 2.0 * (geometry.platform * (c * nx + s * ny) - geometry.offset * nz)
    along = ux * nx + uy * ny + uz * nz
    # the cross product has no cancellation where the rail is square to s
    across = root(sqr(uy * nz - uz * ny) + sqr(uz * nx - ux * nz) + sqr(ux * ny - uy * nx))
    stretch = root(sqr(geometry.strut[limb]) - sqr(distance * across))
    return distance, along, across, stretch


@formula(limb_carriage, PuuGeometry)
def _limb_carriage(geometry, limb, side, n, rise):  # type: ignore[no-untyped-def]
    """Equation (20): its smaller root for side +."""
    distance, along, _, stretch = limb_bearing(geometry, limb, n, rise)
    return geometry.meeting + distance * along - side * stretch


@formula(limb_wrench, PuuGeometry)
def _limb_wrench(geometry, limb, side, length, n, rise):  # type: ignore[no-untyped-def]
    """Equation (23), times L, for the motions there are: rotations ω about lines of s through c_0, the middle
    of P P', and the translation v along n. The row stands for length·ω + v n, so that it needs no basis of s:
    n × ((D e/2) u − (D + e σ) β)/length + (D + e σ) n, with e u + D n the strut.
    """
    distance, along, _, stretch = limb_bearing(geometry, limb, n, rise)
    c, s = geometry.outward[limb]
    ux, uy, uz = geometry.rail[limb]
    nx, ny, nz = n
    bx, by, bz = geometry.platform * c, geometry.platform * s, -geometry.offset
    e = side * stretch - distance * along
    push = distance + e * along
    half = 0.5 * (distance * e)
    wx, wy, wz = half * ux - push * bx, half * uy - push * by, half * uz - push * bz
    row = (
        (ny * wz - nz * wy) / length + push * nx,
        (nz * wx - nx * wz) / length + push * ny,
        (nx * wy - ny * wx) / length + push * nz,
    )
    return row, side * stretch


@formula(limb_wrenches, PuuGeometry)
def _limb_wrenches(geometry, mode, length, a, b, d):  # type: ignore[no-untyped-def]
    k1, k2, k3 = mode.carriages
    n, rise, _ = constraint_plane(geometry, a, b, d)
    (x1, y1, z1), b1 = limb_wrench(geometry, 0, k1, length, n, rise)
    (x2, y2, z2), b2 = limb_wrench(geometry, 1, k2, length, n, rise)
    (x3, y3, z3), b3 = limb_wrench(geometry, 2, k3, length, n, rise)
    size1 = root(sqr(x1) + sqr(y1) + sqr(z1))
    size2 = root(sqr(x2) + sqr(y2) + sqr(z2))
    size3 = root(sqr(x3) + sqr(y3) + sqr(z3))
    rows = (
        (x1 / size1, y1 / size1, z1 / size1),
        (x2 / size2, y2 / size2, z2 / size2),
        (x3 / size3, y3 / size3, z3 / size3),
    )
    return rows, (b1 / size1, b2 / size2, b3 / size3)


@formula(limb_couple, PuuGeometry)
def _limb_couple(geometry, limb, n):  # type: ignore[no-untyped-def]
    """σ_i u_i + (1 − 2σ_i²) n, of length √(1 − σ_i²) ≤ 1: in s the constraint force along u_i × n turned by a
    right angle, times σ_i; along n its moment about the foot of the rails' common point, over its distance.
    Nothing is divided by σ_i, which may vanish, nor by the length, which does where limb i is singular."""
    ux, uy, uz = geometry.rail[limb]
    nx, ny, nz = n
    along = ux * nx + uy * ny + uz * nz
    rest = 1.0 - 2.0 * sqr(along)
    return along * ux + rest * nx, along * uy + rest * ny, along * uz + rest * nz


@formula(equations.leg_margins, PuuGeometry)
def _leg_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """L less the distance of B_i from its rail; d − |h| sin(β/2), from where on a triangle O P' P exists."""
    n, rise, sine_of_half = constraint_plane(geometry, x, y, z)
    distance1, _, across1, _ = limb_bearing(geometry, 0, n, rise)
    distance2, _, across2, _ = limb_bearing(geometry, 1, n, rise)
    distance3, _, across3, _ = limb_bearing(geometry, 2, n, rise)
    length1, length2, length3 = geometry.strut
    return (
        length1 - magnitude(distance1) * across1,
        length2 - magnitude(distance2) * across2,
        length3 - magnitude(distance3) * across3,
        z - magnitude(geometry.height) * sine_of_half,
    )


@formula(limb_swings, PuuGeometry)
def _limb_swings(geometry, limb, side, n, rise):  # type: ignore[no-untyped-def]
    """The strut's part along the joint's first axis less L cos(limit): the rail u_i for the slider's joint,
    its mirror image 2 σ_i n − u_i for the platform's."""
    distance, along, _, stretch = limb_bearing(geometry, limb, n, rise)
    least = geometry.strut[limb] * geometry.swing_cosine
    e = side * stretch - distance * along
    return stretch - least, side * (e * (2.0 * sqr(along) - 1.0) + distance * along) - least


@formula(equations.mode_margins, PuuGeometry)
def _mode_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Both ends of each rail, the swing of each U joint, and r (tan 60° − tan(β/2)): tilts up to 120°."""
    k1, k2, k3 = mode.carriages
    n, rise, _ = constraint_plane(geometry, x, y, z)
    slider1, platform1 = limb_swings(geometry, 0, k1, n, rise)
    slider2, platform2 = limb_swings(geometry, 1, k2, n, rise)
    slider3, platform3 = limb_swings(geometry, 2, k3, n, rise)
    swings = (slider1, platform1, slider2, platform2, slider3, platform3)
    upright = geometry.platform * (STEEPEST - root(sqr(x) + sqr(y)))
    if geometry.limited == 0.0:
        return upright, upright, upright, upright, upright, upright, upright, *swings
    low, high = geometry.lowest, geometry.highest
    q1 = limb_carriage(geometry, 0, k1, n, rise)
    q2 = limb_carriage(geometry, 1, k2, n, rise)
    q3 = limb_carriage(geometry, 2, k3, n, rise)
    return upright, q1 - low, high - q1, q2 - low, high - q2, q3 - low, high - q3, *swings


@formula(equations.singularity_margins, PuuGeometry)
def _singularity_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Actuation: det of the unit wrenches, moments over r. Rotation: the apex's distance δ from s as
    δ/√(δ² + r²), times det of the constraints, of rows no longer than 1."""
    (a, b, c), _ = limb_wrenches(geometry, mode, geometry.platform, x, y, z)
    n, rise, _ = constraint_plane(geometry, x, y, z)
    p, q, r = limb_couple(geometry, 0, n), limb_couple(geometry, 1, n), limb_couple(geometry, 2, n)
    apart = 0.5 * rise - geometry.apex * n[2]
    return (
        determinant(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]),
        direction_cosine(apart, geometry.platform)
        * determinant(p[0], p[1], p[2], q[0], q[1], q[2], r[0], r[1], r[2]),
    )


@formula(equations.unit_velocity_map, PuuGeometry)
def _unit_velocity_map(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    """For ẋ = length·ω + v n, with the characteristic length."""
    rows, b = limb_wrenches(geometry, mode, geometry.characteristic_length, x, y, z)
    return rows, b, (1.0, 1.0, 1.0)


@formula(equations.serial_margins, PuuGeometry)
def _serial_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """|L_i · u_i|: 0 where a strut is square to its rail."""
    n, rise, _ = constraint_plane(geometry, x, y, z)
    _, _, _, stretch1 = limb_bearing(geometry, 0, n, rise)
    _, _, _, stretch2 = limb_bearing(geometry, 1, n, rise)
    _, _, _, stretch3 = limb_bearing(geometry, 2, n, rise)
    length1, length2, length3 = geometry.strut
    return stretch1 / length1, stretch2 / length2, stretch3 / length3


@formula(equations.actuators, PuuGeometry)
def _actuators(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    """q_i (m)."""
    k1, k2, k3 = mode.carriages
    n, rise, _ = constraint_plane(geometry, x, y, z)
    return (
        limb_carriage(geometry, 0, k1, n, rise),
        limb_carriage(geometry, 1, k2, n, rise),
        limb_carriage(geometry, 2, k3, n, rise),
    )


@formula(limb_joints, PuuGeometry)
def _limb_joints(geometry, limb, side, n, rise):  # type: ignore[no-untyped-def]
    q = limb_carriage(geometry, limb, side, n, rise)
    distance, _, _, _ = limb_bearing(geometry, limb, n, rise)
    (c, s), (ux, uy, uz), (nx, ny, nz) = geometry.outward[limb], geometry.rail[limb], n
    base, platform = geometry.base, geometry.platform
    level = geometry.height - geometry.offset
    return (
        (base * c, base * s, 0.0 * c),
        (base * c + q * ux, base * s + q * uy, q * uz),
        (platform * c + distance * nx, platform * s + distance * ny, level + distance * nz),
    )


@formula(equations.joint_centres, PuuGeometry)
def _joint_centres(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """A_i, A_i + q_i u_i and B_i of each limb."""
    k1, k2, k3 = mode.carriages
    n, rise, _ = constraint_plane(geometry, x, y, z)
    return (
        limb_joints(geometry, 0, k1, n, rise),
        limb_joints(geometry, 1, k2, n, rise),
        limb_joints(geometry, 2, k3, n, rise),
    )


@formula(equations.length_error_gains, PuuGeometry)
def _length_error_gains(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """There are none where poses are not positions: metrics of them are refused."""
    return math.nan, math.nan, math.nan


@formula(equations.limb_parameters, PuuGeometry)
def _limb_parameters(geometry, limb):  # type: ignore[no-untyped-def]
    """The strut: no limb has parameters of its own, or the platform would turn otherwise."""
    return (geometry.strut[limb],)


@formula(equations.with_limb_parameters, PuuGeometry)
def _with_limb_parameters(geometry, limb, values):  # type: ignore[no-untyped-def]
    """The strut of one limb replaced."""
    return PuuGeometry(
        geometry.base,
        geometry.platform,
        geometry.offset,
        replaced(geometry.strut, limb, values[0]),
        geometry.outward,
        geometry.rail,
        geometry.meeting,
        geometry.height,
        geometry.apex,
        geometry.limited,
        geometry.lowest,
        geometry.highest,
        geometry.swing_cosine,
        geometry.characteristic_length,
        geometry.link_radius,
    )


@formula(equations.closure, PuuGeometry)
def _closure(geometry, motor, q, chart, u, v, w):  # type: ignore[no-untyped-def]
    """|e_i u_i + D_i n|² = L², e_i = (R − r)/cos θ − q_i, times 1 + a² + b²: quadratic in a, b and
    w = l √(1 + a² + b²). Impossible: l + h cos(β/2) < 0, the other pose with the same (α, β, d)."""
    square = 1.0 + (sqr(u) + sqr(v))
    return (
        limb_closure(geometry, 0, q, u, v, w, square),
        limb_closure(geometry, 1, q, u, v, w, square),
        limb_closure(geometry, 2, q, u, v, w, square),
    ), (-(w + geometry.height),)


def limb_closure(geometry, limb, q, u, v, w, square):  # type: ignore[no-untyped-def]
    """Residual of one limb, see ``equations.closure``."""
    raise NotImplementedError


@formula(limb_closure, PuuGeometry)
def _limb_closure(geometry, limb, q, u, v, w, square):  # type: ignore[no-untyped-def]
    c, s = geometry.outward[limb]
    ux, uy, uz = geometry.rail[limb]
    e = geometry.meeting - q[limb]
    distance = w - 2.0 * (geometry.platform * (c * u + s * v) - geometry.offset)
    along = ux * u + uy * v + uz
    return sqr(distance + e * along) + e * e * (square - sqr(along)) - sqr(geometry.strut[limb]) * square


@dataclass(frozen=True)
class Puu(Mechanism):
    """A 3-PUU with dimensions. Pose: (α, β, d), the platform tilted by β towards α, and |OP|."""

    signs_class = CarriageSigns

    geometry: PuuGeometry
    swing: float | None

    def mode(self, *, carriages: str = "+++") -> Mode:
        """The working mode with the smaller (+) or larger (−) root for each carriage. Raises ParameterError
        on anything but three signs."""
        return self.mode_of({"carriages": carriages})

    def coordinates(self, poses: FloatArray) -> FloatArray:
        return half_tilts(poses)

    def poses(self, coordinates: FloatArray) -> FloatArray:
        return tilts(coordinates)

    def pose_rates(self, poses: FloatArray, rates: FloatArray) -> FloatArray:
        """From length·ω + v n to (α̇, β̇, ḋ): ω = 2 n × ṅ, and v = l̇ with l² + 2 l h cos(β/2) + h² = d²."""
        a, b, distance = half_tilts(poses).T
        normal = np.column_stack([a, b, np.ones_like(a)]) / np.sqrt(1.0 + a * a + b * b)[:, None]
        growing = np.einsum("nk,nkj->nj", normal, rates)
        turning = (rates - normal[:, :, None] * growing[:, None, :]) / self.geometry.characteristic_length
        moving = 0.5 * np.cross(turning, normal[:, :, None], axis=1)
        alpha_rate, beta_rate = normal_rates(poses, moving)
        h, c = self.geometry.height, normal[:, 2]
        reaching = np.sqrt(np.maximum(0.0, distance**2 - h * h * (1.0 - c * c)))
        rise = reaching - h * c
        moved = reaching[:, None] * growing + (rise * h)[:, None] * moving[:, 2]
        distance_rate = moved / np.where(distance > 0.0, distance, np.nan)[:, None]
        # where α has no rate, none of the three has
        distance_rate[np.isnan(alpha_rate)] = np.nan
        return np.stack([alpha_rate, beta_rate, distance_rate], axis=1)

    def reach_radius(self) -> float:
        """|OP|: every B_i is within L of its rail."""
        geometry = self.geometry
        apex = (0.0, 0.0, geometry.height + geometry.apex)
        around = math.hypot(geometry.platform, geometry.offset) + geometry.strut[0]
        rails = [(ux, uy, uz) for ux, uy, uz in geometry.rail]
        return reach_of_cylinders([apex] * 3, rails, [around] * 3)

    def reach_half_axes(self) -> tuple[float, float, float]:
        """Of an ellipsoid around the cylinder √(a² + b²) ≤ tan 60°, |d| ≤ the reach radius."""
        across, along = math.sqrt(2.0) * STEEPEST, math.sqrt(2.0) * self.reach_radius()
        return across, across, along

    def enclosed_geometry(self, tolerance: Mapping[str, float]) -> Any:
        held = {name: values[0] for name, values in enclosed_values(KIND, self.parameters, tolerance).items()}
        half_root = 0.5 * root(Interval(3.0, 3.0))
        fields: dict[str, Any] = _lengths_and_rails(
            held["R"], held["r"], held["o"], enclosed_cosine_sine(self.parameters["theta"][0]), half_root
        )
        fields["strut"] = (held["L"],) * 3
        fields["swing_cosine"] = (
            Interval(NO_LIMIT, NO_LIMIT) if self.swing is None else cosine(Interval(self.swing, self.swing))
        )
        return self.geometry._replace(**fields)

    def assemblies(
        self, q: ArrayLike, mode: Mode | None = None, *, drive: str = "motor"
    ) -> tuple[Assembly, ...]:
        """A complete search among tilts up to 120°: no assembly is missed."""
        motor = self.motor_weight(drive)
        positions = three_numbers(q, "q", "Give three carriage positions in m.")
        geometry = self.geometry
        # |D_i n + e_i u_i| = L
        farthest = max(geometry.strut) + float(np.abs(geometry.meeting - positions).max())
        size = math.sqrt(1.0 + 2.0 * STEEPEST**2)
        bound = size * (farthest + 2.0 * math.hypot(geometry.platform, geometry.offset))
        limits = np.array([(-STEEPEST, STEEPEST), (-STEEPEST, STEEPEST), (-bound, bound)])
        carriages = (float(positions[0]), float(positions[1]), float(positions[2]))
        (part,) = forward.candidates(geometry, motor, carriages, [(CHART, limits)])
        found = [
            self._assembly(coordinates, box, bool(unique))
            for coordinates, box, unique in zip(part.coordinates, part.boxes, part.unique, strict=True)
        ]
        sides = itertools.product((1.0, -1.0), repeat=3)
        modes = [CarriageSigns(signs) for signs in sides] if mode is None else [mode.signs]
        inner = forward.confirmed(self, found, modes, positions, motor, 0.0)
        return tuple(sorted(map(_tilted, inner), key=lambda assembly: assembly.pose))

    def _assembly(self, coordinates: FloatArray, box: FloatArray, unique: bool) -> Assembly:
        """From (a, b, l √(1 + a² + b²)) to (a, b, d): d² = l² + 2 l h cos(β/2) + h²."""
        u, v, w = (Interval(float(low), float(high)) for low, high in box)
        a, b, scaled = map(float, coordinates)
        h = self.geometry.height
        square = 1.0 + a * a + b * b
        distance = math.sqrt(max(0.0, (scaled * scaled + 2.0 * scaled * h) / square + h * h))
        bounds = root((sqr(w) + 2.0 * (w * h)) / (1.0 + (sqr(u) + sqr(v))) + h * h)
        return Assembly((a, b, distance), ((u.lo, u.hi), (v.lo, v.hi), (bounds.lo, bounds.hi)), unique)


def _tilted(assembly: Assembly) -> Assembly:
    """(a, b, d) as users write it."""
    alpha, beta, distance = tilts(np.array([assembly.pose]))[0]
    return Assembly((float(alpha), float(beta), float(distance)), tilt_bounds(assembly.box), assembly.unique)


def _lengths_and_rails(
    base: Any, platform: Any, offset: Any, cosine_and_sine: tuple[Any, Any], half_root: Any
) -> dict[str, Any]:
    """What follows from R, r, o and θ, all floats or all Intervals. ``half_root``: √3/2."""
    c, s = cosine_and_sine
    zero = 0.0 * half_root
    outward = ((-half_root, zero - 0.5), (zero, zero + 1.0), (half_root, zero - 0.5))  # 210°, 90°, 330°
    slope = s / c
    return {
        "base": base,
        "platform": platform,
        "offset": offset,
        "outward": outward,
        "rail": tuple((-(c * x), -(c * y), s) for x, y in outward),
        "meeting": (base - platform) / c,
        "height": (base - platform) * slope + offset,
        "apex": platform * slope - offset,
    }


def build(parameters: Mapping[str, float | Sequence[float]], limits: Mapping[str, Any]) -> Puu:
    """A 3-PUU from SI values: R, r, L, o (m), theta (rad); limits as declared. Raises ParameterError on
    dimensions that cannot be."""
    values = limb_values(KIND, parameters)
    base, platform, theta, strut, offset = (values[name][0] for name in ("R", "r", "theta", "L", "o"))
    if not 0.0 < theta < 0.5 * math.pi:
        raise ParameterError(
            f"puu: theta = {math.degrees(theta):g}° is not between 0 and 90°.",
            remedy="It is the angle between the rails and the base.",
        )
    length = float(limits.get("characteristic_length", platform))
    if not length > 0.0:
        raise ParameterError("The limit characteristic_length = 0 is not a length.", remedy="Leave it out.")
    low, high = limits.get("stroke", (0.0, 0.0))
    swing = swing_limit(limits)
    geometry = PuuGeometry(
        strut=(strut,) * 3,
        limited=1.0 if "stroke" in limits else 0.0,
        lowest=float(low),
        highest=float(high),
        swing_cosine=NO_LIMIT if swing is None else math.cos(swing),
        characteristic_length=length,
        link_radius=float(limits.get("link_radius", 0.0)),
        **_lengths_and_rails(base, platform, offset, cosine_sine(theta), ROOT_OF_THREE_QUARTERS),
    )
    return Puu(kind=KIND, parameters=values, geometry=geometry, swing=swing)


def farthest_reach(ranges: Mapping[str, tuple[float, float]]) -> float:
    """Bound of d (m): P within L + √(r² + o²) of three lines that rise at θ through (0, 0, R tan θ)."""
    low, high = span(ranges, "theta")
    offset = max(map(abs, span(ranges, "o"))) if "o" in ranges else 0.0
    around = span(ranges, "L")[1] + math.hypot(span(ranges, "r")[1], offset)
    flattest = min(3.0 - 1.5 * math.cos(low) ** 2, 3.0 * math.cos(high) ** 2)
    return span(ranges, "R")[1] * math.tan(high) + around * math.sqrt(3.0 / flattest)


REMARKS = (
    "The paper gives no L and no convention for the U-joint angle, so that its workspace figures (d from 31 "
    "to 142 mm, β up to 78°, 60.4° all round at d = 94 mm) can be approached, not reproduced.",
    "Its worked examples belong to h = 78.2843 mm, its workspace section to h = (R − r) tan θ = 70 mm: the "
    "parameter o, 0 by default, is the difference, the height of the joints B_i over P.",
    "Its direction of the rotation axis, n × Z, contradicts its components, Z × n, which are used; the minus "
    "sign in its second component of B_i breaks the symmetry it relies on and is left out.",
    "Its condition of the second kind, b_i × L_i = 0, is not the one: actuation is the determinant of the "
    "carriages' speeds against the three motions there are.",
    "There are singularities inside the workspace that it claims: for θ = 45° the rotation locus at "
    "β = 67.38° towards α = 90° and 74.17° towards α = 0°, whatever d and L.",
    "Poses with β = 0 have no α: give any; the Jacobian does not exist there. Tilts up to 120° are "
    "considered. Where d < h two poses share (α, β, d): the one with l + h cos(β/2) ≥ 0 is meant.",
    "κ compares rotations with a translation: it needs the limit characteristic_length.",
)

KIND = MechanismKind(
    name="puu",
    title="3-PUU, two rotations and one translation",
    source=(
        "Z. Chen, M. Li, X. Kong, C. Zhao, Kinematics analysis of a novel 2R1T 3-PUU parallel mechanism with "
        "multiple rotation centers, Mechanism and Machine Theory 152, 2020"
    ),
    parameters=(
        Parameter("R", "R", "length", "positive", "distance of the rails' starts A_i from O", per_limb=False),
        Parameter("r", "r", "length", "positive", "distance of the joints B_i from the axis", per_limb=False),
        Parameter("theta", "θ", "angle", "positive", "angle of the rails to the base, up to 90°",
                  per_limb=False),
        Parameter("L", "L", "length", "positive", "strut from slider to platform", per_limb=False,
                  moving_link=True),
        Parameter("o", "o", "length", "any", "height of the platform's joints B_i over its point P",
                  per_limb=False, default=(0.0,)),
    ),
    pose=("alpha", "beta", "d"),
    pose_units=("rad", "rad", "m"),
    coordinates=("tan(β/2) cos α", "tan(β/2) sin α", "d"),
    coordinate_units=("-", "-", "m"),
    actuator_unit="m",
    drives=("motor",),
    mode_fields=(ModeField("carriages", 3, "root of each carriage's position; + is the smaller one"),),
    limits=(
        Limit("stroke", "length", "range", "position q_i of each carriage on its rail, from A_i"),
        Limit("swing", "angle", "number",
              "largest angle of a strut to the first axis of each of its U joints: the rail at the slider, "
              "its mirror image in the constraint plane at the platform"),
        Limit("characteristic_length", "length", "number",
              "what rotations are multiplied by, so that κ compares them with the translation"),
        Limit("link_radius", "length", "number", "radius of every link and rail, for clearance"),
    ),
    determinants=("actuation", "rotation"),
    singularities=(
        Singularity("serial", "a strut square to its rail, L_i · u_i = 0: first kind", "(29)"),
        Singularity("branch", "axes r_i2 and r_i5 of a limb in one line: part of the locus of rotation",
                    "(35)"),
        Singularity("actuation", "det of unit wrenches, moments about c_0 over r, = 0: second kind, "
                    "uncontrolled with carriages locked", "(23)"),
        Singularity("rotation", "det of the constraints = 0, or the rails' common point in s: constraint "
                    "singularity, free to turn about n", "(5), (12)"),
    ),
    example=MappingProxyType({"R": 0.12, "r": 0.05, "theta": math.radians(45.0), "L": 0.062, "o": 0.0082843}),
    build=build,
    farthest_reach=farthest_reach,
    transmission_drive=None,
    tolerance_refusal=(
        "the platform turns without sliding only because its limbs are alike and symmetrical: a 3-PUU with "
        "other dimensions in one limb has other motions"
    ),
    remarks=REMARKS,
    drawing=Drawing(
        joints=("A", "C", "B"),
        driven="C",
        slides_from="A",
        marks=MappingProxyType(
            {
                "L": ("C", "B"),
                "R": ("O", "A"),
                "r": ("M", "B"),
                "q_i": ("A", "C"),
                "theta": ("O", "A", "C"),
            }
        ),
        pose=(math.radians(60.0), math.radians(25.0), 0.11),
    ),
)  # fmt: skip
