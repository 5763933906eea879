"""Useful regions: the set of poses the designer needs. Lengths in metres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


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


@dataclass(frozen=True)
class Tilt:
    """Every pose tilted by up to ``tilt`` (rad), whichever way, at distances over a height (m)."""

    tilt: float
    height: float


Shape = Box | Cylinder | Sphere | Ellipsoid | Points | Tilt


@dataclass(frozen=True)
class RegionForm:
    """One kind of region as studies name it. ``positions``: its poses are positions."""

    name: str
    keys: str
    description: str
    positions: bool = True


REGIONS: Mapping[str, RegionForm] = MappingProxyType(
    {
        form.name: form
        for form in (
            RegionForm("box", "size: [x, y, z]", "axis-aligned box with these edges"),
            RegionForm("cylinder", "radius, height", "solid cylinder, its axis along z"),
            RegionForm("sphere", "radius", "solid ball"),
            RegionForm("ellipsoid", "semi_axes: [x, y, z]", "solid ellipsoid with these half axes"),
            RegionForm("points", "file: poses.csv", "isolated poses, columns x, y, z, about the centre"),
            RegionForm(
                "tilt",
                "tilt, height, center: {d}",
                "every tilt up to this one, whichever way, at distances d over this height",
                positions=False,
            ),
        )
    }
)
