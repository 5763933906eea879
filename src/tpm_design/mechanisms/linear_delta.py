"""Linear DELTA: three carriages on rails, upright or inclined, and a parallelogram of rods from each.

Source: R. L. Williams II, The Delta Parallel Robot: Kinematics Solutions, Ohio University, 2016: carriages
counted downward from the top, above the platform. Inclined rails follow from the same loop closure. The
parallelograms keep the platform from turning.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from tpm_design.arithmetic import Interval, formula, magnitude, root, sqr
from tpm_design.arithmetic.lifting import replaced
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.angles import THIRD_TURN, cosine_sine, enclosed_cosine_sine
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.base import Drawing, Limit, MechanismKind, ModeField, Parameter, Singularity
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.mechanisms.outer_reach import Affine, OuterReach, ReachCone, Values, swing_share
from tpm_design.mechanisms.parallelograms import (
    enclosed_swing_sine,
    outward_and_hinge,
    parallelogram_equations,
    swing_sine,
)
from tpm_design.mechanisms.parameters import enclosed_values, limb_values, span, swing_limit
from tpm_design.mechanisms.rails import (
    CarriageSigns,
    Triple,
    along_rail,
    anchor,
    rail_assemblies,
    rail_equations,
    swing_margin,
)

AZIMUTHS = tuple(math.radians(angle) for angle in (-150.0, -30.0, 90.0))


class LinearDeltaGeometry(NamedTuple):
    """Dimensions of the three limbs (m). ``outward``: ε_i, ``rail``: u_i, ``hinge``: τ_i = ẑ × ε_i, along the
    short bars of the parallelogram; ``swing_sine``: sine of the limit of the swing."""

    base: Triple
    platform: Triple
    strut: Triple
    outward: tuple[Triple, ...]
    rail: tuple[Triple, ...]
    hinge: tuple[Triple, ...]
    limited: float
    lowest: Triple
    highest: Triple
    swing_sine: float
    link_radius: float


rail_equations(LinearDeltaGeometry, on_axes=False)
parallelogram_equations(LinearDeltaGeometry)


@formula(anchor, LinearDeltaGeometry)
def _anchor(geometry, limb):  # type: ignore[no-untyped-def]
    """(R_i − r_i) ε_i."""
    radius = geometry.base[limb] - geometry.platform[limb]
    ex, ey, ez = geometry.outward[limb]
    return radius * ex, radius * ey, radius * ez


@formula(along_rail, LinearDeltaGeometry)
def _along_rail(geometry, limb, side):  # type: ignore[no-untyped-def]
    """Above the platform: the strut points down the rail."""
    return side


@formula(swing_margin, LinearDeltaGeometry)
def _swing_margin(geometry, limb, w, h):  # type: ignore[no-untyped-def]
    """l_i sin(limit) − |τ_i · w_i|: the rods may leave the plane square to the short bars only so far."""
    tx, ty, tz = geometry.hinge[limb]
    aside = w[0] * tx + w[1] * ty + w[2] * tz
    return geometry.strut[limb] * geometry.swing_sine - magnitude(aside)


@formula(equations.limb_joints, LinearDeltaGeometry)
def _limb_joints(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """R_i ε_i, R_i ε_i + q_i u_i and p + r_i ε_i."""
    q = equations.limb_actuator(geometry, limb, sign, x, y, z)
    base, platform = geometry.base[limb], geometry.platform[limb]
    ex, ey, ez = geometry.outward[limb]
    ux, uy, uz = geometry.rail[limb]
    return (
        (base * ex, base * ey, base * ez),
        (base * ex + q * ux, base * ey + q * uy, base * ez + q * uz),
        (x + platform * ex, y + platform * ey, z + platform * ez),
    )


@formula(equations.limb_error_gain, LinearDeltaGeometry)
def _limb_error_gain(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """Carriages locked: s_i · dx = (s_i · ε_i)(dR − dr) + dl."""
    (sx, sy, sz), _ = equations.limb_row(geometry, limb, sign, x, y, z)
    ex, ey, ez = geometry.outward[limb]
    return root(2.0 * sqr(sx * ex + sy * ey + sz * ez) + 1.0)


@formula(equations.limb_parameters, LinearDeltaGeometry)
def _limb_parameters(geometry, limb):  # type: ignore[no-untyped-def]
    """R, r, l, rail."""
    return geometry.base[limb], geometry.platform[limb], geometry.strut[limb], geometry.highest[limb]


@formula(equations.with_limb_parameters, LinearDeltaGeometry)
def _with_limb_parameters(geometry, limb, values):  # type: ignore[no-untyped-def]
    """R, r, l, rail of one limb replaced."""
    return LinearDeltaGeometry(
        replaced(geometry.base, limb, values[0]),
        replaced(geometry.platform, limb, values[1]),
        replaced(geometry.strut, limb, values[2]),
        geometry.outward,
        geometry.rail,
        geometry.hinge,
        geometry.limited,
        geometry.lowest,
        replaced(geometry.highest, limb, values[3]),
        geometry.swing_sine,
        geometry.link_radius,
    )


def directions(azimuths: Sequence[Any], tilts: Sequence[Any], zero: Any) -> tuple[Any, Any, Any]:
    """ε_i, u_i and τ_i of all limbs from the cosines and sines of their angles."""
    outward, hinge = outward_and_hinge(azimuths, zero)
    rail = tuple((st * c, st * s, -ct) for (c, s), (ct, st) in zip(azimuths, tilts, strict=True))
    return outward, rail, hinge


@dataclass(frozen=True)
class LinearDelta(Mechanism):
    """A linear DELTA with dimensions. Pose: (x, y, z) of the platform's point P, z upward."""

    signs_class = CarriageSigns

    geometry: LinearDeltaGeometry
    swing: float | None

    def mode(self, *, carriages: str = "+++") -> Mode:
        """The working mode with carriages above (+) or below (−) the platform. Raises ParameterError on
        anything but three signs."""
        return self.mode_of({"carriages": carriages})

    def reach_radius(self) -> float:
        sizes = (self.parameters[name] for name in ("R", "r", "l", "rail"))
        return min(abs(R - r) + strut + rail for R, r, strut, rail in zip(*sizes, strict=True))

    def enclosed_geometry(self, tolerance: Mapping[str, float]) -> Any:
        held = enclosed_values(self.kind, self.parameters, tolerance)
        azimuths = [enclosed_cosine_sine(angle) for angle in self.parameters["azimuth"]]
        tilts = [enclosed_cosine_sine(angle) for angle in self.parameters["tilt"]]
        outward, rail, hinge = directions(azimuths, tilts, Interval(0.0, 0.0))
        intervals: dict[str, Any] = {
            "base": held["R"],
            "platform": held["r"],
            "strut": held["l"],
            "outward": outward,
            "rail": rail,
            "hinge": hinge,
            "lowest": (Interval(0.0, 0.0),) * 3,
            "highest": held["rail"],
            "swing_sine": enclosed_swing_sine(self.swing),
        }
        return self.geometry._replace(**intervals)

    def assemblies(
        self, q: ArrayLike, mode: Mode | None = None, *, drive: str = "motor"
    ) -> tuple[Assembly, ...]:
        """In closed form: the points at the struts' lengths from three others."""
        enclosed = self.enclosed_geometry({})
        return rail_assemblies(self, [_anchor(enclosed, limb) for limb in range(3)], q, mode, drive)


def build(parameters: Mapping[str, float | Sequence[float]], limits: Mapping[str, Any]) -> LinearDelta:
    """A linear DELTA from SI values: R, r, l, rail (m), azimuth, tilt (rad), each one number or three; limits
    as declared. Raises ParameterError on dimensions that cannot be."""
    values = limb_values(KIND, parameters)
    outward, rail, hinge = directions(
        [cosine_sine(angle) for angle in values["azimuth"]],
        [cosine_sine(angle) for angle in values["tilt"]],
        0.0,
    )
    swing = swing_limit(limits)
    geometry = LinearDeltaGeometry(
        base=values["R"],
        platform=values["r"],
        strut=values["l"],
        outward=outward,
        rail=rail,
        hinge=hinge,
        limited=1.0,
        lowest=(0.0, 0.0, 0.0),
        highest=values["rail"],
        swing_sine=swing_sine(swing),
        link_radius=float(limits.get("link_radius", 0.0)),
    )
    return LinearDelta(kind=KIND, parameters=values, geometry=geometry, swing=swing)


def farthest_reach(ranges: Mapping[str, tuple[float, float]]) -> float:
    """Largest |R − r| + l + rail that the ranges allow (m)."""
    base, platform = span(ranges, "R"), span(ranges, "r")
    offset = max(abs(base[1] - platform[0]), abs(platform[1] - base[0]))
    return offset + span(ranges, "l")[1] + span(ranges, "rail")[1]


def reach_cones(values: Values, limits: Mapping[str, Any]) -> tuple[ReachCone, ...]:
    """|w_i × u_i| ≤ l_i with w_i = p − (R_i − r_i) ε_i, and |τ_i · p| ≤ l_i times the sine of the swing."""
    outward, rail, hinge = directions(
        [cosine_sine(angle) for angle in values["azimuth"]],
        [cosine_sine(angle) for angle in values["tilt"]],
        0.0,
    )
    cones = []
    for limb in range(3):
        (tx, ty, _), (ux, uy, uz), (ex, ey, _) = hinge[limb], rail[limb], outward[limb]
        aside = Affine({}, (tx, ty, 0.0))
        # square to rail and hinge: the rail leans in the plane of ε_i and z
        sx, sy, sz = ty * uz, -tx * uz, tx * uy - ty * ux
        share = -(sx * ex + sy * ey)
        out = Affine({("R", limb): share, ("r", limb): -share}, (sx, sy, sz))
        cones.append(ReachCone((aside, out), Affine({("l", limb): 1.0})))
        if "swing" in limits:
            cones.append(ReachCone((aside,), Affine({("l", limb): swing_share(limits)})))
    return tuple(cones)


KIND = MechanismKind(
    name="linear_delta",
    title="linear DELTA",
    source=(
        "R. L. Williams II, The Delta Parallel Robot: Kinematics Solutions, Ohio University, 2016; "
        "inclined rails by the same loop closure"
    ),
    parameters=(
        Parameter("R", "R_i", "length", "non-negative", "distance of the rail's top from the axis"),
        Parameter("r", "r_i", "length", "non-negative", "distance of the platform joint from its point P"),
        Parameter("l", "l_i", "length", "positive", "rods from carriage to platform", moving_link=True),
        Parameter("rail", "rail_i", "length", "positive", "length of the rail, from its top"),
        Parameter("azimuth", "φ_i", "angle", "any", "direction of the limb about z", default=AZIMUTHS),
        Parameter(
            "tilt", "τ_i", "angle", "any", "rail against the vertical, outward below", default=(0.0, 0.0, 0.0)
        ),
    ),
    pose=("x", "y", "z"),
    actuator_unit="m",
    drives=("motor",),
    mode_fields=(ModeField("carriages", 3, "carriage of each limb; + is above the platform"),),
    limits=(
        Limit("swing", "angle", "number", "rods out of the plane square to the short bars, either way"),
        Limit("link_radius", "length", "number", "radius of every link, the rods of a limb taken as one"),
    ),
    determinants=("actuation", "rotation"),
    singularities=(
        Singularity("serial", "a strut square to its rail, s_i · u_i = 0", "b_i = 0"),
        Singularity(
            "actuation", "det of the struts' directions = 0: uncontrolled with carriages locked", "det A = 0"
        ),
        Singularity("rotation", "det of the parallelograms' normals = 0: platform free to turn", "det H = 0"),
    ),
    example=MappingProxyType({"R": 0.142, "r": 0.073, "l": 0.264, "rail": 0.4}),
    build=build,
    farthest_reach=farthest_reach,
    outer_reach=OuterReach(reach_cones, ("azimuth", "tilt")),
    limb_rotation=THIRD_TURN,
    drawing=Drawing(
        joints=("A", "C", "B"),
        driven="C",
        slides_from="A",
        parallelogram=("C", "B"),
        marks=MappingProxyType(
            {
                "l": ("C", "B"),
                "R": ("O", "A"),
                "r": ("P", "B"),
                "q_i": ("A", "C"),
                "rail": ("A", "+rail"),
                "azimuth": ("+x", "O", "A"),
                "tilt": ("-z", "A", "+rail"),
            }
        ),
        pose=(0.06, -0.04, -0.47),
    ),
)
