"""The 3-URU over a box of poses and machines, written anew from its equations.

Source: R. Di Gregorio, "A Novel 3-URU Architecture with Actuators on the Base: Kinematics and Singularity
Analysis", Robotics 9(3), 60, 2020; numbers in brackets are its equations. Everything that a limb does depends
on its δ = d_p − d_b alone, which is one variable here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

from flint import arb

from tpm_design.checker.balls import (
    Enclosure,
    Triple,
    constant,
    determinant,
    direction,
    magnitude,
    product,
    root,
    square,
)
from tpm_design.checker.mechanisms.angles import AngleRange, angle_ranges
from tpm_design.checker.mechanisms.configuration import (
    LIMBS,
    Configuration,
    Margin,
    Setting,
    Velocity,
    placed,
)
from tpm_design.checker.mechanisms.mechanism import (
    ANGLE,
    LENGTH,
    RATIO,
    Limit,
    Made,
    Mechanism,
    ModeField,
    Parameter,
    Signs,
    Sizes,
)
from tpm_design.checker.mechanisms.two_bars import Chain, End, chain

ONE, TWO = arb(1), arb(2)
SIZES = ("delta", "f", "r", "k")
JOINTS = ("theta1", "theta2", "theta3", "theta4")


@dataclass(frozen=True, kw_only=True)
class UruSetting(Setting):
    elbows: Signs
    ranges: Mapping[str, AngleRange]


class Leg(NamedTuple):
    """The end of a limb in its plane (e_i, h_i), at (α_i, β_i), and h_i along e_j and e_k."""

    alpha: Enclosure
    beta: Enclosure
    along_j: Enclosure
    along_k: Enclosure
    rho_squared: Enclosure
    f: Enclosure
    r: Enclosure
    k: Enclosure


class Uru(Configuration):
    transmission_drive: ClassVar[str] = "joint"
    setting: UruSetting
    middle: Uru | None

    @cached_property
    def legs(self) -> tuple[Leg, Leg, Leg]:
        first, second, third = (self._leg(limb) for limb in LIMBS)
        return first, second, third

    def _leg(self, limb: int) -> Leg:
        p, p_j, p_k = (self.pose[(limb + step) % 3] for step in LIMBS)
        delta, f, r, k = (self.variables[f"{name}{limb + 1}"] for name in SIZES)
        alpha = p + delta
        along_j, along_k, beta = direction(p_j, p_k)
        if self.middle is not None:
            other = self.middle.legs[limb]
            along_j, along_k = self.narrowed(along_j, other.along_j), self.narrowed(along_k, other.along_k)
        return Leg(alpha, beta, along_j, along_k, square(alpha) + square(p_j) + square(p_k), f, r, k)

    @cached_property
    def chains(self) -> tuple[Chain, Chain, Chain]:
        """(A1)–(A2): the unit row v_i = a e_i + c h_i along the distal link, and cos θ_i3, sin θ_i3."""
        first, second, third = (self._chain(limb) for limb in LIMBS)
        return first, second, third

    def _chain(self, limb: int) -> Chain:
        alpha, beta, _, _, rho_squared, f, r, _ = self.legs[limb]
        middle = None if self.middle is None else self.middle.chains[limb]
        return chain(self, End(alpha, beta, rho_squared, f, r), self.setting.elbows[limb], middle)

    def margin(self, which: Margin) -> Enclosure:
        """(29) in metres: f_i + r_i − ρ_i and ρ_i − |f_i − r_i|; and joints within their ranges."""
        name, limb = which
        if name in self.setting.ranges:
            return self.setting.ranges[name].margin(*self._joint(limb, name))
        leg = self.legs[limb]
        rho = root(leg.rho_squared)
        return leg.f + leg.r - rho if name == "stretched" else rho - magnitude(leg.f - leg.r)

    def serial_squared(self, limb: int) -> Enclosure:
        """sin² θ_i3 (27)."""
        return constant(ONE) - square(self.chains[limb].elbow_cosine)

    def _joint(self, limb: int, joint: str) -> tuple[Enclosure, Enclosure]:
        """Cosine and sine of one angle."""
        leg = self.legs[limb]
        if joint == "theta1":
            # g_i = (−h_k, h_j) along (j, k), against the phase references that the paper gives each limb
            return (-leg.along_j, -leg.along_k) if limb == 1 else (-leg.along_k, leg.along_j)
        links = self.chains[limb]
        if joint == "theta2":
            return links.first
        if joint == "theta3":
            return links.elbow_cosine, links.elbow_sine
        return links.a, -links.c  # θ_i4 = −(θ_i2 + θ_i3) keeps the platform parallel

    def unit_determinant(self, name: str) -> Enclosure:
        """det V (20), det W/∏|w_i| (36) or det H (17)."""
        if name == "rotation":
            first, second, third = self.legs
            # |x|/β_2 · |y|/β_3 · |z|/β_1, each a component of an h_i
            return product(product(first.along_k, second.along_k), third.along_k).times(TWO)
        if name == "translation":
            return determinant(self._joint_velocity.rows)
        return determinant([self._unit_motor_row(limb) for limb in LIMBS])

    def _unit_motor_row(self, limb: int) -> Triple:
        """cos ψ v_i + sin ψ g_i with tan ψ = k_i γ_i/β_i: g_i is a unit vector across v_i."""
        leg, links = self.legs[limb], self.chains[limb]
        toward, across, _ = direction(leg.beta, leg.k * leg.f * links.elbow_sine)
        along = toward * links.c
        return placed(
            limb,
            toward * links.a,
            along * leg.along_j - across * leg.along_k,
            along * leg.along_k + across * leg.along_j,
        )

    def velocity(self, drive: str) -> Velocity:
        """Joints: v_i and γ_i (18). Motors: w_i = v_i + (k_i γ_i/β_i) g_i and k_i γ_i (19)."""
        return self._motor_velocity if drive == "motor" else self._joint_velocity

    @cached_property
    def _joint_velocity(self) -> Velocity:
        first, second, third = (
            placed(limb, links.a, links.c * leg.along_j, links.c * leg.along_k)
            for limb, leg, links in zip(LIMBS, self.legs, self.chains, strict=True)
        )
        b1, b2, b3 = (leg.f * links.elbow_sine for leg, links in zip(self.legs, self.chains, strict=True))
        return Velocity((first, second, third), (constant(ONE),) * 3, (b1, b2, b3))

    @cached_property
    def _motor_velocity(self) -> Velocity:
        rows, squares, b = zip(*(self._motor_row(limb) for limb in LIMBS), strict=True)
        return Velocity(rows, squares, b)

    def _motor_row(self, limb: int) -> tuple[Triple, Enclosure, Enclosure]:
        leg, links = self.legs[limb], self.chains[limb]
        driven = leg.k * leg.f * links.elbow_sine
        swing = driven / leg.beta
        row = placed(
            limb,
            links.a,
            links.c * leg.along_j - swing * leg.along_k,
            links.c * leg.along_k + swing * leg.along_j,
        )
        return row, constant(ONE) + square(swing), driven

    def length_error_gain_squared(self, limb: int) -> Enclosure:
        """w_i·dx = −(v_i·e_i)(dd_p − dd_b) + cos θ_i3 df + dr."""
        links = self.chains[limb]
        return square(links.a).times(TWO) + square(links.elbow_cosine) + constant(ONE)


def describe(made: Made) -> tuple[Setting, Sizes]:
    ranges = angle_ranges(made.limits, JOINTS)
    setting = UruSetting(
        reach=tuple(Margin(end, limb) for limb in LIMBS for end in ("stretched", "folded")),
        within=tuple(Margin(joint, limb) for limb in LIMBS for joint in ranges),
        sides=made.signs["octant"],
        elbows=made.signs["elbows"],
        ranges=ranges,
    )
    offsets = {f"delta{limb + 1}": made.difference("dp", "db", limb) for limb in LIMBS}
    return setting, made.spans("f", "r", "k") | offsets


URU = Mechanism(
    name="uru",
    parameters=(
        Parameter("db", LENGTH, "any"),
        Parameter("dp", LENGTH, "any"),
        Parameter("f", LENGTH, "positive"),
        Parameter("r", LENGTH, "positive"),
        Parameter("k", RATIO, "non-zero"),
    ),
    mode=(ModeField("octant", any_allowed=True), ModeField("elbows")),
    limits={**dict.fromkeys(JOINTS, Limit("range", ANGLE)), "link_radius": Limit("number", LENGTH)},
    drives={"motor": "actuation", "joint": "translation"},
    determinants=("translation", "actuation", "rotation"),
    links=("f", "r"),
    actuator=ANGLE,
    configuration=Uru,
    describe=describe,
)
