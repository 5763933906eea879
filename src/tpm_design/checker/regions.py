"""The poses a statement speaks of: a region, or all within a distance of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise, product

from flint import arb

Interval = tuple[float, float]
Box = tuple[Interval, Interval, Interval]
Point = tuple[float, float, float]
PROJECTIONS = 60


@dataclass(frozen=True)
class Region:
    """``form``: box, cylinder or ellipsoid, with ``half`` edges, (radius, radius, half height) or half
    axes (m), or points."""

    form: str
    centre: Point = (0.0, 0.0, 0.0)
    half: Point = (0.0, 0.0, 0.0)
    points: tuple[Point, ...] = ()

    @property
    def parts(self) -> tuple[Region, ...]:
        """Bodies that together are the region, each with a cover of its own or all with one."""
        if self.form != "points":
            return (self,)
        return tuple(Region("box", point) for point in self.points)

    @property
    def reference(self) -> Point:
        """A pose of the region."""
        return self.points[0] if self.form == "points" else self.centre


@dataclass(frozen=True)
class Domain:
    """All poses within ``distance`` (m) of a body."""

    body: Region
    distance: float

    def outside(self, box: Box) -> bool:
        """Whether a box has no pose of the domain: a proof, so that False may also mean not known."""
        gaps = [
            at_least_zero(interval, centre) for interval, centre in zip(box, self.body.centre, strict=True)
        ]
        half = [arb(value) for value in self.body.half]
        distance = arb(self.distance)
        if self.body.form == "ellipsoid":
            return self._outside_ellipsoid(box, gaps)
        if self.body.form == "cylinder":
            across = (gaps[0] ** 2 + gaps[1] ** 2).sqrt() - half[0]
            beyond = [across, gaps[2] - half[2]]
        else:
            beyond = [gap - edge for gap, edge in zip(gaps, half, strict=True)]
        if any(gap > distance for gap in beyond):
            return True
        total = arb(0)
        for gap in beyond:
            total += arb(0).max(gap.lower()) ** 2
        return bool(total > distance**2)

    def _outside_ellipsoid(self, box: Box, gaps: Sequence[arb]) -> bool:
        """By a plane between the box and the ellipsoid grown by the distance: in the direction n the
        ellipsoid ends at n·c + |diag(half) n|."""
        total = arb(0)
        for gap, half in zip(gaps, self.body.half, strict=True):
            total += (gap / half) ** 2
        if not total > 1:
            return False
        if self.distance == 0.0:
            return True
        normal = self._toward(box)
        if normal is None:
            return False
        near, length, support = arb(0), arb(0), arb(0)
        for (low, high), centre, half, part in zip(
            box, self.body.centre, self.body.half, normal, strict=True
        ):
            end = low if part > 0.0 else high
            near += (arb(end) - arb(centre)) * arb(part)
            length += arb(part) ** 2
            support += (arb(half) * arb(part)) ** 2
        return bool(near - support.sqrt() > arb(self.distance) * length.sqrt())

    def _toward(self, box: Box) -> Point | None:
        """Direction from the ellipsoid's point nearest to a box to the box, by projecting in turns."""
        centre, half = self.body.centre, self.body.half
        foot = centre
        for _ in range(PROJECTIONS):
            near = tuple(min(high, max(low, at)) for (low, high), at in zip(box, foot, strict=True))
            away = nearest_on_ellipsoid(half, [a - c for a, c in zip(near, centre, strict=True)])
            foot = (centre[0] + away[0], centre[1] + away[1], centre[2] + away[2])
        gap = tuple(a - b for a, b in zip(near, foot, strict=True))
        size = math.hypot(*gap)
        return (gap[0] / size, gap[1] / size, gap[2] / size) if size > 0.0 else None

    def bounds(self) -> list[tuple[Fraction, Fraction]]:
        """The bounding box, exactly."""
        reach = [Fraction(half) + Fraction(self.distance) for half in self.body.half]
        return [
            (Fraction(centre) - size, Fraction(centre) + size)
            for centre, size in zip(self.body.centre, reach, strict=True)
        ]

    def covered_by(self, roots: Sequence[Box]) -> bool:
        """Whether boxes together contain the bounding box: the faces of all cut it into cells, each of which
        lies wholly inside or outside of each box."""
        bounds = self.bounds()
        exact = [[(Fraction(low), Fraction(high)) for low, high in root] for root in roots]
        if any(contains(root, bounds) for root in exact):
            return True
        cuts = [
            sorted({low, high} | {end for root in exact for end in root[axis] if low < end < high})
            for axis, (low, high) in enumerate(bounds)
        ]
        cells = [list(pairwise(ends)) or [(ends[0], ends[0])] for ends in cuts]
        return all(any(contains(root, cell) for root in exact) for cell in product(*cells))

    def holds(self, pose: Point, slack: float) -> bool:
        """Whether a pose is in the domain, or outside by no more than ``slack`` (m)."""
        centre, half = self.body.centre, self.body.half
        at = [p - c for p, c in zip(pose, centre, strict=True)]
        if self.body.form == "ellipsoid":
            foot: Sequence[float] = nearest_on_ellipsoid(half, at)
        elif self.body.form == "cylinder":
            across = math.hypot(at[0], at[1])
            shrink = min(1.0, half[0] / across) if across > 0.0 else 1.0
            foot = (shrink * at[0], shrink * at[1], min(half[2], max(-half[2], at[2])))
        else:
            foot = [min(edge, max(-edge, value)) for edge, value in zip(half, at, strict=True)]
        return math.dist(foot, at) <= self.distance + slack


def contains(root: Sequence[tuple[Fraction, Fraction]], cell: Sequence[tuple[Fraction, Fraction]]) -> bool:
    return all(
        low <= cell_low and cell_high <= high
        for (low, high), (cell_low, cell_high) in zip(root, cell, strict=True)
    )


def at_least_zero(interval: Interval, centre: float) -> arb:
    """Least distance of an interval from a number, 0 if it holds it."""
    low, high = interval
    if low > centre:
        return arb(low) - arb(centre)
    return arb(centre) - arb(high) if high < centre else arb(0)


def nearest_on_ellipsoid(half: Point, at: Sequence[float]) -> Point:
    """The nearest point of a solid ellipsoid about the origin, in plain numbers: half² p/(half² + t) with
    the t ≥ 0 that puts it on the surface, by bisection."""
    size = math.hypot(*at)

    def foot(t: float) -> Point:
        x, y, z = (h * h * p / (h * h + t) for h, p in zip(half, at, strict=True))
        return x, y, z

    def beyond(t: float) -> bool:
        return sum((p / h) ** 2 for h, p in zip(half, foot(t), strict=True)) > 1.0

    if not beyond(0.0):
        return at[0], at[1], at[2]
    low, high = 0.0, max(half) * size
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if beyond(middle) else (low, middle)
    return foot(high)
