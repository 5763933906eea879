"""Useful regions: the set of poses the designer needs. Lengths in metres."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Box:
    """Axis-aligned box with edge lengths ``size`` (m)."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """Solid cylinder, its axis along z."""

    radius: float
    height: float


@dataclass(frozen=True)
class Sphere:
    """Solid ball."""

    radius: float


@dataclass(frozen=True)
class Ellipsoid:
    """Solid ellipsoid with half axes along x, y, z (m)."""

    semi_axes: tuple[float, float, float]


@dataclass(frozen=True)
class Points:
    """Isolated poses (m), relative to the region's centre."""

    points: tuple[tuple[float, float, float], ...]


Shape = Box | Cylinder | Sphere | Ellipsoid | Points
