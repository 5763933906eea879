"""A strut from a carriage on a rail to the platform, in the rail's frame."""

from __future__ import annotations

from typing import NamedTuple

from flint import arb

from tpm_design.checker.balls import Enclosure, constant, direction, root, square

ONE = arb(1)


class Strut(NamedTuple):
    """Of a strut of given length to a point that is ``aside`` of the rail in two directions: the two
    components of its unit vector there, and |component| along the rail with its square."""

    aside: tuple[Enclosure, Enclosure]
    along: Enclosure
    along_squared: Enclosure


def strut(length: Enclosure, first: Enclosure, second: Enclosure) -> Strut:
    aside = (first / length, second / length)
    along_squared = constant(ONE) - square(aside[0]) - square(aside[1])
    return Strut(aside, root(along_squared), along_squared)


def reach(length: Enclosure, first: Enclosure, second: Enclosure) -> Enclosure:
    """How much the strut is longer than the way from rail to point (m)."""
    return length - direction(first, second)[2]
