"""Orthoglide: three carriages on rails along x, y, z, struts of one kind to the platform.

Source: P. Wenger, D. Chablat, Kinematic analysis of a new parallel machine tool: the Orthoglide, Advances in
Robot Kinematics, 2000; D. Chablat, P. Wenger, Architecture optimization of a 3-DOF translational parallel
mechanism for machining applications, the Orthoglide, IEEE Trans. Robotics and Automation 19(3), 2003.
Revolute joints of its limbs keep the platform from turning at every pose: there is no rotation singularity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from tpm_design.arithmetic import Interval, cosine, formula, root, sqr
from tpm_design.arithmetic.lifting import replaced
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.angles import NEXT_AXIS
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.base import Drawing, Limit, MechanismKind, ModeField, Parameter, Singularity
from tpm_design.mechanisms.cylinders import reach_of_cylinders
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.mechanisms.outer_reach import Affine, OuterReach, ReachCone, Values, swing_share
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

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
# a cosine that every angle is above
NO_LIMIT = -2.0


class OrthoglideGeometry(NamedTuple):
    """Dimensions of the three limbs (m). ``rail``: e_i; ``limited``: 1.0 where carriages have ends of travel,
    ``swing_cosine``: cosine of the largest angle between strut and rail."""

    platform: Triple
    strut: Triple
    rail: tuple[Triple, ...]
    limited: float
    lowest: Triple
    highest: Triple
    swing_cosine: float
    link_radius: float


rail_equations(OrthoglideGeometry, on_axes=True)


@formula(anchor, OrthoglideGeometry)
def _anchor(geometry, limb):  # type: ignore[no-untyped-def]
    """−d_i e_i."""
    ex, ey, ez = geometry.rail[limb]
    offset = -geometry.platform[limb]
    return offset * ex, offset * ey, offset * ez


@formula(along_rail, OrthoglideGeometry)
def _along_rail(geometry, limb, side):  # type: ignore[no-untyped-def]
    """Ahead of the platform: the strut points back along the rail."""
    return -side


@formula(swing_margin, OrthoglideGeometry)
def _swing_margin(geometry, limb, w, h):  # type: ignore[no-untyped-def]
    """h_i − l_i cos(limit): the angle between strut and rail."""
    return h - geometry.strut[limb] * geometry.swing_cosine


@formula(equations.limb_joints, OrthoglideGeometry)
def _limb_joints(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """q_i e_i and p + d_i e_i."""
    q, d = equations.limb_actuator(geometry, limb, sign, x, y, z), geometry.platform[limb]
    ex, ey, ez = geometry.rail[limb]
    return (q * ex, q * ey, q * ez), (x + d * ex, y + d * ey, z + d * ez)


@formula(equations.limb_error_gain, OrthoglideGeometry)
def _limb_error_gain(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """Carriages locked: s_i · dx = −(s_i · e_i) dd + dL."""
    _, b = equations.limb_row(geometry, limb, sign, x, y, z)
    return root(sqr(b) + 1.0)


@formula(equations.limb_parameters, OrthoglideGeometry)
def _limb_parameters(geometry, limb):  # type: ignore[no-untyped-def]
    """d, L."""
    return geometry.platform[limb], geometry.strut[limb]


@formula(equations.with_limb_parameters, OrthoglideGeometry)
def _with_limb_parameters(geometry, limb, values):  # type: ignore[no-untyped-def]
    """d, L of one limb replaced."""
    return OrthoglideGeometry(
        replaced(geometry.platform, limb, values[0]),
        replaced(geometry.strut, limb, values[1]),
        geometry.rail,
        geometry.limited,
        geometry.lowest,
        geometry.highest,
        geometry.swing_cosine,
        geometry.link_radius,
    )


@dataclass(frozen=True)
class Orthoglide(Mechanism):
    """An Orthoglide with dimensions. Pose: (x, y, z) of the platform's point P."""

    signs_class = CarriageSigns

    geometry: OrthoglideGeometry
    swing: float | None

    def mode(self, *, carriages: str = "+++") -> Mode:
        """The working mode with carriages ahead of (+) or behind (−) the platform. Raises ParameterError on
        anything but three signs."""
        return self.mode_of({"carriages": carriages})

    def reach_radius(self) -> float:
        return reach_of_cylinders([(0.0, 0.0, 0.0)] * 3, AXES, self.parameters["L"])

    def enclosed_geometry(self, tolerance: Mapping[str, float]) -> Any:
        held = enclosed_values(self.kind, self.parameters, tolerance)
        intervals: dict[str, Any] = {
            "platform": held["d"],
            "strut": held["L"],
            "swing_cosine": Interval(NO_LIMIT, NO_LIMIT)
            if self.swing is None
            else cosine(Interval(self.swing, self.swing)),
        }
        return self.geometry._replace(**intervals)

    def assemblies(
        self, q: ArrayLike, mode: Mode | None = None, *, drive: str = "motor"
    ) -> tuple[Assembly, ...]:
        """In closed form: the points at the struts' lengths from three others."""
        enclosed = self.enclosed_geometry({})
        return rail_assemblies(self, [_anchor(enclosed, limb) for limb in range(3)], q, mode, drive)


def build(parameters: Mapping[str, float | Sequence[float]], limits: Mapping[str, Any]) -> Orthoglide:
    """An Orthoglide from SI values: L, d (m), each one number or three; limits as declared. Raises
    ParameterError on dimensions that cannot be."""
    values = limb_values(KIND, parameters)
    low, high = limits.get("stroke", (0.0, 0.0))
    swing = swing_limit(limits)
    geometry = OrthoglideGeometry(
        platform=values["d"],
        strut=values["L"],
        rail=AXES,
        limited=1.0 if "stroke" in limits else 0.0,
        lowest=(float(low),) * 3,
        highest=(float(high),) * 3,
        swing_cosine=NO_LIMIT if swing is None else math.cos(swing),
        link_radius=float(limits.get("link_radius", 0.0)),
    )
    return Orthoglide(kind=KIND, parameters=values, geometry=geometry, swing=swing)


def farthest_reach(ranges: Mapping[str, tuple[float, float]]) -> float:
    """√1.5 times the longest strut (m): the corner of three crossing cylinders."""
    return math.sqrt(1.5) * span(ranges, "L")[1]


def reach_cones(values: Values, limits: Mapping[str, Any]) -> tuple[ReachCone, ...]:
    """A strut square to its rail reaches farthest; at a limit of its angle with the rail, the sine of it."""
    return tuple(
        ReachCone(
            tuple(Affine({}, axis) for number, axis in enumerate(AXES) if number != limb),
            Affine({("L", limb): swing_share(limits)}),
        )
        for limb in range(3)
    )


KIND = MechanismKind(
    name="orthoglide",
    title="Orthoglide",
    source=(
        "D. Chablat, P. Wenger, Architecture optimization of a 3-DOF translational parallel mechanism for "
        "machining applications, the Orthoglide, IEEE Trans. Robotics and Automation 19(3), 2003"
    ),
    parameters=(
        Parameter("L", "L_i", "length", "positive", "strut from carriage to platform", moving_link=True),
        Parameter(
            "d", "d_i", "length", "any", "distance of the platform joint from its point P along the rail",
            default=(0.0, 0.0, 0.0),
        ),
    ),
    pose=("x", "y", "z"),
    actuator_unit="m",
    drives=("motor",),
    mode_fields=(ModeField("carriages", 3, "carriage of each limb; + is ahead of the platform"),),
    limits=(
        Limit("stroke", "length", "range", "position q_i of each carriage"),
        Limit("swing", "angle", "number", "largest angle between strut and rail"),
        Limit("link_radius", "length", "number", "radius of every link, for clearance"),
    ),
    determinants=("actuation",),
    singularities=(
        Singularity("serial", "a strut square to its rail, s_i · e_i = 0", "det B = 0"),
        Singularity("actuation", "the struts' directions in one plane: uncontrolled", "det A = 0"),
    ),
    example=MappingProxyType({"L": 0.31, "d": 0.05}),
    build=build,
    farthest_reach=farthest_reach,
    outer_reach=OuterReach(reach_cones),
    limb_rotation=NEXT_AXIS,
    drawing=Drawing(
        joints=("A", "B"),
        driven="A",
        slides_from="O",
        marks=MappingProxyType({"L": ("A", "B"), "d": ("P", "B"), "q_i": ("O", "A")}),
        pose=(-0.05, -0.09, -0.12),
    ),
)  # fmt: skip
