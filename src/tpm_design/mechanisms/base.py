"""What a mechanism declares about itself, and what every mechanism can do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from tpm_design.mechanisms.mechanism import Mechanism

Dimension = Literal["length", "angle", "ratio"]
Domain = Literal["positive", "non-negative", "non-zero", "any"]

ModeCandidates = Callable[[Mapping[str, tuple[float, float]], bool], tuple[dict[str, str], ...]]


@dataclass(frozen=True)
class Parameter:
    """One design parameter.

    ``per_limb``: the name sets all limbs, ``name1``, ``name2``, ``name3`` one limb each.
    """

    name: str
    symbol: str
    dimension: Dimension
    domain: Domain
    description: str
    per_limb: bool = True


@dataclass(frozen=True)
class ModeField:
    """One sign string of a working mode, such as ``octant: "+-+"``."""

    name: str
    length: int
    description: str
    any_allowed: bool = False


@dataclass(frozen=True)
class Limit:
    """One optional joint limit or link dimension under ``limits:`` of a study.

    ``kind`` "range" takes ``{min, max}``, "number" one non-negative number.
    """

    name: str
    dimension: Dimension
    kind: Literal["range", "number"]
    description: str


@dataclass(frozen=True)
class Singularity:
    """One family of singularities; named as its determinant, if one vanishes."""

    name: str
    condition: str
    equation: str


@dataclass(frozen=True)
class MechanismKind:
    """Everything the program knows about one mechanism before dimensions are chosen.

    ``build(parameters, limits)``: SI values by name → a mechanism. ``farthest_reach(ranges)``: a bound
    (m) on the distance of any reachable pose from the origin, from the (lowest, highest) SI value of
    every parameter name that is set. ``example``: SI values of a machine that works, for new studies.
    ``mode_candidates(ranges, isotropic)``: sign strings of one working mode of each set that symmetry
    makes equal for every design of the ranges; None: all modes count as different.
    """

    name: str
    title: str
    source: str
    parameters: tuple[Parameter, ...]
    pose: tuple[str, ...]
    actuator_unit: Literal["rad", "m"]
    drives: tuple[str, ...]
    mode_fields: tuple[ModeField, ...]
    limits: tuple[Limit, ...]
    determinants: tuple[str, ...]
    singularities: tuple[Singularity, ...]
    example: Mapping[str, float]
    build: Callable[[Mapping[str, Any], Mapping[str, Any]], Mechanism]
    farthest_reach: Callable[[Mapping[str, tuple[float, float]]], float]
    limb_count: int = 3
    mode_candidates: ModeCandidates | None = None

    def parameter(self, name: str) -> Parameter | None:
        """The parameter that ``name`` sets (``f`` or ``f2``), or None."""
        for parameter in self.parameters:
            limbs = [f"{parameter.name}{i + 1}" for i in range(self.limb_count)] if parameter.per_limb else []
            if name == parameter.name or name in limbs:
                return parameter
        return None

    def parameter_names(self) -> list[str]:
        """Every name a study may use, the common ones first."""
        common = [p.name for p in self.parameters]
        single = [f"{p.name}{i + 1}" for p in self.parameters if p.per_limb for i in range(self.limb_count)]
        return common + single
