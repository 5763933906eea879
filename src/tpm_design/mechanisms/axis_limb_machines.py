"""Machines of three limbs driven along an axis and free across it: what their mechanisms declare and do.

Source: X. Kong, C. M. Gosselin, Kinematics and Singularity Analysis of a Novel Type of 3-CRR 3-DOF
Translational Parallel Manipulator, Int. J. Robotics Research 21(9), 2002.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from numpy.typing import ArrayLike

from tpm_design.arithmetic import Interval
from tpm_design.errors import ParameterError
from tpm_design.mechanisms import forward
from tpm_design.mechanisms.angles import QUARTER, cosine_sine, enclosed_cosine_sine, unit_vector
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.axis_limbs import AxisLimbGeometry, ElbowSigns, LimbDirections, LimbLimits
from tpm_design.mechanisms.base import Drawing, Limit, MechanismKind, ModeField, Parameter, Singularity
from tpm_design.mechanisms.cylinders import reach_of_cylinders
from tpm_design.mechanisms.fold_lines import FoldLine, Vector
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.mechanisms.outer_reach import OuterReach, ReachCone, Values, axis_limb_cones
from tpm_design.mechanisms.parameters import enclosed_values, three_numbers

# determinants and sines of directions below it count as zero
PLANE = 1e-9

BASE = ("ax", "ay", "az")
PLATFORM = ("bx", "by", "bz")


def cross(u: Sequence[Any], v: Sequence[Any]) -> tuple[Any, Any, Any]:
    """u × v of floats or Intervals."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def dot(u: Sequence[Any], v: Sequence[Any]) -> Any:
    """u · v of floats or Intervals."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def determinant_of(rows: Sequence[Sequence[Any]]) -> Any:
    """det of three rows of floats or Intervals."""
    return dot(rows[0], cross(rows[1], rows[2]))


def limb_directions(
    parameters: Mapping[str, tuple[float, ...]], *, slides: bool = False, enclosed: bool = False
) -> LimbDirections:
    """Directions of all limbs from their angles; ``slides``: carriages move along directions of their own.
    ``enclosed``: as Intervals."""
    turn: Any = enclosed_cosine_sine if enclosed else cosine_sine
    zero: Any = Interval(0.0, 0.0) if enclosed else 0.0
    one: Any = Interval(1.0, 1.0) if enclosed else 1.0
    found = []
    for limb in range(3):
        (ca, sa), (ce, se) = turn(parameters["azimuth"][limb]), turn(parameters["elevation"][limb])
        axis, across, beyond = (ca * ce, sa * ce, se), (-sa, ca, zero), (-(se * ca), -(se * sa), ce)
        if not slides:
            found.append((axis, axis, one, across, beyond, across, beyond))
            continue
        (ca, sa), (ce, se) = (
            turn(parameters["slide_azimuth"][limb]),
            turn(parameters["slide_elevation"][limb]),
        )
        slide = (ca * ce, sa * ce, se)
        advance = dot(axis, slide)
        first, second = (
            tuple(u - dot(unit, slide) / advance * s for u, s in zip(unit, axis, strict=True))
            for unit in (across, beyond)
        )
        found.append((axis, slide, advance, across, beyond, first, second))
    return LimbDirections(*zip(*found, strict=True))


def slide_advance(parameters: Mapping[str, tuple[float, ...]], limb: int) -> float:
    """s_i · d_i of one limb whose carriage moves along a direction of its own."""
    axis = unit_vector(parameters["azimuth"][limb], parameters["elevation"][limb])
    slide = unit_vector(parameters["slide_azimuth"][limb], parameters["slide_elevation"][limb])
    return float(dot(axis, slide))


def checked_axes(kind_name: str, parameters: Mapping[str, tuple[float, ...]]) -> None:
    """Raises ParameterError where the axes are parallel to one plane (section 5.3 of the source)."""
    determinant = determinant_of(limb_directions(parameters).axis)
    if abs(determinant) < PLANE:
        raise ParameterError(
            f"{kind_name}: the axes s_i are all parallel to one plane, so that the matrix of their "
            "directions is singular: the three translations along them cannot all be actuated at once, and "
            "nothing drives the platform square to that plane (Kong, Gosselin 2002, section 5.3).",
            remedy="Turn one axis out of the plane with azimuth and elevation.",
        )


def limb_limits(parameters: Mapping[str, tuple[float, ...]], limits: Mapping[str, Any]) -> LimbLimits:
    """The limits of all limbs. Raises ParameterError on angles that links cannot have."""
    low, high = limits.get("stroke", (0.0, 0.0))
    folded, stretched = limits.get("elbow", (0.0, math.pi))
    if folded < 0.0 or stretched > math.pi * (1.0 + 1e-15):
        raise ParameterError(
            f"The limit elbow is from {math.degrees(folded):g}° to {math.degrees(stretched):g}°.",
            remedy="It is the angle between the links: 0 folded, 180° stretched.",
        )
    pairs = zip(parameters["f"], parameters["r"], strict=True)
    return LimbLimits(
        hole=tuple(1.0 if limits.get("fold", True) or f != r else 0.0 for f, r in pairs),
        stroke_limited=1.0 if "stroke" in limits else 0.0,
        lowest=float(low),
        highest=float(high),
        folded_limited=1.0 if folded > 0.0 else 0.0,
        folded=1.0 - cosine_sine(folded)[0],
        stretched_limited=1.0 if stretched < math.pi else 0.0,
        stretched=1.0 - cosine_sine(stretched)[0],
    )


def point_fields(parameters: Mapping[str, tuple[Any, ...]]) -> dict[str, Any]:
    """Base and platform points as fields of the geometry, of floats or Intervals."""
    fields: dict[str, Any] = {
        f"offset_{a[1]}": tuple(x - y for x, y in zip(parameters[a], parameters[b], strict=True))
        for a, b in zip(BASE, PLATFORM, strict=True)
    }
    return fields | {"platform": tuple(zip(*(parameters[name] for name in PLATFORM), strict=True))}


def limb_geometry(
    parameters: Mapping[str, tuple[float, ...]], directions: LimbDirections, limits: Mapping[str, Any]
) -> AxisLimbGeometry:
    """The geometry for the kernels. Raises ParameterError on limits that cannot be."""
    return AxisLimbGeometry(
        first=parameters["f"],
        second=parameters["r"],
        **point_fields(parameters),
        directions=directions,
        limits=limb_limits(parameters, limits),
        link_radius=float(limits.get("link_radius", 0.0)),
    )


def offsets_of(parameters: Mapping[str, tuple[float, ...]]) -> list[Vector]:
    """a_i0 − b_i of each limb (m): where P is with the platform joint at the base point."""
    fields = point_fields(parameters)
    return list(zip(fields["offset_x"], fields["offset_y"], fields["offset_z"], strict=True))


def reach_bound(
    parameters: Mapping[str, tuple[float, ...]], directions: LimbDirections, limits: Mapping[str, Any]
) -> float:
    """Every reachable pose is within this distance (m) of the origin; infinite where nothing ends the reach:
    slides that are all parallel, without limits of their strokes.

    The platform joint is no farther than f + r from the line of the carriage, nor from the carriage.
    """
    offsets = offsets_of(parameters)
    radii = [f + r for f, r in zip(parameters["f"], parameters["r"], strict=True)]
    slides = [(float(x), float(y), float(z)) for x, y, z in directions.slide]
    bound = reach_of_cylinders(offsets, slides, radii)
    if "stroke" in limits:
        travel = max(abs(end) for end in limits["stroke"])
        bound = min(
            bound, *(math.hypot(*o) + travel + radius for o, radius in zip(offsets, radii, strict=True))
        )
    return bound


@dataclass(frozen=True)
class AxisLimbMechanism(Mechanism):
    """A machine of such limbs with dimensions. Pose: (x, y, z) of the platform's point P."""

    signs_class = ElbowSigns

    limits: Mapping[str, Any]

    def mode(self, *, elbows: str = "+++") -> Mode:
        """The working mode with each elbow to the left (+) or right (−) of the way from carriage to platform,
        seen against the axis. Raises ParameterError on anything but three signs."""
        return self.mode_of({"elbows": elbows})

    @property
    def slides(self) -> bool:
        """Whether carriages move along directions of their own."""
        return "slide_azimuth" in self.parameters

    def reach_radius(self) -> float:
        return reach_bound(self.parameters, self.geometry.directions, self.limits)

    def fold_lines(self) -> tuple[FoldLine, ...]:
        """Where the links of a limb lie on each other, unless the limit ``fold`` is off."""
        if not self.limits.get("fold", True):
            return ()
        pairs = zip(self.parameters["f"], self.parameters["r"], strict=True)
        lines = zip(offsets_of(self.parameters), self.geometry.directions.slide, pairs, strict=True)
        return tuple(FoldLine(point, slide, abs(f - r)) for point, slide, (f, r) in lines)

    def enclosed_geometry(self, tolerance: Mapping[str, float]) -> Any:
        held = enclosed_values(self.kind, self.parameters, tolerance)
        limits = self.geometry.limits
        pairs = zip(limits.hole, held["f"], held["r"], strict=True)
        enclosed: dict[str, Any] = {
            # links that are as long as each other are so within no tolerance
            "hole": tuple(hole if f.lo == f.hi and r.lo == r.hi else 1.0 for hole, f, r in pairs),
            "folded": 1.0 - enclosed_cosine_sine(self.limits.get("elbow", (0.0, math.pi))[0])[0],
            "stretched": 1.0 - enclosed_cosine_sine(self.limits.get("elbow", (0.0, math.pi))[1])[0],
        }
        intervals: dict[str, Any] = {
            "first": held["f"],
            "second": held["r"],
            **point_fields(held),
            "directions": limb_directions(self.parameters, slides=self.slides, enclosed=True),
            "limits": limits._replace(**enclosed),
        }
        return self.geometry._replace(**intervals)

    def assemblies(
        self, q: ArrayLike, mode: Mode | None = None, *, drive: str = "motor"
    ) -> tuple[Assembly, ...]:
        """The one solution of three linear equations, equation (7) of the source; all elbows reach it."""
        self.motor_weight(drive)
        strokes = three_numbers(q, "q", "Give three strokes in m.")
        enclosed = self.enclosed_geometry({})
        axis = enclosed.directions.axis
        sides = []
        for limb in range(3):
            offset = (enclosed.offset_x[limb], enclosed.offset_y[limb], enclosed.offset_z[limb])
            sides.append(enclosed.directions.advance[limb] * float(strokes[limb]) + dot(axis[limb], offset))
        columns = (cross(axis[1], axis[2]), cross(axis[2], axis[0]), cross(axis[0], axis[1]))
        scale = dot(axis[0], columns[0])
        found = [dot(sides, [column[k] for column in columns]) / scale for k in range(3)]
        x, y, z = (0.5 * (side.lo + side.hi) for side in found)
        only = Assembly((x, y, z), tuple((side.lo, side.hi) for side in found), unique=True)
        modes = [ElbowSigns((1.0, 1.0, 1.0))] if mode is None else [mode.signs]
        return forward.confirmed(self, [only], modes, strokes, 1.0, 0.0)


def farthest_reach_of(
    kind: MechanismKind, ranges: Mapping[str, tuple[float, float]], *, slide: str = ""
) -> float:
    """``MechanismKind.farthest_reach`` for carriages along the directions of the angles ``{slide}azimuth``
    and ``{slide}elevation``; infinite where these are free."""

    def of_limb(name: str, limb: int) -> tuple[float, float]:
        default = (kind.parameter(name) or kind.parameters[0]).default or (0.0, 0.0, 0.0)
        return ranges.get(f"{name}{limb + 1}", ranges.get(name, (default[limb], default[limb])))

    radii, axes = [], []
    for limb in range(3):
        reach = of_limb("f", limb)[1] + of_limb("r", limb)[1]
        base, platform = ([of_limb(name, limb) for name in names] for names in (BASE, PLATFORM))
        farthest = [max(a[1] - b[0], b[1] - a[0]) for a, b in zip(base, platform, strict=True)]
        radii.append(reach + math.hypot(*farthest))
        angles = [of_limb(f"{slide}{name}", limb) for name in ("azimuth", "elevation")]
        if any(low != high for low, high in angles):
            return math.inf
        (ca, sa), (ce, se) = (cosine_sine(low) for low, _ in angles)
        axes.append((ca * ce, sa * ce, se))
    # a cylinder about an axis elsewhere is within a wider one about the parallel through the origin
    return reach_of_cylinders([(0.0, 0.0, 0.0)] * 3, axes, radii)


def reach_cones_of(
    values: Values, limits: Mapping[str, Any], *, slides: bool = False
) -> tuple[ReachCone, ...]:
    """ρ_i ≤ f_i + r_i, and the ends of the strokes; ``slides`` as for ``limb_directions``."""
    directions = limb_directions(values, slides=slides)
    forms = list(zip(directions.first_form, directions.second_form, strict=True))
    strokes = [
        [side / advance for side in axis]
        for axis, advance in zip(directions.axis, directions.advance, strict=True)
    ]
    return axis_limb_cones(forms, strokes, limits)


OUTER_REACH = OuterReach(reach_cones_of, ("azimuth", "elevation"))

NOWHERE = (0.0, 0.0, 0.0)

PARAMETERS = (
    Parameter("f", "f_i", "length", "positive", "link from the carriage to the elbow", moving_link=True),
    Parameter("r", "r_i", "length", "positive", "link from the elbow to the platform", moving_link=True),
    Parameter(
        "azimuth", "φ_i", "angle", "any", "direction of the axis s_i about z, from x",
        default=(0.0, QUARTER, 0.0),
    ),
    Parameter(
        "elevation", "λ_i", "angle", "any", "axis s_i above the plane z = 0", default=(0.0, 0.0, QUARTER)
    ),
    *(
        Parameter(
            name, f"a_{name[1]}i", "length", "any", f"{name[1]} of the base point a_i0", default=NOWHERE
        )
        for name in BASE
    ),
    *(
        Parameter(
            name, f"b_{name[1]}i", "length", "any", f"{name[1]} of the platform point b_i, from P",
            default=NOWHERE,
        )
        for name in PLATFORM
    ),
)  # fmt: skip

MODE_FIELDS = (
    ModeField("elbows", 3, "elbow of each limb; + is left of carriage → platform, seen against the axis"),
)

LIMITS = (
    Limit("stroke", "length", "range", "stroke S_i of each carriage"),
    Limit("elbow", "angle", "range", "angle between the links of each limb, 0 folded, 180° stretched"),
    Limit("fold", "ratio", "switch", "whether folded poses bound the region (default true)"),
    Limit("link_radius", "length", "number", "radius of every link, for clearance"),
)

SINGULARITIES = (
    Singularity("serial", "a limb stretched or folded: |sin| of its elbow is 0", "section 6.1"),
    Singularity("actuation", "det of the axes' directions, constant: never 0", "section 5.3"),
)

DRAWING = Drawing(
    joints=("C", "E", "B"),
    driven="C",
    slides_from="A",
    marks=MappingProxyType(
        {
            "f": ("C", "E"),
            "r": ("E", "B"),
            "S_i": ("A", "C"),
            "ax": ("O", "+x"),
            "ay": ("O", "+y"),
            "az": ("O", "+z"),
            "bx": ("P", "+x"),
            "by": ("P", "+y"),
            "bz": ("P", "+z"),
        }
    ),
)
