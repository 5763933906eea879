"""Which aspect of a design a report shows, and where its middle is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.metrics.context import Context
from tpm_design.problem import Goal
from tpm_design.workspace.aspects import RayField, locate, mode_field

FloatArray = NDArray[np.float64]
Pose = tuple[float, float, float]

ORDER = 24


@dataclass(frozen=True)
class ChosenAspect:
    """One component of a ray field. ``signs``: of every determinant in it, ±1."""

    field: RayField
    component: int
    signs: tuple[float, ...]

    @property
    def volume(self) -> float:
        """m³."""
        return float(self.field.volumes[self.component])


def choose_aspect(context: Context, home: Pose | None) -> ChosenAspect | None:
    """The aspect that holds ``home``; else the one that holds most of the region; else the largest. None
    where the mode reaches nothing."""
    field = mode_field(context.mechanism, context.mode, order=ORDER, sided=True)
    component = None if home is None else locate(context.mechanism, context.mode, field, home)
    if component is None and context.region is not None:
        component = _component_of_region(context, field)
    if component is None:
        component = field.largest()
    if component is None:
        return None
    code = int(field.segments.code[np.argmax(field.component == component)]) - 1
    count = len(context.mechanism.kind.determinants)
    return ChosenAspect(field, component, tuple(1.0 if code >> bit & 1 else -1.0 for bit in range(count)))


def home_of(goals: Sequence[Goal]) -> Pose | None:
    """The first ``home`` pose (m) a study's metrics name."""
    for goal in goals:
        home = goal.options.get("home")
        if home is not None:
            return float(home[0]), float(home[1]), float(home[2])
    return None


def _component_of_region(context: Context, field: RayField) -> int | None:
    """Of the sides that most of the region's lattice has, the pose nearest to the region's middle."""
    margins = context.mechanism.margins_at(context.poses, context.mode)
    signs = np.column_stack([margins[name] > 0.0 for name in context.mechanism.kind.determinants])
    within = np.flatnonzero(margins["reach"] >= 0.0)
    if not within.size:
        return None
    _, side, counts = np.unique(signs[within], axis=0, return_inverse=True, return_counts=True)
    poses = context.poses[within[side.reshape(-1) == int(np.argmax(counts))]]
    middle = context.poses.mean(axis=0)
    x, y, z = poses[np.argmin(np.linalg.norm(poses - middle, axis=1))]
    return locate(context.mechanism, context.mode, field, (float(x), float(y), float(z)))


def middle_of(context: Context, aspect: ChosenAspect) -> FloatArray:
    """The centroid (3,) in metres of an aspect, or the pose of it nearest to that where it lies outside."""
    field = aspect.field
    members = np.flatnonzero(field.component == aspect.component)
    start, end = field.segments.start[members], field.segments.end[members]
    rays = field.segments.ray[members]
    steps = field.rays.directions[rays] * np.asarray(field.scale)
    weights = field.rays.weights[rays]
    moment = (weights * (end**4 - start**4) / 4.0) @ steps
    centroid = np.asarray(field.origin) + moment / (weights @ ((end**3 - start**3) / 3.0))
    at = (float(centroid[0]), float(centroid[1]), float(centroid[2]))
    if locate(context.mechanism, context.mode, field, at) == aspect.component:
        return np.asarray(at)
    middles = np.asarray(field.origin) + (0.5 * (start + end))[:, None] * steps
    return np.asarray(middles[np.argmin(np.linalg.norm(middles - centroid, axis=1))])
