"""A gantry of three orthogonal slides: the shortest mechanism there is, for the tests of plug-ins.

Slide i moves by k_i q_i along its axis, at most h_i to either side of o_i: x_i = o_i + k_i q_i.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tpm_design.arithmetic import formula, magnitude
from tpm_design.arithmetic.lifting import replaced
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.angles import NEXT_AXIS
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.base import MechanismKind, Parameter, Singularity
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.mechanisms.parameters import enclosed_values, limb_values, three_numbers

SCALE = 1.0


class GantryGeometry(NamedTuple):
    """Middles of the strokes and half strokes (m), transmission ratios."""

    middle: tuple[float, ...]
    half: tuple[float, ...]
    ratio: tuple[float, ...]
    link_radius: float = 0.0


@formula(equations.leg_margins, GantryGeometry)
def _leg_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    o1, o2, o3 = geometry.middle
    h1, h2, h3 = geometry.half
    return h1 - magnitude(x - o1), h2 - magnitude(y - o2), h3 - magnitude(z - o3)


@formula(equations.mode_margins, GantryGeometry)
def _mode_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    return (0.0 * x + 1.0,)


@formula(equations.serial_margins, GantryGeometry)
def _serial_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    one = 0.0 * x + 1.0
    return one, one, one


@formula(equations.length_error_gains, GantryGeometry)
def _length_error_gains(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    return equations.serial_margins(geometry, mode, x, y, z)


@formula(equations.joint_centres, GantryGeometry)
def _joint_centres(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    nil = 0.0 * x
    o1, o2, o3 = geometry.middle
    return (
        ((nil + o1, nil, nil), (x, nil, nil)),
        ((x, nil + o2, nil), (x, y, nil)),
        ((x, y, nil + o3), (x, y, z)),
    )


@formula(equations.unit_velocity_map, GantryGeometry)
def _unit_velocity_map(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    nil, one = 0.0 * x, 0.0 * x + 1.0
    k1, k2, k3 = geometry.ratio
    entries = (SCALE * k1 * one, SCALE * k2 * one, SCALE * k3 * one)
    return ((one, nil, nil), (nil, one, nil), (nil, nil, one)), entries, (one, one, one)


@formula(equations.actuators, GantryGeometry)
def _actuators(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    k1, k2, k3 = geometry.ratio
    o1, o2, o3 = geometry.middle
    return (x - o1) / (SCALE * k1), (y - o2) / (SCALE * k2), (z - o3) / (SCALE * k3)


@formula(equations.limb_parameters, GantryGeometry)
def _limb_parameters(geometry, limb):  # type: ignore[no-untyped-def]
    return geometry.middle[limb], geometry.half[limb], geometry.ratio[limb]


@formula(equations.with_limb_parameters, GantryGeometry)
def _with_limb_parameters(geometry, limb, values):  # type: ignore[no-untyped-def]
    return GantryGeometry(
        replaced(geometry.middle, limb, values[0]),
        replaced(geometry.half, limb, values[1]),
        replaced(geometry.ratio, limb, values[2]),
        geometry.link_radius,
    )


@dataclass(frozen=True)
class Gantry(Mechanism):
    """A gantry with dimensions."""

    geometry: GantryGeometry

    def reach_radius(self) -> float:
        return float(np.linalg.norm(np.abs(self.geometry.middle) + np.array(self.geometry.half)))

    def enclosed_geometry(self, tolerance: Mapping[str, float]) -> Any:
        held = enclosed_values(self.kind, self.parameters, tolerance)
        return self.geometry._replace(middle=held["o"], half=held["h"], ratio=held["k"])

    def assemblies(self, q: Any, mode: Mode | None = None, *, drive: str = "motor") -> tuple[Assembly, ...]:
        self.motor_weight(drive)
        travel = np.array(self.geometry.ratio) * SCALE * three_numbers(q, "q", "Give three numbers in m.")
        if (np.abs(travel) > self.geometry.half).any():
            return ()
        x, y, z = (float(value) for value in self.geometry.middle + travel)
        return (Assembly((x, y, z), ((x, x), (y, y), (z, z)), False),)


def build(parameters: Mapping[str, Any], limits: Mapping[str, Any]) -> Gantry:
    values = limb_values(KIND, parameters)
    return Gantry(KIND, values, GantryGeometry(values["o"], values["h"], values["k"]))


def farthest_reach(ranges: Mapping[str, tuple[float, float]]) -> float:
    lengths = [max(abs(low), abs(high)) for name, (low, high) in ranges.items() if not name.startswith("k")]
    return 2.0 * sum(lengths)


KIND = MechanismKind(
    name="gantry",
    title="Gantry of three slides",
    source="own derivation",
    parameters=(
        Parameter("o", "o_i", "length", "any", "middle of the stroke of the slide"),
        Parameter("h", "h_i", "length", "positive", "half the stroke of the slide", moving_link=True),
        Parameter("k", "k_i", "ratio", "positive", "travel of the slide by travel of the drive"),
    ),
    pose=("x", "y", "z"),
    actuator_unit="m",
    drives=("motor",),
    mode_fields=(),
    limits=(),
    determinants=("actuation",),
    singularities=(Singularity("actuation", "none: the axes are at right angles", "det = 1"),),
    example={"o": 0.0, "h": 0.2, "k": 1.0},
    build=build,
    farthest_reach=farthest_reach,
    limb_rotation=NEXT_AXIS,
)
