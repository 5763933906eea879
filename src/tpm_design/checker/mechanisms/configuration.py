"""A machine at a pose, or all of a box of machines and poses: what statements are made of.

Statements know no mechanism; they ask for margins, determinants of unit rows and A ẋ = diag(b) q̇.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

from flint import arb

from tpm_design.checker.balls import Enclosure, Triple

AXES = ("x", "y", "z")
LIMBS = (0, 1, 2)


def placed(limb: int, own: Enclosure, along_j: Enclosure, along_k: Enclosure) -> Triple:
    """Components along e_i, e_j, e_k of a limb as components along x, y, z."""
    if limb == 0:
        return own, along_j, along_k
    return (along_k, own, along_j) if limb == 1 else (along_j, along_k, own)


class Velocity(NamedTuple):
    """A ẋ = diag(b) q̇: rows of A, their squared lengths, and b."""

    rows: tuple[Triple, Triple, Triple]
    squares: Triple
    b: Triple


class Margin(NamedTuple):
    """A quantity of one limb that is ≥ 0 where it can be: its reach, or a limit of the working mode."""

    name: str
    limb: int


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What all machines within the tolerance have in common.

    ``reach``: margins in metres; ``within``: those of joints, of which the sign counts alone; ``sides``: of
    the coordinate planes, ±1 or 0 for either. ``folds``: those of reach that bound a region even where they
    are 0 on a line and nowhere negative.
    """

    reach: tuple[Margin, ...]
    within: tuple[Margin, ...] = ()
    sides: tuple[int, int, int] = (0, 0, 0)
    folds: tuple[Margin, ...] = ()


class Configuration(ABC):
    """Each mechanism gives its own; ``variables`` are x, y, z and sizes such as ``f1``."""

    transmission_drive: ClassVar[str] = "motor"
    """The drive of which the transmission index speaks: its rows are unit rows."""

    def __init__(
        self, setting: Setting, variables: Mapping[str, Enclosure], middle: Configuration | None = None
    ) -> None:
        """``middle``: the configuration in the middle of the box, where this one has derivatives; the mean
        value theorem then narrows what is known."""
        self.setting = setting
        self.variables = variables
        self.middle = middle

    @cached_property
    def pose(self) -> Triple:
        x, y, z = (self.variables[axis] for axis in AXES)
        return x, y, z

    def size(self, name: str, limb: int) -> Enclosure:
        return self.variables[f"{name}{limb + 1}"]

    def narrowed(self, known: Enclosure, middle: Enclosure) -> Enclosure:
        """What is known of a quantity, and by the mean value theorem from its value in the middle."""
        if self.middle is None:
            return known
        spread = middle.value
        for name, slope in known.slope.items():
            spread += slope * (self.variables[name].value - self.middle.variables[name].value)
        if not spread.is_finite() or not known.value.overlaps(spread):
            return known
        return Enclosure(known.value.intersection(spread), known.slope)

    @abstractmethod
    def margin(self, which: Margin) -> Enclosure:
        """One of the setting's margins."""

    @abstractmethod
    def unit_determinant(self, name: str) -> Enclosure:
        """A determinant of the mechanism, of unit rows."""

    @abstractmethod
    def velocity(self, drive: str) -> Velocity: ...

    @abstractmethod
    def serial_squared(self, limb: int) -> Enclosure:
        """The square of a limb's distance from its own singularity, in [0, 1], and negative out of reach."""

    @abstractmethod
    def length_error_gain_squared(self, limb: int) -> Enclosure:
        """The squared norm of a limb's coefficients c in a·dx = Σ c dL, actuators locked."""

    def input_transmission_squared(self, limb: int) -> Enclosure:
        """(a·t)², of the unit row a and the unit velocity t of the driven point."""
        return self.serial_squared(limb)


class Span:
    """All the values of one variable: a ball around them, their ends, middle and half width."""

    __slots__ = ("centre", "high", "low", "radius", "whole")

    def __init__(self, low: arb, high: arb) -> None:
        self.low, self.high = low, high
        self.whole = low.union(high)
        self.centre = self.whole.mid()
        self.radius = (self.whole - self.centre).abs_upper()


@dataclass(frozen=True)
class Machines:
    """Every machine within the tolerance: the spans of its sizes, by names such as ``f1``."""

    configuration: type[Configuration]
    setting: Setting
    sizes: Mapping[str, Span]

    def at(self, variables: Mapping[str, Enclosure], middle: Configuration | None = None) -> Configuration:
        return self.configuration(self.setting, variables, middle)
