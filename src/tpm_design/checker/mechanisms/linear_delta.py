"""The linear DELTA: carriages on three rails, vertical or inclined, parallelograms below them.

Source: R. L. Williams II, "The Delta Parallel Robot: Kinematics Solutions", Ohio University, 2016. Rail i
starts at R ε_i and runs along u_i = sin(tilt) ε_i − cos(tilt) ẑ; the strut ends at p + r ε_i. With
w = p − (R − r) ε_i: q_i = u_i·w ∓ √(l² − |w|² + (u_i·w)²), the carriage above or below the platform.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from flint import arb

from tpm_design.checker.balls import Enclosure, Triple, constant, direction, magnitude, square
from tpm_design.checker.mechanisms.angles import Angle, Azimuth, exact_angle
from tpm_design.checker.mechanisms.configuration import LIMBS, Margin, Setting
from tpm_design.checker.mechanisms.mechanism import (
    ANGLE,
    LENGTH,
    Limit,
    Made,
    Mechanism,
    ModeField,
    Parameter,
    Signs,
    Sizes,
)
from tpm_design.checker.mechanisms.pushing import Push, Pushing, swing_bound
from tpm_design.checker.mechanisms.rails import Strut, reach, strut

ONE, TWO = arb(1), arb(2)
AZIMUTHS = (-2.6179938779914944, -0.5235987755982988, 1.5707963267948966)
"""−150°, −30°, 90°."""


@dataclass(frozen=True, kw_only=True)
class LinearDeltaSetting(Setting):
    carriages: Signs
    azimuths: tuple[Azimuth, ...]
    tilts: tuple[Angle, ...]
    swing: arb | None


class Limb(NamedTuple):
    """w along the rail, across it in the limb's vertical plane, and across that plane."""

    along: Enclosure
    inward: Enclosure
    y: Enclosure
    strut: Strut


class LinearDelta(Pushing):
    setting: LinearDeltaSetting

    @cached_property
    def limbs(self) -> tuple[Limb, ...]:
        return tuple(self._limb(limb) for limb in LIMBS)

    def _limb(self, limb: int) -> Limb:
        azimuth, (cos, sin) = self.setting.azimuths[limb], self.setting.tilts[limb]
        out = azimuth.outward(self.pose) - self.size("offset", limb)
        y, z = azimuth.across(self.pose), self.pose[2]
        along, inward = out.times(sin) - z.times(cos), out.times(cos) + z.times(sin)
        return Limb(along, inward, y, strut(self.size("l", limb), inward, y))

    def margin(self, which: Margin) -> Enclosure:
        """How much the strut is longer than the way from its rail; the carriage on the rail; the swing by
        l sin against |Y|."""
        name, limb = which
        at, length = self.limbs[limb], self.size("l", limb)
        if name == "strut":
            return reach(length, at.inward, at.y)
        if name == "swing":
            return length.times(self.setting.swing or ONE) - magnitude(at.y)
        position = at.along - (length * at.strut.along).times(arb(self.setting.carriages[limb]))
        return position if name == "rail start" else self.size("rail", limb) - position

    def _components(self, limb: int) -> Triple:
        """The strut's unit vector along ε_i, τ_i, ẑ."""
        (inward, across), along, _ = self.limbs[limb].strut
        cos, sin = self.setting.tilts[limb]
        along = along.times(arb(self.setting.carriages[limb]))
        return along.times(sin) + inward.times(cos), across, inward.times(sin) - along.times(cos)

    def push(self, limb: int) -> Push:
        """s_i along the strut, b_i = s_i·u_i."""
        _, along, squared = self.limbs[limb].strut
        row = self.setting.azimuths[limb].placed(*self._components(limb))
        return Push(row, along.times(arb(self.setting.carriages[limb])), squared)

    def constraint_normal(self, limb: int) -> Triple:
        """s_i × τ_i normalised."""
        out, _, up = self._components(limb)
        out, up, _ = direction(out, up)
        return self.setting.azimuths[limb].placed(-up, constant(arb(0)), out)

    def length_error_gain_squared(self, limb: int) -> Enclosure:
        """s·dx = (s·ε)(dR − dr) + dl."""
        return square(self._components(limb)[0]).times(TWO) + constant(ONE)


def describe(made: Made) -> tuple[Setting, Sizes]:
    swing = swing_bound(made.number("swing"))
    limits = ("rail start", "rail end", *(("swing",) if swing is not None else ()))
    setting = LinearDeltaSetting(
        reach=tuple(Margin("strut", limb) for limb in LIMBS),
        within=tuple(Margin(name, limb) for limb in LIMBS for name in limits),
        carriages=made.signs["carriages"],
        azimuths=tuple(Azimuth(exact_angle(angle)) for angle in made.parameters["azimuth"]),
        tilts=tuple(exact_angle(angle) for angle in made.parameters["tilt"]),
        swing=swing,
    )
    offsets = {f"offset{limb + 1}": made.difference("R", "r", limb) for limb in LIMBS}
    return setting, made.spans("l", "rail") | offsets


LINEAR_DELTA = Mechanism(
    name="linear_delta",
    parameters=(
        Parameter("R", LENGTH, "non-negative"),
        Parameter("r", LENGTH, "non-negative"),
        Parameter("l", LENGTH, "positive"),
        Parameter("rail", LENGTH, "positive"),
        Parameter("azimuth", ANGLE, "any", AZIMUTHS),
        Parameter("tilt", ANGLE, "any", (0.0, 0.0, 0.0)),
    ),
    mode=(ModeField("carriages"),),
    limits={"swing": Limit("number", ANGLE), "link_radius": Limit("number", LENGTH)},
    drives={"motor": "actuation"},
    determinants=("actuation", "rotation"),
    links=("l",),
    actuator=LENGTH,
    configuration=LinearDelta,
    describe=describe,
)
