"""3-PRRR: the variant of the 3-CRR whose carriages move along directions of their own.

Source: X. Kong, C. M. Gosselin, Kinematics and Singularity Analysis of a Novel Type of 3-CRR 3-DOF
Translational Parallel Manipulator, Int. J. Robotics Research 21(9), 2002, section 8.2.1: the P joint must not
be perpendicular to the axes of its limb; with all P joints parallel the workspace grows with the stroke.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

from tpm_design.errors import ParameterError
from tpm_design.mechanisms.angles import NEXT_AXIS, QUARTER
from tpm_design.mechanisms.axis_limb_machines import (
    DRAWING,
    LIMITS,
    MODE_FIELDS,
    PARAMETERS,
    PLANE,
    SINGULARITIES,
    AxisLimbMechanism,
    checked_axes,
    farthest_reach_of,
    limb_directions,
    limb_geometry,
    reach_bound,
    reach_cones_of,
    slide_advance,
)
from tpm_design.mechanisms.base import MechanismKind, Parameter
from tpm_design.mechanisms.outer_reach import OuterReach
from tpm_design.mechanisms.parameters import limb_values


def build(parameters: Mapping[str, float | Sequence[float]], limits: Mapping[str, Any]) -> AxisLimbMechanism:
    """A 3-PRRR from SI values: f, r, ax … bz (m), azimuth, elevation, slide_azimuth, slide_elevation (rad),
    each one number or three; limits as declared.

    Raises ParameterError on dimensions that cannot be: axes parallel to one plane, a P joint perpendicular to
    its limb's axes, P joints that are all parallel without a limit of their stroke.
    """
    values = limb_values(KIND, parameters)
    checked_axes(KIND.name, values)
    for limb in range(3):
        if abs(slide_advance(values, limb)) < PLANE:
            raise ParameterError(
                f"prrr: the P joint of limb {limb + 1} is perpendicular to the limb's axes, so that it "
                "cannot drive the limb along them (Kong, Gosselin 2002, section 8.2.1).",
                remedy="Turn it towards the axis with slide_azimuth and slide_elevation.",
            )
    directions = limb_directions(values, slides=True)
    if math.isinf(reach_bound(values, directions, limits)):
        raise ParameterError(
            "prrr: all P joints are parallel and have no ends, so that the workspace has none either: it "
            "grows with the stroke (Kong, Gosselin 2002, section 8.2.1).",
            remedy="Give the limit `stroke: {min: …, max: …}`.",
        )
    geometry = limb_geometry(values, directions, limits)
    return AxisLimbMechanism(kind=KIND, parameters=values, geometry=geometry, limits=limits)


def farthest_reach(ranges: Mapping[str, tuple[float, float]]) -> float:
    """The point of three cylinders about the P joints that is farthest away (m), for the longest links."""
    return farthest_reach_of(KIND, ranges, slide="slide_")


KIND = MechanismKind(
    name="prrr",
    title="3-PRRR",
    source="X. Kong, C. M. Gosselin, Int. J. Robotics Research 21(9), 2002, section 8.2.1",
    parameters=(
        *PARAMETERS,
        Parameter(
            "slide_azimuth", "φ_di", "angle", "any", "direction of the P joint d_i about z, from x",
            default=(0.0, QUARTER, 0.0),
        ),
        Parameter(
            "slide_elevation", "λ_di", "angle", "any", "P joint d_i above the plane z = 0",
            default=(0.0, 0.0, QUARTER),
        ),
    ),
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
    outer_reach=OuterReach(
        partial(reach_cones_of, slides=True), ("azimuth", "elevation", "slide_azimuth", "slide_elevation")
    ),
    limb_rotation=NEXT_AXIS,
    drawing=DRAWING,
)  # fmt: skip
