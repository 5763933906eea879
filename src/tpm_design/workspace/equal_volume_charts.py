"""Coordinates in which equal boxes have equal volumes: a third of the cubed radius, and a direction.

A chart covers the pyramid of one octant in which one axis a has the largest coordinate: the pose is
t·(±1, ±u, ±v) along the axes a, a + 1, a + 2 with u, v in [0, 1], t = ∛(3s), and dx dy dz = ds du dv. Three
charts cover an octant. Shells of reach are nearly surfaces s = constant, so that boxes become thin across
them, and what depends on the direction alone needs no cuts along s.

A box is (s from, s to, u from, u to, v from, v to).
"""

from __future__ import annotations

import math

from tpm_design.arithmetic import Interval, inner, root
from tpm_design.arithmetic.affine import coordinate_form, linearised
from tpm_design.arithmetic.interval import down, up

CHARTS_PER_OCTANT = 3
# below it, products have no digits left
LEAST_CUBE = 1e-290
# relative: more than the errors of the library's root and of the check that follows
CAUTION = 1e-15


@inner
def _root_below(cube):  # type: ignore[no-untyped-def]
    """A number whose cube is at most ``cube``."""
    if not cube > LEAST_CUBE:
        return 0.0
    t = cube ** (1.0 / 3.0) * (1.0 - CAUTION)
    return t if up(up(t * t) * t) <= cube else 0.0


@inner
def _root_above(cube):  # type: ignore[no-untyped-def]
    """A number whose cube is at least ``cube``."""
    t = max(cube, LEAST_CUBE) ** (1.0 / 3.0) * (1.0 + CAUTION)
    return t if down(down(t * t) * t) >= cube else math.inf


@inner
def radii(s):  # type: ignore[no-untyped-def]
    """∛(3s) of an Interval s ≥ 0."""
    return Interval(_root_below(down(3.0 * s.lo)), _root_above(up(3.0 * s.hi)))


@inner
def radius_form(lo, hi):  # type: ignore[no-untyped-def]
    """∛(3s) for s between lo and hi, concave: less the chord p s it is least at an end and greatest,
    2/(3√p), where t = 1/√p."""
    first, last = Interval(lo, lo), Interval(hi, hi)
    at_first, at_last = radii(first), radii(last)
    p = (at_last.hi - at_first.lo) / (hi - lo)
    slope = Interval(p, p)
    most = 2.0 / (3.0 * root(slope))
    least = min((at_first - slope * first).lo, (at_last - slope * last).lo)
    return linearised(coordinate_form(lo, hi, 0), p, Interval(least, most.hi))


@inner
def _placed(axis, octant, t, across, beyond):  # type: ignore[no-untyped-def]
    a, b, c = octant[axis] * t, octant[(axis + 1) % 3] * across, octant[(axis + 2) % 3] * beyond
    if axis == 0:
        return a, b, c
    if axis == 1:
        return c, a, b
    return b, c, a


@inner
def pose_bounds(axis, octant, box):  # type: ignore[no-untyped-def]
    """x, y, z as Intervals that hold all poses of a box."""
    t = radii(Interval(box[0], box[1]))
    return _placed(axis, octant, t, t * Interval(box[2], box[3]), t * Interval(box[4], box[5]))


@inner
def pose_forms(axis, octant, box):  # type: ignore[no-untyped-def]
    """x, y, z as linear forms over a box."""
    t = radius_form(box[0], box[1])
    u, v = coordinate_form(box[2], box[3], 1), coordinate_form(box[4], box[5], 2)
    return _placed(axis, octant, t, t * u, t * v)


def largest_s(radius: float) -> float:
    """Extent of s that holds all poses within ``radius``; of few digits, so that its halves are exact."""
    mantissa, exponent = math.frexp(radius**3 / 3.0 * (1.0 + 1e-9))
    return math.ldexp(math.ceil(mantissa * 1024.0) / 1024.0, exponent)
