"""The rotary DELTA: arms L that turn in vertical planes, parallelograms l below them.

Sources: R. Clavel, "DELTA, a fast robot with parallel geometry", Proc. 18th Int. Symposium on Industrial
Robots, 1988; R. L. Williams II, "The Delta Parallel Robot: Kinematics Solutions", Ohio University, 2016. In
the plane (ε_i, ẑ) of a limb, with Y_i the distance across it, arm and parallelogram are two bars: L, and
√(l² − Y²) to the point (ε_i·p − (w − u), z).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from flint import arb

from tpm_design.checker.balls import Enclosure, Triple, constant, direction, magnitude, root, square
from tpm_design.checker.mechanisms.angles import AngleRange, Azimuth, angle_ranges, exact_angle
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
from tpm_design.checker.mechanisms.two_bars import Chain, End, chain

ONE, TWO = arb(1), arb(2)
AZIMUTHS = (-1.5707963267948966, 0.5235987755982988, 2.6179938779914944)
"""−90°, 30°, 150°."""


@dataclass(frozen=True, kw_only=True)
class DeltaSetting(Setting):
    elbows: Signs
    azimuths: tuple[Azimuth, ...]
    theta: Mapping[str, AngleRange]
    swing: arb | None


class Limb(NamedTuple):
    """The end of the parallelogram at (X, Z) in the limb's plane and Y across it. ``share``: the part of the
    lower arm in the plane; ``lean``: its component along the upper arm."""

    x: Enclosure
    z: Enclosure
    y: Enclosure
    rho_squared: Enclosure
    across: Enclosure
    share: Enclosure
    lean: Enclosure


class Delta(Pushing):
    setting: DeltaSetting
    middle: Delta | None

    @cached_property
    def limbs(self) -> tuple[Limb, ...]:
        return tuple(self._limb(limb) for limb in LIMBS)

    def _limb(self, limb: int) -> Limb:
        azimuth = self.setting.azimuths[limb]
        upper, lower = self.size("L", limb), self.size("l", limb)
        x, y, z = (
            azimuth.outward(self.pose) - self.size("offset", limb),
            azimuth.across(self.pose),
            self.pose[2],
        )
        rho_squared = square(x) + square(z)
        across = y / lower
        share = root(constant(ONE) - square(across))
        # |upper arm + lower arm|² from the joint at the base
        lean = (rho_squared + square(y) - square(upper) - square(lower)) / (upper * lower).times(TWO)
        return Limb(x, z, y, rho_squared, across, share, lean)

    @cached_property
    def chains(self) -> tuple[Chain, ...]:
        return tuple(self._chain(limb) for limb in LIMBS)

    def _chain(self, limb: int) -> Chain:
        at = self.limbs[limb]
        end = End(at.x, at.z, at.rho_squared, self.size("L", limb), self.size("l", limb) * at.share)
        middle = None if self.middle is None else self.middle.chains[limb]
        return chain(self, end, self.setting.elbows[limb], middle)

    def margin(self, which: Margin) -> Enclosure:
        """In metres: how much the parallelogram is longer than the way from the arm's circle to the platform,
        and shorter than that from its far side; θ in its range; the swing by l sin against |Y|."""
        name, limb = which
        at, upper, lower = self.limbs[limb], self.size("L", limb), self.size("l", limb)
        if name == "theta":
            out, up = self.chains[limb].first
            return self.setting.theta["theta"].margin(out, -up)  # θ > 0 is downward
        if name == "swing":
            return lower.times(self.setting.swing or ONE) - magnitude(at.y)
        rho = direction(at.x, at.z)[2]
        if name == "stretched":
            return lower - direction(rho - upper, at.y)[2]
        return direction(rho + upper, at.y)[2] - lower

    def push(self, limb: int) -> Push:
        """s_i along the lower arm, b_i = L s_i·t_i, t_i the direction in which the knee moves."""
        at, links = self.limbs[limb], self.chains[limb]
        row = self.setting.azimuths[limb].placed(links.a * at.share, at.across, links.c * at.share)
        serial = constant(ONE) - square(at.across) - square(at.lean)
        sign = arb(self.setting.elbows[limb])
        return Push(row, (self.size("L", limb) * root(serial)).times(sign), serial)

    def constraint_normal(self, limb: int) -> Triple:
        """s_i × τ_i normalised."""
        links = self.chains[limb]
        return self.setting.azimuths[limb].placed(-links.c, constant(arb(0)), links.a)

    def length_error_gain_squared(self, limb: int) -> Enclosure:
        """s·dx = (s·ε)(dw − du) + (s·arm) dL + dl."""
        at = self.limbs[limb]
        outward = self.chains[limb].a * at.share
        return square(outward).times(TWO) + square(at.lean) + constant(ONE)


def describe(made: Made) -> tuple[Setting, Sizes]:
    theta, swing = angle_ranges(made.limits, ("theta",)), swing_bound(made.number("swing"))
    limits = (*theta, *(("swing",) if swing is not None else ()))
    setting = DeltaSetting(
        reach=tuple(Margin(end, limb) for limb in LIMBS for end in ("stretched", "folded")),
        within=tuple(Margin(name, limb) for limb in LIMBS for name in limits),
        elbows=made.signs["elbows"],
        azimuths=tuple(Azimuth(exact_angle(angle)) for angle in made.parameters["azimuth"]),
        theta=theta,
        swing=swing,
    )
    offsets = {f"offset{limb + 1}": made.difference("w", "u", limb) for limb in LIMBS}
    return setting, made.spans("L", "l") | offsets


DELTA = Mechanism(
    name="delta",
    parameters=(
        Parameter("w", LENGTH, "non-negative"),
        Parameter("u", LENGTH, "non-negative"),
        Parameter("L", LENGTH, "positive"),
        Parameter("l", LENGTH, "positive"),
        Parameter("azimuth", ANGLE, "any", AZIMUTHS),
    ),
    mode=(ModeField("elbows"),),
    limits={
        "theta": Limit("range", ANGLE),
        "swing": Limit("number", ANGLE),
        "link_radius": Limit("number", LENGTH),
    },
    drives={"motor": "actuation"},
    determinants=("actuation", "rotation"),
    links=("L", "l"),
    actuator=ANGLE,
    configuration=Delta,
    describe=describe,
)
