"""Where a mechanism's parameters and coordinates are written on its line drawing."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from tpm_design.report.skeleton import FloatArray, Skeleton, parameter_value, unit

LEAST_ANGLE = math.radians(3.0)
ARC_RADIUS, ARC_POINTS = 0.08, 25


@dataclass(frozen=True)
class Length:
    """A parameter or coordinate along a line; ``on_link``: that line is a link."""

    name: str
    start: FloatArray
    end: FloatArray
    on_link: bool


@dataclass(frozen=True)
class Angle:
    """A parameter or coordinate in an angle: ``arc`` (points, 3), its radius about ``vertex``."""

    name: str
    vertex: FloatArray
    arc: FloatArray


@dataclass(frozen=True)
class AtPoint:
    """A parameter that belongs to a joint."""

    name: str
    at: FloatArray


Mark = Length | Angle | AtPoint


def marks(body: Skeleton, limb: int = 0) -> tuple[Mark, ...]:
    """What is written on one limb; without lengths of 0 and without angles too small to be seen."""
    found = (_mark(body, name, words, limb) for name, words in body.drawing.marks.items())
    return tuple(mark for mark in found if mark is not None)


def _mark(body: Skeleton, name: str, words: tuple[str, ...], limb: int) -> Mark | None:
    if len(words) == 1:
        at = body.point(words[0], limb)
        return None if at is None else AtPoint(name, at)
    if len(words) == 2:
        return _length(body, name, words, limb)
    vertex = body.point(words[1], limb)
    if vertex is None:
        return None
    first, second = (_seen_from(body, vertex, words[side], limb) for side in (0, 2))
    if first is None or second is None:
        return None
    angle = math.acos(max(-1.0, min(1.0, float(first @ second))))
    if not LEAST_ANGLE < angle < math.pi - 1e-6:
        return None
    return Angle(name, vertex, vertex + _arc_radius(body, vertex) * _arc(first, second, angle))


def _arc_radius(body: Skeleton, vertex: FloatArray) -> float:
    """Small, and shorter than the links about the vertex."""
    links = [
        float(np.linalg.norm(end - start))
        for limb in body.limbs
        for start, end in itertools.pairwise(limb)
        if min(np.linalg.norm(start - vertex), np.linalg.norm(end - vertex)) < 1e-9 * body.size
    ]
    return min([ARC_RADIUS * body.size, *(0.45 * link for link in links)])


def _arc(first: FloatArray, second: FloatArray, angle: float) -> FloatArray:
    shares = np.linspace(0.0, 1.0, ARC_POINTS)[:, None]
    arc = (np.sin((1.0 - shares) * angle) * first + np.sin(shares * angle) * second) / math.sin(angle)
    return np.asarray(arc)


def _seen_from(body: Skeleton, vertex: FloatArray, name: str, limb: int) -> FloatArray | None:
    """Direction from the vertex of an angle to a point, or a direction itself."""
    point = body.point(name, limb)
    return body.direction(name, limb) if point is None else unit(point - vertex)


def _length(body: Skeleton, name: str, words: tuple[str, ...], limb: int) -> Length | None:
    start, end = body.point(words[0], limb), body.point(words[1], limb)
    if start is None:
        return None
    if end is None:
        along, value = body.direction(words[1], limb), parameter_value(body.mechanism, name, limb)
        if along is None or value is None:
            return None
        end = start + value * along
    if np.linalg.norm(end - start) < 1e-3 * body.size:
        return None
    first, second = body.joint(words[0]), body.joint(words[1])
    on_link = first is not None and second is not None and not body.is_rail(first)
    return Length(name, start, end, on_link)
