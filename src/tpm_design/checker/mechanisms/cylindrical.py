"""3-CRR and its variants: two links in a plane that a joint moves across the plane's normal s_i.

Source: X. Kong and C. M. Gosselin, "Kinematics and Singularity Analysis of a Novel Type of 3-CRR 3-DOF
Translational Parallel Manipulator", Int. J. Robotics Research 21(9), 791–798, 2002. With v the vector from
base point to platform point: S_i = s_i·v along the C joint; ``prrr``: S_i = s_i·v/(s_i·d_i) along a P joint
of direction d_i; ``crrr``: an idle R joint of axis t_i at the platform. Base and platform points matter by
their difference alone, which is one variable per axis here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from flint import arb

from tpm_design.checker.balls import (
    Enclosure,
    Triple,
    combination,
    constant,
    determinant,
    direction,
    inverse,
    magnitude,
    square,
)
from tpm_design.checker.mechanisms.angles import QUARTER, Vector, exact_angle
from tpm_design.checker.mechanisms.configuration import (
    AXES,
    LIMBS,
    Configuration,
    Margin,
    Setting,
    Velocity,
)
from tpm_design.checker.mechanisms.mechanism import (
    ANGLE,
    LENGTH,
    Limit,
    Made,
    Mechanism,
    ModeField,
    Parameter,
    Sizes,
    Values,
)

ONE, TWO = arb(1), arb(2)
X_Y_Z: tuple[Values, Values] = ((0.0, QUARTER, 0.0), (0.0, 0.0, QUARTER))
Y_Z_X: tuple[Values, Values] = ((QUARTER, 0.0, 0.0), (0.0, QUARTER, 0.0))
"""Azimuths and elevations of three axes."""


class Line(NamedTuple):
    """Of one limb: ``travel``·v is S_i, ``across``·v the components of the plane of the links."""

    axis: Vector
    travel: Vector
    across: tuple[Vector, Vector]
    driven: arb


class Links(NamedTuple):
    """ρ, the distance of the links' ends, and the cosine of the interior angle of the elbow, 1 if folded."""

    f: Enclosure
    r: Enclosure
    rho: Enclosure
    elbow_cosine: Enclosure


@dataclass(frozen=True, kw_only=True)
class CylindricalSetting(Setting):
    """``bounds``: of S_i, and of the cosine of the elbow, by the margin that keeps them."""

    lines: tuple[Line, ...]
    idle_normals: tuple[Vector, ...]
    bounds: dict[str, arb]


class Cylindrical(Configuration):
    setting: CylindricalSetting

    def _reached(self, limb: int) -> Triple:
        """From base point to platform point."""
        x, y, z = (
            part + self.size(f"offset_{axis}", limb) for part, axis in zip(self.pose, AXES, strict=True)
        )
        return x, y, z

    @cached_property
    def links(self) -> tuple[Links, ...]:
        return tuple(self._links(limb) for limb in LIMBS)

    def _links(self, limb: int) -> Links:
        f, r, reached = self.size("f", limb), self.size("r", limb), self._reached(limb)
        u, v = (combination(form, reached) for form in self.setting.lines[limb].across)
        rho = direction(u, v)[2]
        cos = (square(f) + square(r) - square(u) - square(v)) / (f * r).times(TWO)
        return Links(f, r, rho, cos)

    def margin(self, which: Margin) -> Enclosure:
        """f_i + r_i − ρ_i and ρ_i − |f_i − r_i|, times |s_i·d_i|, as ρ_i grows by at most 1/|s_i·d_i| of
        the way of the pose; the stroke; the angle of the elbow by its cosine."""
        name, limb = which
        if name.startswith("stroke"):
            travel = combination(self.setting.lines[limb].travel, self._reached(limb))
            bound = constant(self.setting.bounds[name])
            return travel - bound if name == "stroke min" else bound - travel
        f, r, rho, cos = self.links[limb]
        if name.startswith("elbow"):
            bound = constant(self.setting.bounds[name])
            return bound - cos if name == "elbow min" else cos - bound
        spare = f + r - rho if name == "stretched" else rho - magnitude(f - r)
        return spare.times(abs(self.setting.lines[limb].driven))

    def unit_determinant(self, name: str) -> Enclosure:
        """det[s_1 s_2 s_3], and that of the normals n_i of s_i and t_i."""
        if name == "rotation":
            return determinant([fixed(normal) for normal in self.setting.idle_normals])
        return determinant(self.velocity("motor").rows)

    def velocity(self, drive: str) -> Velocity:
        """s_i·ẋ = (s_i·d_i) Ṡ_i, d_i = s_i for a C joint."""
        first, second, third = (fixed(line.axis) for line in self.setting.lines)
        b1, b2, b3 = (constant(line.driven) for line in self.setting.lines)
        return Velocity((first, second, third), (constant(ONE),) * 3, (b1, b2, b3))

    def serial_squared(self, limb: int) -> Enclosure:
        """sin² of the elbow."""
        return constant(ONE) - square(self.links[limb].elbow_cosine)

    def input_transmission_squared(self, limb: int) -> Enclosure:
        """s_i·d_i: along its own row where the joint is a C joint."""
        return square(constant(self.setting.lines[limb].driven))

    def length_error_gain_squared(self, limb: int) -> Enclosure:
        """s_i·dx = s_i·(da_i0 − db_i): the links matter to reach alone."""
        return constant(TWO)


def fixed(vector: Vector) -> Triple:
    x, y, z = (constant(part) for part in vector)
    return x, y, z


def axes_of(made: Made, prefix: str, limb: int) -> tuple[Vector, Vector, Vector]:
    """A unit vector by azimuth and elevation, and two more that are at right angles to it and each other."""
    azimuth = exact_angle(made.parameters[f"{prefix}azimuth"][limb])
    elevation = exact_angle(made.parameters[f"{prefix}elevation"][limb])
    return (
        (elevation.cos * azimuth.cos, elevation.cos * azimuth.sin, elevation.sin),
        (-azimuth.sin, azimuth.cos, arb(0)),
        (-elevation.sin * azimuth.cos, -elevation.sin * azimuth.sin, elevation.cos),
    )


def inner(u: Vector, v: Vector) -> arb:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def line_of(made: Made, slide: str | None, limb: int) -> Line:
    """``slide``: the prefix of the P joint's angles, None for a C joint."""
    axis, *across = axes_of(made, "", limb)
    if slide is None:
        return Line(axis, axis, (across[0], across[1]), ONE)
    along = axes_of(made, slide, limb)[0]
    driven = inner(axis, along)
    travel = times(axis, inverse(driven))
    # the plane's components of v − S d
    first, second = (minus(toward, times(travel, inner(toward, along))) for toward in across)
    return Line(axis, travel, (first, second), driven)


def times(u: Vector, factor: arb) -> Vector:
    return u[0] * factor, u[1] * factor, u[2] * factor


def minus(u: Vector, v: Vector) -> Vector:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def idle_normal(made: Made, limb: int) -> Vector:
    s, t = axes_of(made, "", limb)[0], axes_of(made, "idle_", limb)[0]
    across = (s[1] * t[2] - s[2] * t[1], s[2] * t[0] - s[0] * t[2], s[0] * t[1] - s[1] * t[0])
    length_squared = inner(across, across)
    return times(across, inverse(length_squared.sqrt()) if length_squared > 0 else arb.nan())


def bounds_of(made: Made) -> dict[str, arb]:
    """An elbow is never less than folded nor more than stretched."""
    found: dict[str, arb] = {}
    stroke, elbow = made.range("stroke"), made.range("elbow")
    if stroke is not None:
        found |= {"stroke min": arb(stroke[0]), "stroke max": arb(stroke[1])}
    if elbow is not None:
        low, high = arb(elbow[0]), arb(elbow[1])
        if not low <= 0:
            found["elbow min"] = low.cos()
        if not high >= arb.pi():
            found["elbow max"] = high.cos()
    return found


def passes_its_fold(made: Made, limb: int) -> bool:
    """Whether a limb of equal links may be folded, so that there is no inner bound of its reach."""
    equal = made.parameters["f"][limb] == made.parameters["r"][limb]
    loose = any(made.tolerances[name][limb] != 0.0 for name in ("f", "r"))
    return made.limits.get("fold", True) is False and equal and not loose


def describe(made: Made, slide: str | None, idle: bool) -> tuple[Setting, Sizes]:
    bounds = bounds_of(made)
    setting = CylindricalSetting(
        reach=tuple(
            Margin(end, limb)
            for limb in LIMBS
            for end in ("stretched", "folded")
            if end == "stretched" or not passes_its_fold(made, limb)
        ),
        within=tuple(Margin(name, limb) for limb in LIMBS for name in bounds),
        folds=tuple(Margin("folded", limb) for limb in LIMBS if made.limits.get("fold", True) is not False),
        lines=tuple(line_of(made, slide, limb) for limb in LIMBS),
        idle_normals=tuple(idle_normal(made, limb) for limb in LIMBS) if idle else (),
        bounds=bounds,
    )
    offsets = {
        f"offset_{axis}{limb + 1}": made.difference(f"b{axis}", f"a{axis}", limb)
        for axis in AXES
        for limb in LIMBS
    }
    return setting, made.spans("f", "r") | offsets


def describe_crr(made: Made) -> tuple[Setting, Sizes]:
    return describe(made, None, idle=False)


def describe_prrr(made: Made) -> tuple[Setting, Sizes]:
    return describe(made, "slide_", idle=False)


def describe_crrr(made: Made) -> tuple[Setting, Sizes]:
    return describe(made, None, idle=True)


def directions(prefix: str, default: tuple[Values, Values]) -> tuple[Parameter, Parameter]:
    azimuths, elevations = default
    return (
        Parameter(f"{prefix}azimuth", ANGLE, "any", azimuths),
        Parameter(f"{prefix}elevation", ANGLE, "any", elevations),
    )


def variant(
    name: str,
    describe: Callable[[Made], tuple[Setting, Sizes]],
    more: Sequence[Parameter] = (),
    determinants: tuple[str, ...] = ("actuation",),
) -> Mechanism:
    return Mechanism(
        name=name,
        parameters=(
            Parameter("f", LENGTH, "positive"),
            Parameter("r", LENGTH, "positive"),
            *directions("", X_Y_Z),
            *(Parameter(f"{end}{axis}", LENGTH, "any", (0.0, 0.0, 0.0)) for end in "ab" for axis in AXES),
            *more,
        ),
        mode=(ModeField("elbows"),),
        limits={
            "stroke": Limit("range", LENGTH),
            "elbow": Limit("range", ANGLE),
            "fold": Limit("switch"),
            "link_radius": Limit("number", LENGTH),
        },
        drives={"motor": "actuation"},
        determinants=determinants,
        links=("f", "r"),
        actuator=LENGTH,
        configuration=Cylindrical,
        describe=describe,
    )


CRR = variant("crr", describe_crr)
PRRR = variant("prrr", describe_prrr, directions("slide_", X_Y_Z))
CRRR = variant("crrr", describe_crrr, directions("idle_", Y_Z_X), ("actuation", "rotation"))
