"""3-CRR: three actuated cylindric joints, their axes not parallel to one plane, and two links from each.

Source: X. Kong, C. M. Gosselin, Kinematics and Singularity Analysis of a Novel Type of 3-CRR 3-DOF
Translational Parallel Manipulator, Int. J. Robotics Research 21(9), 2002. Its Jacobian is constant, it has no
rotation and no actuation singularity, and with axes at right angles it is isotropic everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from tpm_design.mechanisms.angles import NEXT_AXIS
from tpm_design.mechanisms.axis_limb_machines import (
    DRAWING,
    LIMITS,
    MODE_FIELDS,
    OUTER_REACH,
    PARAMETERS,
    SINGULARITIES,
    AxisLimbMechanism,
    checked_axes,
    farthest_reach_of,
    limb_directions,
    limb_geometry,
)
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.mechanisms.parameters import limb_values


def build(parameters: Mapping[str, float | Sequence[float]], limits: Mapping[str, Any]) -> AxisLimbMechanism:
    """A 3-CRR from SI values: f, r, ax … bz (m), azimuth, elevation (rad), each one number or three; limits
    as declared. Raises ParameterError on dimensions that cannot be and on axes parallel to one plane."""
    values = limb_values(KIND, parameters)
    checked_axes(KIND.name, values)
    geometry = limb_geometry(values, limb_directions(values), limits)
    return AxisLimbMechanism(kind=KIND, parameters=values, geometry=geometry, limits=limits)


def farthest_reach(ranges: Mapping[str, tuple[float, float]]) -> float:
    """The point of three cylinders about the axes that is farthest away (m), for the longest links."""
    return farthest_reach_of(KIND, ranges)


KIND = MechanismKind(
    name="crr",
    title="3-CRR",
    source="X. Kong, C. M. Gosselin, Int. J. Robotics Research 21(9), 2002, pp. 791-798",
    parameters=PARAMETERS,
    pose=("x", "y", "z"),
    actuator_unit="m",
    drives=("motor",),
    mode_fields=MODE_FIELDS,
    limits=LIMITS,
    determinants=("actuation",),
    singularities=SINGULARITIES,
    example=MappingProxyType({"f": 0.2, "r": 0.2}),
    build=build,
    farthest_reach=farthest_reach,
    outer_reach=OUTER_REACH,
    limb_rotation=NEXT_AXIS,
    drawing=DRAWING,
)
