"""The 3-URU over a box of poses and machines, written anew from its equations.

Source: R. Di Gregorio, "A Novel 3-URU Architecture with Actuators on the Base: Kinematics and Singularity
Analysis", Robotics 9(3), 60, 2020; numbers in brackets are its equations. Everything that a limb does depends
on its δ = d_p − d_b alone, which is one variable here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from flint import arb

from tpm_design.checker.balls import (
    ZERO,
    Enclosure,
    Triple,
    chained,
    constant,
    determinant,
    direction,
    inverse,
    magnitude,
    product,
    root,
    square,
    wide_square,
)

AXES = ("x", "y", "z")
LIMBS = (0, 1, 2)
SIZES = ("delta", "f", "r", "k")
ONE, TWO = arb(1), arb(2)
UNIT = arb(0, 1)
NARROWINGS = 1
JOINTS = ("theta1", "theta2", "theta3", "theta4")


@dataclass(frozen=True)
class Mode:
    """Sides of the coordinate planes (0: any) and elbows, ±1."""

    octant: tuple[int, int, int]
    elbows: tuple[int, int, int]


class JointRange(NamedTuple):
    """A joint is within its range where cos θ · ``cosine`` + sin θ · ``sine`` ≥ ``bound``: the cosine of the
    angle to the middle of the range against that of half its width."""

    joint: str
    cosine: arb
    sine: arb
    bound: arb


def joint_range(joint: str, low: float, high: float) -> JointRange | None:
    """None where the range holds every angle."""
    middle, half = (arb(low) + arb(high)) / 2, (arb(high) - arb(low)) / 2
    if not half < arb.pi():
        return None
    return JointRange(joint, middle.cos(), middle.sin(), half.cos())


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


class Chain(NamedTuple):
    """The unit row v_i = a e_i + c h_i along the distal link, and cos θ_i3, sin θ_i3."""

    a: Enclosure
    c: Enclosure
    elbow_cosine: Enclosure
    elbow_sine: Enclosure


class Velocity(NamedTuple):
    """A ṗ = diag(b) q̇: rows of A, their squared lengths, and b."""

    rows: tuple[Triple, Triple, Triple]
    squares: Triple
    b: Triple


class Configuration:
    """A machine at a pose, or all of a box of machines and poses: what statements are made of."""

    def __init__(
        self,
        mode: Mode,
        limits: Sequence[JointRange],
        variables: Mapping[str, Enclosure],
        middle: Configuration | None = None,
    ) -> None:
        """``middle``: the configuration in the middle of the box, where this one has derivatives; the mean
        value theorem then narrows what is known of the limbs."""
        self.mode = mode
        self.limits = limits
        self.variables = variables
        self.middle = middle

    @cached_property
    def pose(self) -> Triple:
        x, y, z = (self.variables[axis] for axis in AXES)
        return x, y, z

    @cached_property
    def legs(self) -> tuple[Leg, Leg, Leg]:
        first, second, third = (self._leg(limb) for limb in LIMBS)
        return first, second, third

    def _leg(self, limb: int) -> Leg:
        p, p_j, p_k = (self.pose[(limb + step) % 3] for step in LIMBS)
        delta, f, r, k = (self.variables[f"{size}{limb + 1}"] for size in SIZES)
        alpha = p + delta
        along_j, along_k, beta = direction(p_j, p_k)
        if self.middle is not None:
            other = self.middle.legs[limb]
            along_j, along_k = self._narrowed(along_j, other.along_j), self._narrowed(along_k, other.along_k)
        return Leg(alpha, beta, along_j, along_k, square(alpha) + square(p_j) + square(p_k), f, r, k)

    @cached_property
    def chains(self) -> tuple[Chain, Chain, Chain]:
        first, second, third = (self._chain(limb) for limb in LIMBS)
        return first, second, third

    def _chain(self, limb: int) -> Chain:
        """(A1)–(A2) without inverse trigonometry: with S = 2 ρ² e, twice the area that the elbow spans,
        r a = α q + β e and r c = β q − α e."""
        alpha, beta, _, _, rho_squared, f, r, _ = self.legs[limb]
        cos = (rho_squared - square(f) - square(r)) / (f * r).times(TWO)
        sin = sine_of(cos, -self.mode.elbows[limb])
        # v is the direction of (α, β) turned by the angle of the triangle f, r, ρ at its end
        toward, up, rho = (part.value for part in direction(constant(alpha.value), constant(beta.value)))
        per_rho = inverse(rho)
        excess = wide_square(r.value) - wide_square(f.value)
        near = (rho + excess * per_rho) * inverse(2 * r.value)
        aside = -f.value * sin.value * per_rho
        a = unit(toward * near + up * aside)
        c = unit(up * near - toward * aside)
        if self.middle is None:
            return Chain(Enclosure(a, {}), Enclosure(c, {}), cos, sin)
        other = self.middle.chains[limb]
        for _ in range(NARROWINGS):
            turn = self._turn(limb, a, c, cos.value, sin.value)
            along, across = chained(a, ((-c, turn),)), chained(c, ((a, turn),))
            a, c = self._narrowed(along, other.a).value, self._narrowed(across, other.c).value
        turn = self._turn(limb, a, c, cos.value, sin.value)
        return Chain(chained(a, ((-c, turn),)), chained(c, ((a, turn),)), cos, sin)

    def _turn(self, limb: int, a: arb, c: arb, cos: arb, sin: arb) -> Enclosure:
        """Derivatives of the angle of the distal link: |(α, β) − r v| = f differentiated, with the proximal
        link's direction u gives r sin θ_i3 dφ = df + cos θ_i3 dr − u·(dα, dβ)."""
        leg = self.legs[limb]
        share = inverse(leg.r.value * sin)
        u = (unit(a * cos + c * sin), unit(c * cos - a * sin))
        partials = (
            (share, leg.f),
            (share * cos, leg.r),
            (-share * u[0], leg.alpha),
            (-share * u[1], leg.beta),
        )
        return chained(ZERO, partials)

    def _narrowed(self, known: Enclosure, middle: Enclosure) -> Enclosure:
        """What is known of a quantity, and by the mean value theorem from its value in the middle."""
        if self.middle is None:
            return known
        spread = middle.value
        for name, slope in known.slope.items():
            spread += slope * (self.variables[name].value - self.middle.variables[name].value)
        if not spread.is_finite() or not known.value.overlaps(spread):
            return known
        return Enclosure(known.value.intersection(spread), known.slope)

    def leg_margins(self, limb: int) -> tuple[Enclosure, Enclosure]:
        """(29) in metres: f_i + r_i − ρ_i and ρ_i − |f_i − r_i|."""
        leg = self.legs[limb]
        rho = root(leg.rho_squared)
        return leg.f + leg.r - rho, rho - magnitude(leg.f - leg.r)

    def elbow_sine_squared(self, limb: int) -> Enclosure:
        """sin² θ_i3 (27), and negative out of reach."""
        return constant(ONE) - square(self.chains[limb].elbow_cosine)

    def limit_margin(self, limb: int, limit: JointRange) -> Enclosure:
        """≥ 0 where the joint of the limb is within its range."""
        cos, sin = self._joint(limb, limit.joint)
        return cos.times(limit.cosine) + sin.times(limit.sine) - constant(limit.bound)

    def _joint(self, limb: int, joint: str) -> tuple[Enclosure, Enclosure]:
        """Cosine and sine of one angle."""
        leg = self.legs[limb]
        if joint == "theta1":
            # g_i = (−h_k, h_j) along (j, k), against the phase references that the paper gives each limb
            return (-leg.along_j, -leg.along_k) if limb == 1 else (-leg.along_k, leg.along_j)
        a, c, cos, sin = self.chains[limb]
        if joint == "theta2":
            return a * cos + c * sin, c * cos - a * sin
        if joint == "theta3":
            return cos, sin
        return a, -c  # θ_i4 = −(θ_i2 + θ_i3) keeps the platform parallel

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
        leg, chain = self.legs[limb], self.chains[limb]
        toward, across, _ = direction(leg.beta, leg.k * leg.f * chain.elbow_sine)
        along = toward * chain.c
        return placed(
            limb,
            toward * chain.a,
            along * leg.along_j - across * leg.along_k,
            along * leg.along_k + across * leg.along_j,
        )

    def velocity(self, drive: str) -> Velocity:
        """Joints: v_i and γ_i (18). Motors: w_i = v_i + (k_i γ_i/β_i) g_i and k_i γ_i (19)."""
        return self._motor_velocity if drive == "motor" else self._joint_velocity

    @cached_property
    def _joint_velocity(self) -> Velocity:
        first, second, third = (
            placed(limb, chain.a, chain.c * leg.along_j, chain.c * leg.along_k)
            for limb, leg, chain in zip(LIMBS, self.legs, self.chains, strict=True)
        )
        b1, b2, b3 = (leg.f * chain.elbow_sine for leg, chain in zip(self.legs, self.chains, strict=True))
        return Velocity((first, second, third), (constant(ONE),) * 3, (b1, b2, b3))

    @cached_property
    def _motor_velocity(self) -> Velocity:
        rows, squares, b = zip(*(self._motor_row(limb) for limb in LIMBS), strict=True)
        return Velocity(rows, squares, b)

    def _motor_row(self, limb: int) -> tuple[Triple, Enclosure, Enclosure]:
        leg, chain = self.legs[limb], self.chains[limb]
        driven = leg.k * leg.f * chain.elbow_sine
        swing = driven / leg.beta
        row = placed(
            limb,
            chain.a,
            chain.c * leg.along_j - swing * leg.along_k,
            chain.c * leg.along_k + swing * leg.along_j,
        )
        return row, constant(ONE) + square(swing), driven

    def length_error_gain_squared(self, limb: int) -> Enclosure:
        """Closure with locked actuators: w_i·dx = −(v_i·e_i)(dd_p − dd_b) + cos θ_i3 df + dr."""
        chain = self.chains[limb]
        return square(chain.a).times(TWO) + square(chain.elbow_cosine) + constant(ONE)


def sine_of(cos: Enclosure, sign: int) -> Enclosure:
    """The sine of an angle of which the cosine is known; 0 where the cosine is beyond ±1."""
    sin = root(constant(ONE - wide_square(cos.value))).value
    if sign < 0:
        sin = -sin
    return chained(sin, ((-cos.value * inverse(sin), cos),))


def unit(part: arb) -> arb:
    """What is known of a component of a unit vector."""
    return part.intersection(UNIT) if part.overlaps(UNIT) else UNIT


def placed(limb: int, own: Enclosure, along_j: Enclosure, along_k: Enclosure) -> Triple:
    """Components along e_i, e_j, e_k of a limb as components along x, y, z."""
    if limb == 0:
        return own, along_j, along_k
    return (along_k, own, along_j) if limb == 1 else (along_j, along_k, own)
