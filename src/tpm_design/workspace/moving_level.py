"""The part of a ray field with 1/κ above a threshold, for neighbouring machines, to first order.

It ends where segments end (``moving_boundary.py``) and where 1/κ passes the threshold: there the ray
parameter moves by the change of 1/κ over its slope along the ray.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import kernel, short_kernel
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.aspects import RayField
from tpm_design.workspace.averages import Crossings, condition_along
from tpm_design.workspace.rays import step_of


@dataclass(frozen=True)
class MovingLevel:
    """Where 1/κ of a machine in a mode of ``signs`` passes a threshold. Of the crossings: their ``rays``,
    their ``gains``, how far they move back per unit of 1/κ, and their ``rest``, gain · 1/κ (K,)."""

    signs: Any
    frobenius: bool
    motor: float
    crossings: Crossings
    rays: NDArray[np.int64]
    gains: NDArray[np.float64]
    rest: NDArray[np.float64]


@kernel
def _gains(geometry, mode, frobenius, motor, origin, scale, directions, segments, crossings):  # type: ignore[no-untyped-def]
    """How far each crossing moves back (K,) per unit of 1/κ, 0 where it has no slope."""
    rays, starts, ends = segments
    gains = np.zeros(crossings.t.size)
    for k in range(gains.size):
        s, t = crossings.segment[k], crossings.t[k]
        step = step_of(scale, directions[rays[s]])
        # inside the segment, where 1/κ goes with the root of the distance to the shell
        h = min(1e-6 * t, 1e-3 * min(t - starts[s], ends[s] - t))
        after = condition_along(geometry, mode, frobenius, motor, origin, step, t + h)
        before = condition_along(geometry, mode, frobenius, motor, origin, step, t - h)
        # falls where a part above ends
        if crossings.sign[k] * (after - before) < 0.0:
            gains[k] = 2.0 * h / (after - before)
    return gains


@short_kernel
def _above(geometry, mode, frobenius, motor, origin, scale, directions, weights, moving, segments):  # type: ignore[no-untyped-def]
    """Gain · 1/κ at the crossings (K,), and Σ weight ∫ t² dt of the parts above the threshold."""
    rays, starts, ends = segments
    crossings, crossing_rays, gains, rest = moving
    sums = np.empty(crossings.t.size)
    total = 0.0
    for k in range(sums.size):
        ray = crossing_rays[k]
        step = step_of(scale, directions[ray])
        value = condition_along(geometry, mode, frobenius, motor, origin, step, crossings.t[k])
        sums[k] = gains[k] * value
        moved = crossings.t[k] + (rest[k] - sums[k])
        total += crossings.sign[k] * weights[ray] * moved**3 / 3.0
    for s in range(rays.size):
        if crossings.begins_above[s]:
            total -= weights[rays[s]] * starts[s] ** 3 / 3.0
        if crossings.ends_above[s]:
            total += weights[rays[s]] * ends[s] ** 3 / 3.0
    return sums, total


def moving_level(
    mechanism: Mechanism,
    mode: Mode,
    field: RayField,
    crossings: Crossings,
    *,
    frobenius: bool,
    motor: float,
) -> MovingLevel:
    """Where 1/κ passes a threshold on the segments of a field: ``crossings`` as found on the same ones by
    ``conditioning_averages``."""
    segments = field.segments
    gains = _gains(
        mechanism.geometry,
        mode.signs,
        frobenius,
        motor,
        field.origin,
        field.scale,
        field.rays.directions,
        (segments.ray, segments.start, segments.end),
        crossings,
    )
    rays = segments.ray[crossings.segment]
    level = MovingLevel(mode.signs, frobenius, motor, crossings, rays, gains, np.zeros(gains.size))
    rest, _ = _level_of(level, mechanism, field)
    return replace(level, rest=rest)


def volume_above_near(level: MovingLevel, mechanism: Mechanism, moved: RayField) -> float:
    """Volume (m³), to first order, in which 1/κ of a neighbouring machine is above the threshold; ``moved``:
    its segments, by ``field_near`` from those of the level."""
    scale = moved.scale
    return abs(scale[0] * scale[1] * scale[2]) * _level_of(level, mechanism, moved)[1]


def _level_of(level: MovingLevel, mechanism: Mechanism, field: RayField) -> tuple[NDArray[np.float64], float]:
    sums, total = _above(
        mechanism.geometry,
        level.signs,
        level.frobenius,
        level.motor,
        field.origin,
        field.scale,
        field.rays.directions,
        field.rays.weights,
        (level.crossings, level.rays, level.gains, level.rest),
        (field.segments.ray, field.segments.start, field.segments.end),
    )
    return sums, total
