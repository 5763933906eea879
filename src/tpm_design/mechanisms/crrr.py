"""3-CRRR: the 3-CRR with an idle revolute joint on the platform in each limb, free of overconstraint.

Source: X. Kong, C. M. Gosselin, Kinematics and Singularity Analysis of a Novel Type of 3-CRR 3-DOF
Translational Parallel Manipulator, Int. J. Robotics Research 21(9), 2002, section 8.2.2: the idle joints
never turn, so that it moves as the 3-CRR does. Each limb keeps the platform from turning about one direction
alone, square to all its axes; these three must not be parallel to one plane.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from tpm_design.arithmetic import Interval, formula, root, sqr
from tpm_design.arithmetic.algebra import determinant
from tpm_design.arithmetic.lifting import replaced
from tpm_design.errors import ParameterError
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.angles import NEXT_AXIS, QUARTER, enclosed_unit_vector, unit_vector
from tpm_design.mechanisms.axis_limb_machines import (
    DRAWING,
    LIMITS,
    MODE_FIELDS,
    OUTER_REACH,
    PARAMETERS,
    PLANE,
    SINGULARITIES,
    AxisLimbMechanism,
    checked_axes,
    cross,
    determinant_of,
    farthest_reach_of,
    limb_directions,
    limb_geometry,
)
from tpm_design.mechanisms.axis_limbs import LimbDirections, LimbLimits, Triple, axis_limb_equations
from tpm_design.mechanisms.base import MechanismKind, Parameter, Singularity
from tpm_design.mechanisms.parameters import limb_values


class CrrrGeometry(NamedTuple):
    """As ``AxisLimbGeometry``. ``rotation``: det of the unit vectors about which the limbs keep the platform
    from turning."""

    first: Triple
    second: Triple
    offset_x: Triple
    offset_y: Triple
    offset_z: Triple
    platform: tuple[Triple, ...]
    directions: LimbDirections
    limits: LimbLimits
    link_radius: float
    rotation: Any


axis_limb_equations(CrrrGeometry)


@formula(equations.with_limb_parameters, CrrrGeometry)
def _with_limb_parameters(geometry, limb, values):  # type: ignore[no-untyped-def]
    """f, r, and a − b of one limb replaced."""
    return CrrrGeometry(
        replaced(geometry.first, limb, values[0]),
        replaced(geometry.second, limb, values[1]),
        replaced(geometry.offset_x, limb, values[2]),
        replaced(geometry.offset_y, limb, values[3]),
        replaced(geometry.offset_z, limb, values[4]),
        geometry.platform,
        geometry.directions,
        geometry.limits,
        geometry.link_radius,
        geometry.rotation,
    )


@formula(equations.singularity_margins, CrrrGeometry)
def _singularity_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """det of the axes, det of n_i = s_i × t_i, normalised: both constant."""
    (a, b, c), _, _ = equations.unit_velocity_map(geometry, mode, 1.0, x, y, z)
    return (
        determinant(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]),
        geometry.rotation + 0.0 * x,
    )


class Crrr(AxisLimbMechanism):
    """A 3-CRRR with dimensions. Pose: (x, y, z) of the platform's point P."""

    def enclosed_geometry(self, tolerance: Mapping[str, float]) -> Any:
        enclosed = super().enclosed_geometry(tolerance)
        axes, idle = enclosed.directions.axis, _idle_axes(self.parameters, enclosed=True)
        return enclosed._replace(rotation=determinant_of(_normals(axes, idle)))


def _idle_axes(parameters: Mapping[str, tuple[float, ...]], *, enclosed: bool = False) -> list[Any]:
    """t_i as floats or Intervals."""
    direction: Any = enclosed_unit_vector if enclosed else unit_vector
    angles = zip(parameters["idle_azimuth"], parameters["idle_elevation"], strict=True)
    return [direction(azimuth, elevation) for azimuth, elevation in angles]


def _normals(axes: Sequence[Any], idle: Sequence[Any]) -> list[tuple[Any, ...]]:
    """n_i = s_i × t_i, normalised. Raises ParameterError where they are parallel."""
    found = []
    for limb, (axis, other) in enumerate(zip(axes, idle, strict=True)):
        normal = cross(axis, other)
        length = root(sqr(normal[0]) + sqr(normal[1]) + sqr(normal[2]))
        if not isinstance(length, Interval) and length < PLANE:
            raise ParameterError(
                f"crrr: the idle joint of limb {limb + 1} is parallel to the limb's other axes "
                "(Kong, Gosselin 2002, section 8.2.2).",
                remedy="Turn it away with idle_azimuth and idle_elevation.",
            )
        found.append(tuple(side / length for side in normal))
    return found


def build(parameters: Mapping[str, float | Sequence[float]], limits: Mapping[str, Any]) -> Crrr:
    """A 3-CRRR from SI values: f, r, ax … bz (m), azimuth, elevation, idle_azimuth, idle_elevation (rad),
    each one number or three; limits as declared.

    Raises ParameterError on dimensions that cannot be: axes parallel to one plane, an idle joint parallel to
    the axes of its limb, limbs that all leave one rotation free.
    """
    values = limb_values(KIND, parameters)
    checked_axes(KIND.name, values)
    directions = limb_directions(values)
    rotation = determinant_of(_normals(directions.axis, _idle_axes(values)))
    if abs(rotation) < PLANE:
        raise ParameterError(
            "crrr: the directions s_i × t_i are all parallel to one plane: at every pose the platform is "
            "free to turn, a rotation singularity that is permanent (Kong, Gosselin 2002, section 8.2.2).",
            remedy="Turn an idle joint with idle_azimuth and idle_elevation.",
        )
    geometry = CrrrGeometry(*limb_geometry(values, directions, limits), rotation=rotation)
    return Crrr(kind=KIND, parameters=values, geometry=geometry, limits=limits)


def farthest_reach(ranges: Mapping[str, tuple[float, float]]) -> float:
    """The point of three cylinders about the axes that is farthest away (m), for the longest links."""
    return farthest_reach_of(KIND, ranges)


KIND = MechanismKind(
    name="crrr",
    title="3-CRRR",
    source="X. Kong, C. M. Gosselin, Int. J. Robotics Research 21(9), 2002, section 8.2.2",
    parameters=(
        *PARAMETERS,
        Parameter(
            "idle_azimuth", "φ_ti", "angle", "any", "direction of the idle axis t_i about z, from x",
            default=(QUARTER, 0.0, 0.0),
        ),
        Parameter(
            "idle_elevation", "λ_ti", "angle", "any", "idle axis t_i above the plane z = 0",
            default=(0.0, QUARTER, 0.0),
        ),
    ),
    pose=("x", "y", "z"),
    actuator_unit="m",
    drives=("motor",),
    mode_fields=MODE_FIELDS,
    limits=LIMITS,
    determinants=("actuation", "rotation"),
    singularities=(
        *SINGULARITIES,
        Singularity(
            "rotation", "det of the unit vectors along s_i × t_i, constant: platform free to turn",
            "section 8.2.2",
        ),
    ),
    example=MappingProxyType({"f": 0.2, "r": 0.2}),
    build=build,
    farthest_reach=farthest_reach,
    outer_reach=OUTER_REACH,
    limb_rotation=NEXT_AXIS,
    drawing=DRAWING,
)  # fmt: skip
