"""Regions as convex hulls of points and ellipsoids: what is convex holds over all if it holds on these."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Points, Shape, Sphere

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """A region about its centre (m). ``points`` (N, 3); ``ellipsoids``: {middle + axes u : |u| ≤ 1}, the
    middle (3,) and the half axes as columns (3, k). The region holds them all and lies in their hull."""

    points: FloatArray
    ellipsoids: tuple[tuple[FloatArray, FloatArray], ...] = ()

    def lowest(self, direction: FloatArray) -> float:
        """Least value of ``direction`` (3,) · u over the body."""
        values = [float(np.min(self.points @ direction))] if len(self.points) else []
        values += [
            float(middle @ direction - np.linalg.norm(axes.T @ direction)) for middle, axes in self.ellipsoids
        ]
        return min(values)

    @property
    def extent(self) -> float:
        """No coordinate of a point of the body is larger (m)."""
        sides = (*np.eye(3), *-np.eye(3))
        return max(-self.lowest(side) for side in sides)


def body(shape: Shape) -> Body | None:
    """The region as a body, None where its poses are not positions."""
    none = np.zeros((0, 3))
    if isinstance(shape, Box):
        corners = itertools.product(*((-0.5 * edge, 0.5 * edge) for edge in shape.size))
        return Body(np.array(list(corners)))
    if isinstance(shape, Points):
        return Body(np.array(shape.points, dtype=np.float64))
    if isinstance(shape, Sphere):
        return Body(none, ((np.zeros(3), shape.radius * np.eye(3)),))
    if isinstance(shape, Ellipsoid):
        return Body(none, ((np.zeros(3), np.diag(shape.semi_axes)),))
    if isinstance(shape, Cylinder):
        disc = shape.radius * np.eye(3)[:, :2]
        ends = (np.array([0.0, 0.0, side * 0.5 * shape.height]) for side in (-1.0, 1.0))
        return Body(none, tuple((end, disc) for end in ends))
    return None
