"""What a certificate states, as inequalities between quantities of a configuration.

A statement holds on a box where each of its goals is met on all of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from flint import arb

from tpm_design.checker.balls import (
    Enclosure,
    Symmetric,
    Triple,
    chained,
    constant,
    cross,
    determinant,
    dot,
    norm_squared,
    square,
)
from tpm_design.checker.mechanisms.configuration import LIMBS, Configuration, Velocity
from tpm_design.checker.spectrum import singular_pairs

Goal = Callable[[Configuration], Enclosure]
SymmetricGoals = Callable[[Configuration], Sequence[Symmetric]]


class Goals(NamedTuple):
    """Quantities that are > 0 and symmetric matrices of which all eigenvalues are > 0."""

    quantities: Sequence[Goal] = ()
    matrices: SymmetricGoals | None = None


NINE = arb(9)
NEARLY_EQUAL = 1.02
"""Ratio of squared singular values."""


@dataclass(frozen=True)
class Reach:
    """Every margin of reach ≥ floor (m), on the mode's side of each coordinate plane, joints within their
    limits."""

    floor: float

    def goals(self, configuration: Configuration) -> Goals:
        margin = constant(arb(self.floor))
        setting = configuration.setting
        reach: list[Goal] = [
            lambda at, which=which: at.margin(which) - margin  # type: ignore[misc]
            for which in setting.reach
        ]
        within: list[Goal] = [
            lambda at, which=which: at.margin(which)  # type: ignore[misc]
            for which in setting.within
        ]
        return Goals(reach + within)


def outside_goals(configuration: Configuration) -> list[Goal]:
    """Each of them > 0 alone puts a pose out of reach."""
    setting = configuration.setting
    return [
        lambda at, which=which: -at.margin(which)  # type: ignore[misc]
        for which in (*setting.reach, *setting.within)
    ]


@dataclass(frozen=True)
class Determinant:
    """sign · (determinant of unit rows) ≥ floor."""

    name: str
    sign: int
    floor: float

    def goals(self, _: Configuration) -> Goals:
        sign, floor = arb(self.sign), constant(arb(self.floor))
        return Goals([lambda at: at.unit_determinant(self.name).times(sign) - floor])


@dataclass(frozen=True)
class Serial:
    """The distance of each limb from its own singularity ≥ floor."""

    floor: float

    def goals(self, _: Configuration) -> Goals:
        least = constant(arb(self.floor) ** 2)
        return Goals(
            [
                lambda at, limb=limb: at.serial_squared(limb) - least  # type: ignore[misc]
                for limb in LIMBS
            ]
        )


@dataclass(frozen=True)
class Frobenius:
    """1/κ_F = 3/(‖J‖_F ‖J⁻¹‖_F) ≥ floor, as 9 det(A)² ≥ floor² ‖adj(A) B‖² ‖B⁻¹ A‖²."""

    drive: str
    floor: float

    def goals(self, _: Configuration) -> Goals:
        least = arb(self.floor) ** 2

        def goal(at: Configuration) -> Enclosure:
            rows, lengths, b = at.velocity(self.drive)
            pairs = (cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1]))
            squares = [square(entry) for entry in b]
            forward = dot(squares, [norm_squared(pair) for pair in pairs])
            first, second, third = (length / b2 for length, b2 in zip(lengths, squares, strict=True))
            backward = first + second + third
            return square(determinant(rows)).times(NINE) - (forward * backward).times(least)

        return Goals([goal])


def gram(velocity: Velocity) -> Symmetric:
    """A Aᵀ."""
    first, second, third = velocity.rows
    return Symmetric(velocity.squares, (dot(second, third), dot(third, first), dot(first, second)))


def squared_less_gram(velocity: Velocity, scale: Enclosure) -> Symmetric:
    """B² − scale · A Aᵀ."""
    return difference(squared(velocity), multiple(gram(velocity), scale))


def squared(velocity: Velocity) -> Triple:
    """The diagonal of B²."""
    b1, b2, b3 = (square(entry) for entry in velocity.b)
    return b1, b2, b3


def multiple(matrix: Symmetric, scale: Enclosure) -> Symmetric:
    (p, q, r), (u, v, w) = matrix
    return Symmetric((p * scale, q * scale, r * scale), (u * scale, v * scale, w * scale))


def difference(diagonal: Triple, matrix: Symmetric) -> Symmetric:
    """A diagonal matrix less another."""
    (d, e, f), (p, q, r), (u, v, w) = diagonal, *matrix
    return Symmetric((d - p, e - q, f - r), (-u, -v, -w))


def negative(matrix: Symmetric) -> Symmetric:
    (p, q, r), (u, v, w) = matrix
    return Symmetric((-p, -q, -r), (-u, -v, -w))


@dataclass(frozen=True)
class Slowest:
    """σ_min(J) ≥ floor, as B² − floor² A Aᵀ ≻ 0."""

    drive: str
    floor: float

    def goals(self, _: Configuration) -> Goals:
        scale = constant(arb(self.floor) ** 2)
        return Goals(matrices=lambda at: [squared_less_gram(at.velocity(self.drive), scale)])


@dataclass(frozen=True)
class Fastest:
    """σ_max(J) ≤ ceiling, as ceiling² A Aᵀ − B² ≻ 0."""

    drive: str
    ceiling: float

    def goals(self, _: Configuration) -> Goals:
        scale = constant(arb(self.ceiling) ** 2)
        return Goals(matrices=lambda at: [negative(squared_less_gram(at.velocity(self.drive), scale))])


@dataclass(frozen=True)
class Scale:
    """A linear function of the variables: ``middle`` at ``centre``."""

    middle: arb
    centre: Mapping[str, arb]
    slope: Mapping[str, arb]

    def at(self, configuration: Configuration) -> Enclosure:
        value, terms = self.middle, []
        for name, slope in self.slope.items():
            variable = configuration.variables[name]
            value += (variable.value - self.centre[name]) * slope
            terms.append((slope, variable))
        return chained(value, terms)


@dataclass(frozen=True)
class Condition:
    """1/κ₂ ≥ floor: some scale t has t floor² A Aᵀ ≺ B² ≺ t A Aᵀ at each pose.

    σ_max(J)² ≤ t ≤ σ_min(J)²/floor². A scale that follows their geometric mean over the box leaves both
    inequalities the same room; it is chosen in plain numbers, and any choice that serves is a proof.
    """

    drive: str
    floor: float

    def goals(self, configuration: Configuration) -> Goals:
        scale = self.scale(configuration)
        if scale is None:
            return Goals([lambda _: constant(arb(-1))])
        least = constant(arb(self.floor) ** 2)

        def matrices(at: Configuration) -> list[Symmetric]:
            velocity = at.velocity(self.drive)
            driven, scaled = squared(velocity), multiple(gram(velocity), scale.at(at))
            return [negative(difference(driven, scaled)), difference(driven, multiple(scaled, least))]

        return Goals(matrices=matrices)

    def scale(self, configuration: Configuration) -> Scale | None:
        """With slopes where the configuration has them; None at a singularity, where there is no scale."""
        rows, _, b = configuration.velocity(self.drive)
        middle = [[float(entry.value) for entry in row] for row in rows]
        driven = [float(entry.value) for entry in b]
        try:
            pairs = singular_pairs(middle, driven)
            least, greatest = pairs[0][0], pairs[2][0]
            # without a floor any scale above the greatest serves
            mean = math.sqrt(least * greatest) / (self.floor or 0.5 * math.sqrt(least / greatest))
        except (ZeroDivisionError, ValueError, OverflowError):
            return None
        if not (math.isfinite(mean) and mean > 0.0):
            return None
        slope: dict[str, float] = {}
        # nearly equal ones part in any direction: what they have in common is followed
        lowest = [pair for pair in pairs if pair[0] <= least * NEARLY_EQUAL]
        highest = [pair for pair in pairs if pair[0] * NEARLY_EQUAL >= greatest]
        for group in (lowest, highest):
            for value, u, w in group:
                share = 0.5 * mean / (value * len(group))
                for i in LIMBS:
                    moved = -2.0 * share * value * u[i]
                    for entry, toward in zip(rows[i], w, strict=True):
                        add_slopes(slope, entry, moved * toward)
                    add_slopes(slope, b[i], 2.0 * share * u[i] * u[i] * driven[i])
        finite = {name: arb(part) for name, part in slope.items() if math.isfinite(part)}
        centre = {name: configuration.variables[name].value.mid() for name in finite}
        return Scale(arb(mean), centre, finite)


def add_slopes(total: dict[str, float], entry: Enclosure, factor: float) -> None:
    for name, part in entry.slope.items():
        total[name] = total.get(name, 0.0) + factor * float(part)


@dataclass(frozen=True)
class Transmission:
    """λ_i = |a_i·t_i| ≥ floor and η_i = |det A|/|a_j × a_k| ≥ floor, for unit rows a_i and the unit velocity
    t_i of the driven point."""

    floor: float

    def goals(self, _: Configuration) -> Goals:
        least = arb(self.floor) ** 2

        def input_(at: Configuration, limb: int) -> Enclosure:
            return at.input_transmission_squared(limb) - constant(least)

        def output(at: Configuration, limb: int) -> Enclosure:
            rows = at.velocity(at.transmission_drive).rows
            across = norm_squared(cross(rows[(limb + 1) % 3], rows[(limb + 2) % 3]))
            return square(determinant(rows)) - across.times(least)

        return Goals(
            [
                lambda at, limb=limb, index=index: index(at, limb)  # type: ignore[misc]
                for index in (input_, output)
                for limb in LIMBS
            ]
        )


@dataclass(frozen=True)
class Sensitivity:
    """σ_max(A⁻¹ diag(c)) ≤ ceiling with c_i the norm of the coefficients of limb i's length errors."""

    drive: str
    ceiling: float

    def goals(self, _: Configuration) -> Goals:
        scale = arb(self.ceiling) ** 2

        def matrices(at: Configuration) -> list[Symmetric]:
            (p, q, r), (u, v, w) = gram(at.velocity(self.drive))
            c1, c2, c3 = (at.length_error_gain_squared(limb) for limb in LIMBS)
            return [
                Symmetric(
                    (p.times(scale) - c1, q.times(scale) - c2, r.times(scale) - c3),
                    (u.times(scale), v.times(scale), w.times(scale)),
                )
            ]

        return Goals(matrices=matrices)


@dataclass(frozen=True)
class Locus:
    """No pose within ``distance`` (m) of the region that is in closed reach has this determinant = 0."""

    name: str
    distance: float

    def goals(self, configuration: Configuration) -> Goals:
        # on a box the determinant keeps the sign it has in the middle, or is not proved to be away from 0
        middle = arb(1) if float(configuration.unit_determinant(self.name).value) >= 0.0 else arb(-1)
        return Goals([lambda at: at.unit_determinant(self.name).times(middle)])


@dataclass(frozen=True)
class Length:
    """Total link length between ``floor`` and ``ceiling`` (m), where given."""

    floor: float | None
    ceiling: float | None


Floored = Serial | Frobenius | Condition | Slowest | Transmission
Statement = Reach | Determinant | Floored | Fastest | Sensitivity | Locus
