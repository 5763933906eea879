"""What a requirement of a study says of every pose: the statements that together prove it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from tpm_design.mechanisms.base import MechanismKind
from tpm_design.problem import Goal
from tpm_design.workspace import statements
from tpm_design.workspace.indices import (
    CONDITION_2,
    CONDITION_FROBENIUS,
    DETERMINANT,
    FASTEST,
    LEGS,
    SENSITIVITY,
    SERIAL,
    SLOWEST,
    TRANSMISSION,
    Index,
)

Kind = Literal[
    "reach", "determinant", "serial", "frobenius", "condition", "slowest", "fastest", "transmission",
    "sensitivity", "locus", "length",
]  # fmt: skip
CEILINGS = ("fastest", "sensitivity")


@dataclass(frozen=True)
class Demand:
    """One statement about every pose of the region (``locus``: of its surroundings) that a requirement needs.

    ``bound`` (SI): what must at least be proved; a ceiling for "fastest", "sensitivity" and for a "length"
    with ``ceiling``. ``name``: the determinant of "determinant" and "locus"; ``sign``: its side.
    """

    kind: Kind
    bound: float
    name: str = ""
    sign: float = 1.0
    drive: str = ""
    ceiling: bool = False

    @property
    def sense(self) -> float:
        """+1 where more than the bound is better, −1 where less is."""
        return -1.0 if self.ceiling or self.kind in CEILINGS else 1.0

    @property
    def key(self) -> str:
        """What the proved level is called in a certificate."""
        if self.kind == "locus":
            return "distance"
        return "floor" if self.sense > 0.0 else "ceiling"

    def statement(self, level: float, kind: MechanismKind) -> Any:
        """The compiled statement at a level (SI)."""
        motor = 0.0 if self.drive == "joint" else 1.0
        part = kind.determinants.index(self.name) if self.name else 0
        forms: dict[str, Callable[[], Any]] = {
            "reach": lambda: statements.Reach(level),
            "determinant": lambda: statements.Determinant(part, self.sign, level),
            "serial": lambda: statements.Serial(level),
            "frobenius": lambda: statements.Frobenius(motor, level),
            "condition": lambda: statements.Condition(motor, level),
            "slowest": lambda: statements.Slowest(motor, level),
            "fastest": lambda: statements.Fastest(motor, level),
            "transmission": lambda: statements.Transmission(level),
            "sensitivity": lambda: statements.Sensitivity(motor, level),
            "locus": lambda: statements.Regular(part, self.sign),
        }
        return forms[self.kind]()

    def index(self, kind: MechanismKind) -> Index:
        """The field whose least (greatest for a ceiling) value over the region is compared with the bound."""
        motor = 0.0 if self.drive == "joint" else 1.0
        if self.kind == "determinant":
            return Index(DETERMINANT, part=kind.determinants.index(self.name), sign=self.sign)
        quantity = {
            "reach": LEGS,
            "serial": SERIAL,
            "frobenius": CONDITION_FROBENIUS,
            "condition": CONDITION_2,
            "slowest": SLOWEST,
            "fastest": FASTEST,
            "transmission": TRANSMISSION,
            "sensitivity": SENSITIVITY,
        }[self.kind]
        return Index(quantity, motor=motor, sign=self.sense)

    def data(self, level: float) -> dict[str, Any]:
        """The statement as a certificate writes it, proved at ``level``."""
        found: dict[str, Any] = {"kind": self.kind}
        if self.name:
            found["name"] = self.name
        if self.kind == "determinant":
            found["sign"] = int(self.sign)
        if self.drive:
            found["drive"] = self.drive
        return found | {self.key: level}


REACH = Demand("reach", 0.0)


class NoProofError(Exception):
    """A requirement of a form that nothing here proves; the message says which."""


def demands(goal: Goal, kind: MechanismKind, signs: Sequence[float]) -> tuple[Demand, ...]:
    """The demands of one constraint, the one that carries its bound last. ``signs``: the side of each
    determinant that the region is on. Raises NoProofError for metrics and bounds that have no proof here."""
    name = goal.metric.name
    bound, ceiling = _bound(goal)
    drive = str(goal.options.get("drive", "motor"))
    sides = [
        Demand("determinant", 0.0, name=determinant, sign=sign)
        for determinant, sign in zip(kind.determinants, signs, strict=True)
    ]
    driving = [side for side in sides if side.name == kind.guard(drive)]
    if name == "coverage":
        return (REACH, *sides)
    if name == "conditioning_min" and goal.options.get("over", "region") == "region":
        norm: Kind = "frobenius" if goal.options.get("norm", "2") == "frobenius" else "condition"
        return (REACH, *driving, Demand(norm, bound, drive=drive))
    if name.endswith("_singularity_distance"):
        which = name.removesuffix("_singularity_distance")
        sign = next((side.sign for side in sides if side.name == which), None)
        if sign is None:
            return (REACH,)
        return (REACH, Demand("locus", bound, name=which, sign=sign))
    if name == "boundary_distance":
        return (Demand("reach", bound),)
    if name == "singularity_margin_min":
        floors = [Demand("determinant", bound, name=side.name, sign=side.sign) for side in sides]
        return (REACH, Demand("serial", bound), *floors)
    if name == "velocity_min":
        return (REACH, Demand("slowest", bound, drive=drive))
    if name == "velocity_max":
        return (REACH, *driving, Demand("fastest", bound, drive=drive))
    if name == "transmission_min":
        return (REACH, Demand("transmission", bound))
    if name == "position_sensitivity":
        return (REACH, *driving, Demand("sensitivity", bound, drive=drive))
    if name == "total_link_length":
        return (Demand("length", bound, ceiling=ceiling),)
    raise NoProofError(f"{name} has no proof by intervals here")


def refutable(goal: Goal) -> bool:
    """Whether a demand that fails breaks the requirement: a share of the region below 1 leaves some out."""
    return goal.metric.name != "coverage" or (goal.minimum is not None and goal.minimum >= 1.0)


def _bound(goal: Goal) -> tuple[float, bool]:
    """The bound of a constraint and whether it is a ceiling."""
    if goal.minimum is not None and goal.maximum is not None:
        raise NoProofError("a bound from both sides is two requirements: write two constraints")
    if goal.metric.name != "total_link_length":
        wanted = goal.minimum if goal.metric.better == "maximize" else goal.maximum
        if wanted is None:
            raise NoProofError(
                f"{goal.metric.name} is proved in its good direction only, and this bound asks for less"
            )
    bound = goal.minimum if goal.minimum is not None else goal.maximum
    if bound is not None and bound < 0.0:
        # statements square their bounds, and a region has no surroundings of negative width
        raise NoProofError("a bound below 0 has no proof here: ask for 0 or more")
    if goal.metric.name == "coverage" and bound is not None and bound > 1.0:
        raise NoProofError("coverage is never more than 1")
    return float(bound if bound is not None else 0.0), goal.maximum is not None
