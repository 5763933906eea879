"""The two units a study declares, and the way to and from SI.

Everything inside the program is metres and radians; study files, tables and printed lines carry the
study's own units.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Literal

Length = Literal["mm", "cm", "m", "in"]
Angle = Literal["deg", "rad"]

# Metres in one unit as a quotient of whole numbers: 1 / 1000 is the nearest number to a millimetre, so that
# `value * 1 / 1000` rounds once, where `value * 0.001` rounds twice.
_METRES: dict[str, tuple[int, int]] = {"mm": (1, 1000), "cm": (1, 100), "m": (1, 1), "in": (127, 5000)}

_DIMENSIONS = {"length": "m", "angle": "rad", "ratio": "-", "mode": "-"}
_POWERS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_FACTOR = re.compile(r"(m|rad|1)(-?[0-9]*)\Z")


def si_unit(dimension: str) -> str:
    """The SI unit of a dimension: ``length`` → ``m``, ``angle`` → ``rad``, anything else ``-``."""
    return _DIMENSIONS[dimension]


def unit_for(unit: str, actuator_unit: str) -> str:
    """One of the alternatives of a unit such as ``rad or m``: the one with radians for motors that turn,
    the one without for motors that slide."""
    choices = unit.split(" or ")
    turning = [choice for choice in choices if "rad" in choice]
    sliding = [choice for choice in choices if "rad" not in choice]
    return ((turning if actuator_unit == "rad" else sliding) or choices)[0]


@cache
def _powers(unit: str) -> tuple[int, int]:
    """Powers of metre and radian in a unit: ``m³`` → (3, 0), ``m/rad`` → (1, −1), ``-`` → (0, 0)."""
    if unit in {"-", "–", "1", ""}:
        return 0, 0
    metre = radian = 0
    sign = 1
    for part in re.split(r"([/·*])", unit):
        if part in {"·", "*"}:
            sign = 1
        elif part == "/":
            sign = -1
        else:
            match = _FACTOR.match(part.strip().replace("^", "").translate(_POWERS))
            if match is None:
                raise ValueError(f"not a unit of metres and radians: {unit!r}")
            power = sign * int(match[2] or 1)
            metre += power if match[1] == "m" else 0
            radian += power if match[1] == "rad" else 0
    return metre, radian


def _written(base: str, power: int) -> str:
    return base if power == 1 else base + str(power).translate(str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"))


@dataclass(frozen=True)
class Units:
    """The length and angle unit of a study.

    The methods take a unit of SI as the program writes it: ``m``, ``rad``, ``m³``, ``m/rad``, ``-``;
    powers and quotients of metre and radian (ValueError for anything else).
    """

    length: Length = "mm"
    angle: Angle = "deg"

    def to_si(self, value: float, unit: str) -> float:
        """A number in the study's units → SI."""
        metre, radian = _powers(unit)
        up, down = _METRES[self.length]
        if metre < 0:
            up, down = down, up
        value = value * up ** abs(metre) / down ** abs(metre)
        if self.angle == "deg" and radian:
            value = math.radians(value) if radian == 1 else value * (math.pi / 180) ** radian
        return value

    def from_si(self, value: float, unit: str) -> float:
        """SI → a number in the study's units.

        The shortest decimal that means the same number: whatever was written with at most 15 digits
        comes back as it was written.
        """
        metre, radian = _powers(unit)
        up, down = _METRES[self.length]
        if metre < 0:
            up, down = down, up
        exact = value * down ** abs(metre) / up ** abs(metre)
        if self.angle == "deg" and radian:
            exact = math.degrees(exact) if radian == 1 else exact / (math.pi / 180) ** radian
        short = float(f"{exact:.15g}")
        return short if self.to_si(short, unit) == value else exact

    def name(self, unit: str) -> str:
        """The study's unit for a unit of SI: ``m³`` → ``mm³``, ``m/rad`` → ``mm/deg``, ``-`` → ``-``."""
        powers = [
            (self.length, power) if base == "m" else (self.angle, power)
            for base, power in zip(("m", "rad"), _powers(unit), strict=True)
            if power
        ]
        above = "·".join(_written(base, power) for base, power in powers if power > 0)
        below = "·".join(_written(base, -power) for base, power in powers if power < 0)
        if not powers:
            return "-"
        return f"{above or '1'}/{below}" if below else above

    def heading(self, name: str, unit: str) -> str:
        """A column heading or name with its unit: ``f [mm]``."""
        return f"{name} [{self.name(unit)}]"

    def written(self, value: float, unit: str, digits: int = 6) -> str:
        """A number of SI for people: ``375 mm``; dimensionless numbers stand alone."""
        number = f"{self.from_si(value, unit):.{digits}g}"
        return number if self.name(unit) == "-" else f"{number} {self.name(unit)}"
