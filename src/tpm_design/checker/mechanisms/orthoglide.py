"""The Orthoglide: three rails along the axes, struts L.

Source: D. Chablat and P. Wenger, "Architecture optimization of a 3-DOF translational parallel mechanism for
machining applications, the Orthoglide", IEEE Trans. Robotics and Automation 19(3), 403–410, 2003.
q_i = p_i + d_i ± √(L² − p_j² − p_k²), the carriage ahead of the platform or behind it, with d_i the distance
of the platform's joint from its point along the rail.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from flint import arb

from tpm_design.checker.balls import Enclosure, constant, square
from tpm_design.checker.mechanisms.configuration import LIMBS, Margin, Setting, placed
from tpm_design.checker.mechanisms.mechanism import (
    ANGLE,
    LENGTH,
    Limit,
    Made,
    Mechanism,
    ModeField,
    Parameter,
    Range,
    Signs,
    Sizes,
)
from tpm_design.checker.mechanisms.pushing import Push, Pushing, swing_bound
from tpm_design.checker.mechanisms.rails import Strut, reach, strut

ONE = arb(1)


@dataclass(frozen=True, kw_only=True)
class OrthoglideSetting(Setting):
    carriages: Signs
    stroke: Range | None
    swing: arb | None


class Orthoglide(Pushing):
    setting: OrthoglideSetting

    def _aside(self, limb: int) -> tuple[Enclosure, Enclosure]:
        return self.pose[(limb + 1) % 3], self.pose[(limb + 2) % 3]

    @cached_property
    def struts(self) -> tuple[Strut, ...]:
        return tuple(strut(self.size("L", limb), *self._aside(limb)) for limb in LIMBS)

    def margin(self, which: Margin) -> Enclosure:
        """L − √(p_j² + p_k²); the stroke; the strut's angle from its rail by (L sin)² against p_j² + p_k²."""
        name, limb = which
        length, (first, second) = self.size("L", limb), self._aside(limb)
        if name == "strut":
            return reach(length, first, second)
        if name == "swing":
            widest = length.times(self.setting.swing or ONE)
            return square(widest) - square(first) - square(second)
        sign = arb(self.setting.carriages[limb])
        position = self.pose[limb] + self.size("d", limb) + (length * self.struts[limb].along).times(sign)
        low, high = self.setting.stroke or (0.0, 0.0)
        return position - constant(arb(low)) if name == "stroke min" else constant(arb(high)) - position

    def push(self, limb: int) -> Push:
        """s_i from the carriage to the platform, b_i = s_i·e_i."""
        (first, second), along, squared = self.struts[limb]
        own = along.times(arb(-self.setting.carriages[limb]))
        return Push(placed(limb, own, first, second), own, squared)

    def length_error_gain_squared(self, limb: int) -> Enclosure:
        """s·dx = −(s·e) dd + dL."""
        return self.struts[limb].along_squared + constant(ONE)


def describe(made: Made) -> tuple[Setting, Sizes]:
    stroke, swing = made.range("stroke"), swing_bound(made.number("swing"))
    limits = (
        *(("stroke min", "stroke max") if stroke is not None else ()),
        *(("swing",) if swing is not None else ()),
    )
    setting = OrthoglideSetting(
        reach=tuple(Margin("strut", limb) for limb in LIMBS),
        within=tuple(Margin(name, limb) for limb in LIMBS for name in limits),
        carriages=made.signs["carriages"],
        stroke=stroke,
        swing=swing,
    )
    return setting, made.spans("L", "d")


ORTHOGLIDE = Mechanism(
    name="orthoglide",
    parameters=(Parameter("L", LENGTH, "positive"), Parameter("d", LENGTH, "any", (0.0, 0.0, 0.0))),
    mode=(ModeField("carriages"),),
    limits={
        "stroke": Limit("range", LENGTH),
        "swing": Limit("number", ANGLE),
        "link_radius": Limit("number", LENGTH),
    },
    drives={"motor": "actuation"},
    determinants=("actuation",),
    links=("L",),
    actuator=LENGTH,
    configuration=Orthoglide,
    describe=describe,
)
