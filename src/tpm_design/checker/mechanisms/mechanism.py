"""What a mechanism's file declares: how a certificate writes its machines, and what to make of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from flint import arb

from tpm_design.checker.mechanisms.configuration import LIMBS, Configuration, Machines, Setting, Span

Powers = tuple[int, int]
"""Of metre and radian."""
LENGTH: Powers = (1, 0)
ANGLE: Powers = (0, 1)
RATIO: Powers = (0, 0)

Values = tuple[float, float, float]
"""One of each limb."""
Signs = tuple[int, int, int]
Range = tuple[float, float]
LimitValue = Range | float | bool
Sizes = Mapping[str, Span]


@dataclass(frozen=True)
class Parameter:
    """``default``: what a study that leaves it out means. Angles have no tolerance."""

    name: str
    powers: Powers
    domain: Literal["positive", "non-negative", "non-zero", "any"]
    default: Values | None = None

    def allows(self, value: float) -> bool:
        return {
            "positive": value > 0.0,
            "non-negative": value >= 0.0,
            "non-zero": value != 0.0,
            "any": True,
        }[self.domain]

    @property
    def limb_names(self) -> tuple[str, ...]:
        return tuple(f"{self.name}{limb + 1}" for limb in LIMBS)


@dataclass(frozen=True)
class ModeField:
    """Three signs of a working mode."""

    name: str
    any_allowed: bool = False


@dataclass(frozen=True)
class Limit:
    """A switch is on where it is not written."""

    form: Literal["range", "number", "switch"]
    powers: Powers = RATIO


@dataclass(frozen=True)
class Made:
    """Machines as a certificate writes them: sizes ± tolerances by limb, limits, signs (0: any)."""

    parameters: Mapping[str, Values]
    tolerances: Mapping[str, Values]
    limits: Mapping[str, LimitValue]
    signs: Mapping[str, Signs]

    def span(self, name: str, limb: int) -> Span:
        """A size within its tolerance, exactly enclosed."""
        value, tolerance = arb(self.parameters[name][limb]), arb(self.tolerances[name][limb])
        return Span(value - tolerance, value + tolerance)

    def difference(self, name: str, less: str, limb: int) -> Span:
        """All that one size less another may be: a machine in which sizes act so has one variable for it."""
        one, other = self.span(name, limb), self.span(less, limb)
        return Span(one.low - other.high, one.high - other.low)

    def spans(self, *names: str) -> dict[str, Span]:
        """Sizes of all limbs."""
        return {f"{name}{limb + 1}": self.span(name, limb) for name in names for limb in LIMBS}

    def range(self, name: str) -> Range | None:
        limit = self.limits.get(name)
        return limit if isinstance(limit, tuple) else None

    def number(self, name: str) -> float | None:
        limit = self.limits.get(name)
        return float(limit) if isinstance(limit, int | float) else None


@dataclass(frozen=True)
class Mechanism:
    """``drives``: each with the determinant that vanishes where it loses control of the platform. ``links``:
    the parameters whose sum is the total link length. ``actuator``: powers of an actuator's coordinate.
    ``describe``: the setting and the variables of machines."""

    name: str
    parameters: tuple[Parameter, ...]
    mode: tuple[ModeField, ...]
    limits: Mapping[str, Limit]
    drives: Mapping[str, str]
    determinants: tuple[str, ...]
    links: tuple[str, ...]
    actuator: Powers
    configuration: type[Configuration]
    describe: Callable[[Made], tuple[Setting, Sizes]]

    @property
    def transmission_drive(self) -> str:
        return self.configuration.transmission_drive

    def machines(self, made: Made) -> Machines:
        return Machines(self.configuration, *self.describe(made))
