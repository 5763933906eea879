"""Limbs that push along a unit row and have one drive."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import NamedTuple

from flint import arb

from tpm_design.checker.balls import Enclosure, Triple, constant, determinant
from tpm_design.checker.mechanisms.configuration import LIMBS, Configuration, Velocity

ONE = arb(1)


class Push(NamedTuple):
    """Of one limb: the unit row s_i, b_i, and (b_i over the crank)²."""

    row: Triple
    b: Enclosure
    serial_squared: Enclosure


class Pushing(Configuration):
    """What rows and b alone tell."""

    @abstractmethod
    def push(self, limb: int) -> Push: ...

    @cached_property
    def pushes(self) -> tuple[Push, Push, Push]:
        first, second, third = (self.push(limb) for limb in LIMBS)
        return first, second, third

    def constraint_normal(self, limb: int) -> Triple:
        """The unit normal of a parallelogram, where the mechanism has a rotation determinant."""
        raise NotImplementedError

    def unit_determinant(self, name: str) -> Enclosure:
        if name == "rotation":
            return determinant([self.constraint_normal(limb) for limb in LIMBS])
        return determinant([push.row for push in self.pushes])

    def velocity(self, drive: str) -> Velocity:
        first, second, third = self.pushes
        return Velocity(
            (first.row, second.row, third.row), (constant(ONE),) * 3, (first.b, second.b, third.b)
        )

    def serial_squared(self, limb: int) -> Enclosure:
        return self.pushes[limb].serial_squared


def swing_bound(swing: float | None) -> arb | None:
    """sin of the greatest swing; None where it holds nothing back."""
    if swing is None or not arb(swing) < arb.pi() / 2:
        return None
    return arb(swing).sin()
