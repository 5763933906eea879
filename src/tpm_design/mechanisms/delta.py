"""DELTA: three arms turned by motors on the base, a parallelogram of rods from each knee to the platform.

Source: R. L. Williams II, The Delta Parallel Robot: Kinematics Solutions, Ohio University, 2016.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from tpm_design.arithmetic import Interval, cosine, formula, greater, magnitude, root, sine, sqr
from tpm_design.arithmetic.lifting import replaced
from tpm_design.mechanisms import equations, forward
from tpm_design.mechanisms.angles import THIRD_TURN, cosine_sine, enclosed_cosine_sine
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.base import Drawing, Limit, MechanismKind, ModeField, Parameter, Singularity
from tpm_design.mechanisms.joint_limits import JointRange, enclosed_range, joint_range, range_numbers
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.mechanisms.outer_reach import Affine, OuterReach, ReachCone, Values, swing_share
from tpm_design.mechanisms.parallelograms import (
    enclosed_swing_sine,
    outward_and_hinge,
    parallelogram_equations,
    swing_sine,
)
from tpm_design.mechanisms.parameters import enclosed_values, limb_values, span, swing_limit, three_numbers
from tpm_design.mechanisms.spheres import sphere_intersection
from tpm_design.mechanisms.two_link import distal_link

Triple = tuple[float, ...]

AZIMUTHS = tuple(math.radians(angle) for angle in (-90.0, 30.0, 150.0))
SHORTEST = 1e-12


class DeltaGeometry(NamedTuple):
    """Dimensions of the three limbs (m). ``outward``: ε_i, ``hinge``: τ_i = ẑ × ε_i, the motor's axis and the
    short bars of the parallelogram; ``range_cosine``, ``range_sine``, ``range_bound``: range of the arms'
    angle; ``swing_sine``: sine of the limit of the swing."""

    base: Triple
    platform: Triple
    proximal: Triple
    distal: Triple
    outward: tuple[Triple, ...]
    hinge: tuple[Triple, ...]
    range_cosine: float
    range_sine: float
    range_bound: float
    swing_sine: float
    link_radius: float


parallelogram_equations(DeltaGeometry)


class DeltaSigns(NamedTuple):
    """A working mode: knee of each limb, +1 out or −1 in."""

    elbows: Triple


def limb_point(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """The platform's joint seen from the motor's axis, see the implementation."""
    raise NotImplementedError


@formula(limb_point, DeltaGeometry)
def _limb_point(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """(α, β, aside) along ε_i, −ẑ and τ_i."""
    ex, ey, _ = geometry.outward[limb]
    tx, ty, _ = geometry.hinge[limb]
    return x * ex + y * ey - (geometry.base[limb] - geometry.platform[limb]), -z, x * tx + y * ty


def limb_chain(geometry, limb, elbow, x, y, z):  # type: ignore[no-untyped-def]
    """Lower arm and knee of one limb, see the implementation."""
    raise NotImplementedError


@formula(limb_chain, DeltaGeometry)
def _limb_chain(geometry, limb, elbow, x, y, z):  # type: ignore[no-untyped-def]
    """The unit lower arm s_i along ε_i, −ẑ, τ_i; the knee along ε_i, −ẑ; b_i = L s_i · t_i. In the plane of
    the arm the lower arm appears as long as √(l² − aside²)."""
    alpha, beta, aside = limb_point(geometry, limb, x, y, z)
    distal = geometry.distal[limb]
    # never 0, which is out of reach but where the upper arm points at the platform's joint
    seen = root(greater(sqr(distal) - sqr(aside), SHORTEST * sqr(distal)))
    # knee out: the elbow lies on the outer side
    a, c, gamma = distal_link(alpha, beta, sqr(alpha) + sqr(beta), geometry.proximal[limb], seen, -elbow)
    share = seen / distal
    return (a * share, c * share, aside / distal), (alpha - seen * a, beta - seen * c), gamma * share


@formula(equations.limb_row, DeltaGeometry)
def _limb_row(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """s_i · ẋ = L (s_i · t_i) θ̇_i: the lower arm keeps its length."""
    (out, down, aside), _, b = limb_chain(geometry, limb, sign, x, y, z)
    ex, ey, _ = geometry.outward[limb]
    tx, ty, _ = geometry.hinge[limb]
    return (out * ex + aside * tx, out * ey + aside * ty, -down), b


def limb_margins(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """Leg space of one limb in metres, see the implementation."""
    raise NotImplementedError


@formula(limb_margins, DeltaGeometry)
def _limb_margins(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """l less the distance to the nearest point of the knee's circle, that to the farthest one less l."""
    alpha, beta, aside = limb_point(geometry, limb, x, y, z)
    rho, across = root(sqr(alpha) + sqr(beta)), sqr(aside)
    proximal, distal = geometry.proximal[limb], geometry.distal[limb]
    return distal - root(sqr(rho - proximal) + across), root(sqr(rho + proximal) + across) - distal


@formula(equations.leg_margins, DeltaGeometry)
def _leg_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Outer and inner bound of each limb."""
    outer1, inner1 = limb_margins(geometry, 0, x, y, z)
    outer2, inner2 = limb_margins(geometry, 1, x, y, z)
    outer3, inner3 = limb_margins(geometry, 2, x, y, z)
    return outer1, inner1, outer2, inner2, outer3, inner3


def limb_limits(geometry, limb, elbow, x, y, z):  # type: ignore[no-untyped-def]
    """Joint limits of one limb in metres, see the implementation."""
    raise NotImplementedError


@formula(limb_limits, DeltaGeometry)
def _limb_limits(geometry, limb, elbow, x, y, z):  # type: ignore[no-untyped-def]
    """L (cos(θ − middle) − bound), l sin(limit) − |τ_i · p|."""
    _, (out, down), _ = limb_chain(geometry, limb, elbow, x, y, z)
    _, _, aside = limb_point(geometry, limb, x, y, z)
    turn = out * geometry.range_cosine + down * geometry.range_sine
    return (
        turn - geometry.proximal[limb] * geometry.range_bound,
        geometry.distal[limb] * geometry.swing_sine - magnitude(aside),
    )


@formula(equations.mode_margins, DeltaGeometry)
def _mode_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Range of the arm and swing of the rods of each limb."""
    k1, k2, k3 = mode.elbows
    turn1, swing1 = limb_limits(geometry, 0, k1, x, y, z)
    turn2, swing2 = limb_limits(geometry, 1, k2, x, y, z)
    turn3, swing3 = limb_limits(geometry, 2, k3, x, y, z)
    return turn1, swing1, turn2, swing2, turn3, swing3


@formula(equations.serial_margins, DeltaGeometry)
def _serial_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """|s_i · t_i|: 0 where the lower arm lies in the plane of upper arm and motor axis."""
    _, (b1, b2, b3), _ = equations.unit_velocity_map(geometry, mode, 1.0, x, y, z)
    l1, l2, l3 = geometry.proximal
    return magnitude(b1 / l1), magnitude(b2 / l2), magnitude(b3 / l3)


@formula(equations.limb_actuator, DeltaGeometry)
def _limb_actuator(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """θ_i (rad), positive downward from the horizontal, in (−π, π]."""
    _, (out, down), _ = limb_chain(geometry, limb, sign, x, y, z)
    return math.atan2(down, out)


@formula(equations.limb_joints, DeltaGeometry)
def _limb_joints(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """w_i ε_i, the knee, p + u_i ε_i."""
    _, (out, down), _ = limb_chain(geometry, limb, sign, x, y, z)
    ex, ey, _ = geometry.outward[limb]
    base, platform = geometry.base[limb], geometry.platform[limb]
    knee = base + out
    return (
        (base * ex, base * ey, 0.0),
        (knee * ex, knee * ey, -down),
        (x + platform * ex, y + platform * ey, z),
    )


@formula(equations.limb_error_gain, DeltaGeometry)
def _limb_error_gain(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """Motors locked: s_i · dx = (s_i · ε_i)(dw − du) + (s_i · knee_i/L) dL + dl."""
    (along, down, _), (out, below), _ = limb_chain(geometry, limb, sign, x, y, z)
    bend = (along * out + down * below) / geometry.proximal[limb]
    return root(2.0 * sqr(along) + sqr(bend) + 1.0)


@formula(equations.limb_parameters, DeltaGeometry)
def _limb_parameters(geometry, limb):  # type: ignore[no-untyped-def]
    """w, u, L, l."""
    return geometry.base[limb], geometry.platform[limb], geometry.proximal[limb], geometry.distal[limb]


@formula(equations.with_limb_parameters, DeltaGeometry)
def _with_limb_parameters(geometry, limb, values):  # type: ignore[no-untyped-def]
    """w, u, L, l of one limb replaced."""
    return DeltaGeometry(
        replaced(geometry.base, limb, values[0]),
        replaced(geometry.platform, limb, values[1]),
        replaced(geometry.proximal, limb, values[2]),
        replaced(geometry.distal, limb, values[3]),
        geometry.outward,
        geometry.hinge,
        geometry.range_cosine,
        geometry.range_sine,
        geometry.range_bound,
        geometry.swing_sine,
        geometry.link_radius,
    )


@dataclass(frozen=True)
class Delta(Mechanism):
    """A DELTA with dimensions. Pose: (x, y, z) of the platform's point P, z upward."""

    signs_class = DeltaSigns

    geometry: DeltaGeometry
    arm_range: JointRange | None
    swing: float | None

    def mode(self, *, elbows: str = "+++") -> Mode:
        """The working mode with knees out (+) or in (−). Raises ParameterError on anything but signs."""
        return self.mode_of({"elbows": elbows})

    def reach_radius(self) -> float:
        g = self.geometry
        sizes = zip(g.base, g.platform, g.proximal, g.distal, strict=True)
        return min(abs(w - u) + upper + lower for w, u, upper, lower in sizes)

    def enclosed_geometry(self, tolerance: Mapping[str, float]) -> Any:
        held = enclosed_values(self.kind, self.parameters, tolerance)
        azimuths = [enclosed_cosine_sine(angle) for angle in self.parameters["azimuth"]]
        outward, hinge = outward_and_hinge(azimuths, Interval(0.0, 0.0))
        middle, across, bound = enclosed_range(self.arm_range)
        intervals: dict[str, Any] = {
            "base": held["w"],
            "platform": held["u"],
            "proximal": held["L"],
            "distal": held["l"],
            "outward": outward,
            "hinge": hinge,
            "range_cosine": middle,
            "range_sine": across,
            "range_bound": bound,
            "swing_sine": enclosed_swing_sine(self.swing),
        }
        return self.geometry._replace(**intervals)

    def assemblies(
        self, q: ArrayLike, mode: Mode | None = None, *, drive: str = "motor"
    ) -> tuple[Assembly, ...]:
        """In closed form: the points at the lower arms' lengths from the knees."""
        motor = self.motor_weight(drive)
        angles = three_numbers(q, "q", "Give three angles in rad.")
        enclosed = self.enclosed_geometry({})
        centres = []
        for limb, angle in enumerate(angles):
            turn = Interval(float(angle), float(angle))
            radius = enclosed.base[limb] - enclosed.platform[limb] + enclosed.proximal[limb] * cosine(turn)
            ex, ey, _ = enclosed.outward[limb]
            centres.append((radius * ex, radius * ey, -(enclosed.proximal[limb] * sine(turn))))
        found = sphere_intersection(centres, enclosed.distal)
        elbows = itertools.product((1.0, -1.0), repeat=3)
        modes = [DeltaSigns(signs) for signs in elbows] if mode is None else [mode.signs]
        return forward.confirmed(self, found, modes, angles, motor, 2.0 * math.pi)


def build(parameters: Mapping[str, float | Sequence[float]], limits: Mapping[str, Any]) -> Delta:
    """A DELTA from SI values: w, u, L, l (m), azimuth (rad), each one number or three; limits as declared.
    Raises ParameterError on dimensions that cannot be."""
    values = limb_values(KIND, parameters)
    outward, hinge = outward_and_hinge([cosine_sine(angle) for angle in values["azimuth"]], 0.0)
    arm_range, swing = joint_range(limits, "theta"), swing_limit(limits)
    middle, across, bound = range_numbers(arm_range)
    geometry = DeltaGeometry(
        base=values["w"],
        platform=values["u"],
        proximal=values["L"],
        distal=values["l"],
        outward=outward,
        hinge=hinge,
        range_cosine=middle,
        range_sine=across,
        range_bound=bound,
        swing_sine=swing_sine(swing),
        link_radius=float(limits.get("link_radius", 0.0)),
    )
    return Delta(kind=KIND, parameters=values, geometry=geometry, arm_range=arm_range, swing=swing)


def farthest_reach(ranges: Mapping[str, tuple[float, float]]) -> float:
    """Largest |w − u| + L + l that the ranges allow (m)."""
    base, platform = span(ranges, "w"), span(ranges, "u")
    offset = max(abs(base[1] - platform[0]), abs(platform[1] - base[0]))
    return offset + span(ranges, "L")[1] + span(ranges, "l")[1]


def reach_cones(values: Values, limits: Mapping[str, Any]) -> tuple[ReachCone, ...]:
    """|p − (w_i − u_i) ε_i| ≤ L_i + l_i, both arms in line, and |τ_i · p| ≤ l_i, times the sine of the swing:
    the lower arm alone leaves the plane of the upper arm's motion."""
    outward, hinge = outward_and_hinge([cosine_sine(angle) for angle in values["azimuth"]], 0.0)
    cones = []
    for limb in range(3):
        (ex, ey, _), (tx, ty, _) = outward[limb], hinge[limb]
        along = Affine({("w", limb): -1.0, ("u", limb): 1.0}, (ex, ey, 0.0))
        aside = Affine({}, (tx, ty, 0.0))
        sides = (along, Affine({}, (0.0, 0.0, -1.0)), aside)
        cones += [
            ReachCone(sides, Affine({("L", limb): 1.0, ("l", limb): 1.0})),
            ReachCone((aside,), Affine({("l", limb): swing_share(limits)})),
        ]
    return tuple(cones)


KIND = MechanismKind(
    name="delta",
    title="DELTA",
    source="R. L. Williams II, The Delta Parallel Robot: Kinematics Solutions, Ohio University, 2016",
    parameters=(
        Parameter(
            "w", "w_i", "length", "non-negative", "distance of the motor's axis from the middle of the base"
        ),
        Parameter("u", "u_i", "length", "non-negative", "distance of the platform joint from its point P"),
        Parameter("L", "L_i", "length", "positive", "upper arm", moving_link=True),
        Parameter("l", "l_i", "length", "positive", "lower arm: rods of the parallelogram", moving_link=True),
        Parameter("azimuth", "φ_i", "angle", "any", "direction of the limb about z", default=AZIMUTHS),
    ),
    pose=("x", "y", "z"),
    actuator_unit="rad",
    drives=("motor",),
    mode_fields=(ModeField("elbows", 3, "knee of each limb; + is out"),),
    limits=(
        Limit("theta", "angle", "range", "upper arm θ_i, positive downward from the horizontal"),
        Limit("swing", "angle", "number", "lower arm out of the plane of the upper arm's motion, either way"),
        Limit("link_radius", "length", "number", "radius of every link, the rods of a limb taken as one"),
    ),
    determinants=("actuation", "rotation"),
    singularities=(
        Singularity("serial", "lower arm in the plane of upper arm and motor axis, s_i · t_i = 0", "b_i = 0"),
        Singularity("actuation", "det of the lower arms' directions = 0: uncontrolled", "det A = 0"),
        Singularity("rotation", "det of the parallelograms' normals = 0: platform free to turn", "det H = 0"),
    ),
    example=MappingProxyType({"w": 0.164, "u": 0.044, "L": 0.524, "l": 1.244}),
    build=build,
    farthest_reach=farthest_reach,
    outer_reach=OuterReach(reach_cones, ("azimuth",)),
    limb_rotation=THIRD_TURN,
    drawing=Drawing(
        joints=("A", "C", "B"),
        driven="A",
        parallelogram=("C", "B"),
        marks=MappingProxyType(
            {
                "L": ("A", "C"),
                "l": ("C", "B"),
                "w": ("O", "A"),
                "u": ("P", "B"),
                "azimuth": ("+x", "O", "A"),
                "θ_i": ("OA", "A", "C"),
            }
        ),
        pose=(0.15, 0.2, -1.2),
    ),
)
