"""Where words of a drawing go: clear of lines and of each other. Everything in points on the page."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tpm_design.report.skeleton import FloatArray

SAMPLES = 25
DIRECTIONS = 16
DISTANCES = (3.0, 7.0, 12.0, 18.0)
SIDEWAYS = (0.5, 0.42, 0.58, 0.34, 0.66, 0.26, 0.74)


@dataclass(frozen=True)
class Label:
    """A rectangle of words about its centre."""

    centre: tuple[float, float]
    half: tuple[float, float]

    def overlap(self, other: Label) -> float:
        """Common area as a share of the smaller one."""
        width, height = (
            max(
                0.0,
                min(self.centre[k] + self.half[k], other.centre[k] + other.half[k])
                - max(self.centre[k] - self.half[k], other.centre[k] - other.half[k]),
            )
            for k in (0, 1)
        )
        smaller = min(label.half[0] * label.half[1] for label in (self, other))
        return width * height / (4.0 * smaller)

    def covered(self, points: FloatArray) -> int:
        """How many of the points (n, 2) lie inside."""
        inside = np.abs(points - np.array(self.centre)) < np.array(self.half)
        return int(inside.all(axis=1).sum())


@dataclass(frozen=True)
class Place:
    """A place for a label, and how far it is from where one would like it (points)."""

    label: Label
    detour: float


def beside_point(at: FloatArray, half: tuple[float, float], gap: float) -> list[Place]:
    """Places around a point, ``gap`` (points) from it at least."""
    places = []
    for distance in DISTANCES:
        for turn in range(DIRECTIONS):
            angle = 2.0 * np.pi * turn / DIRECTIONS
            ray = np.array([np.cos(angle), np.sin(angle)])
            reach = min(half[k] / max(abs(ray[k]), 1e-9) for k in (0, 1))
            centre = at + (gap + distance + reach) * ray
            places.append(Place(Label((float(centre[0]), float(centre[1])), half), distance))
    return places


def beside_line(start: FloatArray, end: FloatArray, half: tuple[float, float], gap: float) -> list[Place]:
    """Places along a line on both sides, its middle first."""
    normal = across(start, end)
    room = abs(normal[0]) * half[0] + abs(normal[1]) * half[1]
    places = []
    for share in SIDEWAYS:
        for side in (1.0, -1.0):
            for more in (0.0, 4.0, 9.0):
                centre = start + share * (end - start) + side * (gap + more + room) * normal
                places.append(
                    Place(Label((float(centre[0]), float(centre[1])), half), 12.0 * abs(share - 0.5) + more)
                )
    return places


def across(start: FloatArray, end: FloatArray) -> FloatArray:
    """Unit normal of a line on the page."""
    along = end - start
    length = max(float(np.hypot(*along)), 1e-9)
    return np.array([-along[1], along[0]]) / length


def dense(lines: Iterable[FloatArray]) -> FloatArray:
    """Points along polylines, no farther apart than a few points."""
    pieces = [np.empty((0, 2))]
    for line in lines:
        for start, end in itertools.pairwise(line):
            count = max(2, int(np.hypot(*(end - start)) / 2.0))
            pieces.append(start + np.linspace(0.0, 1.0, count)[:, None] * (end - start))
    return np.vstack(pieces)


def best_place(
    places: Sequence[Place], taken: Sequence[Label], lines: FloatArray, page: tuple[float, float]
) -> Label:
    """The place that covers least: other words count most, then lines, then the detour."""
    return min(places, key=lambda place: place_cost(place, taken, lines, page)).label


def place_cost(place: Place, taken: Sequence[Label], lines: FloatArray, page: tuple[float, float]) -> float:
    label = place.label
    outside = sum(
        max(0.0, label.half[k] - label.centre[k]) + max(0.0, label.centre[k] + label.half[k] - page[k])
        for k in (0, 1)
    )
    words = sum(label.overlap(other) for other in taken)
    return round(100.0 * words + 3.0 * label.covered(lines) + 20.0 * outside + 0.4 * place.detour, 6)
