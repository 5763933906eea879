"""Families of bodies that may be inscribed: which sizes are free, and the region that each body is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.errors import UsageError, did_you_mean
from tpm_design.optimizers.polytope import UnitBody, extents
from tpm_design.workspace.region_geometry import PlacedRegion, place
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Shape, Sphere

FloatArray = NDArray[np.float64]
Triple = tuple[float, float, float]

BODIES = ("box", "sphere", "cylinder", "ellipsoid")
# of the unit bodies, whose half sizes are 1
UNIT_VOLUMES = {"box": 8.0, "cylinder": 2.0 * math.pi, "ellipsoid": 4.0 * math.pi / 3.0}


@dataclass(frozen=True, eq=False)
class BodyForm:
    """Bodies {centre + half ∘ u : u in the unit body} with half sizes ``half`` = ``spread`` (3, k) · sizes
    along x, y and z. The sizes (m) are half edges, half axes, or a radius and half a height."""

    name: str
    unit: UnitBody
    spread: FloatArray

    def half(self, sizes: FloatArray) -> FloatArray:
        """Half sizes (3,)."""
        return np.asarray(self.spread @ sizes)

    def volume(self, sizes: FloatArray) -> float:
        """m³."""
        return UNIT_VOLUMES[self.unit] * float(np.prod(self.half(sizes)))

    def shape(self, sizes: FloatArray) -> Shape:
        """The region without its place."""
        x, y, z = self.half(sizes).tolist()
        shapes: dict[str, Shape] = {
            "box": Box((2.0 * x, 2.0 * y, 2.0 * z)),
            "sphere": Sphere(x),
            "cylinder": Cylinder(x, 2.0 * z),
            "ellipsoid": Ellipsoid((x, y, z)),
        }
        return shapes[self.name]

    def region(self, centre: FloatArray, sizes: FloatArray) -> PlacedRegion:
        """The region at its place."""
        x, y, z = centre.tolist()
        return place(self.shape(sizes), (x, y, z))

    def extents(self, normals: FloatArray, sizes: FloatArray) -> FloatArray:
        """How far the body extends from its centre along ``normals`` (N, 3)."""
        return extents(self.unit, normals, self.half(sizes))

    def gauge(self, offsets: FloatArray, sizes: FloatArray) -> FloatArray:
        """By how much the body must be scaled to reach ``offsets`` (N, 3) from its centre."""
        unit = np.abs(offsets) / self.half(sizes)
        if self.unit == "box":
            return np.asarray(unit.max(axis=1))
        if self.unit == "cylinder":
            return np.maximum(np.hypot(unit[:, 0], unit[:, 1]), unit[:, 2])
        return np.asarray(np.linalg.norm(unit, axis=1))


def body_form(name: str, proportions: Sequence[float] | None = None) -> BodyForm:
    """The family of a name of ``BODIES``. ``proportions``: of the whole sizes along x, y and z, if they are
    given; one size is free then. Raises UsageError."""
    if name not in BODIES:
        raise UsageError(f"There is no body {name!r}.", remedy=did_you_mean(name, BODIES))
    unit: UnitBody = "box" if name == "box" else "cylinder" if name == "cylinder" else "ellipsoid"
    if proportions is not None:
        return BodyForm(name, unit, _column(name, proportions))
    spreads = {
        "sphere": np.ones((3, 1)),
        "cylinder": np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
    }
    return BodyForm(name, unit, spreads.get(name, np.eye(3)))


def _column(name: str, proportions: Sequence[float]) -> FloatArray:
    if name == "sphere":
        raise UsageError("A sphere is as long as it is wide.", remedy="Leave the proportions out.")
    values = np.asarray(proportions, dtype=np.float64)
    if values.shape != (3,) or not np.all(np.isfinite(values)) or not np.all(values > 0.0):
        raise UsageError(
            "The proportions are not three numbers above 0.",
            remedy="Give the sizes along x, y and z in any unit, such as 1,1,0.5.",
        )
    if values.max() > 1e3 * values.min():
        raise UsageError("The proportions differ by more than 1000 times.", remedy="Choose others.")
    if name == "cylinder" and values[0] != values[1]:
        raise UsageError(
            "A cylinder has its axis along z: it is as long along x as along y.",
            remedy="Give equal proportions for x and y.",
        )
    return np.asarray(values / values.max())[:, None]
