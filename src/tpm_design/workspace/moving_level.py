"""The part of a ray field with 1/κ above a threshold, for neighbouring machines, to first order.

It ends where segments end (``moving_boundary.py``) and where 1/κ passes the threshold: there the ray
parameter moves by the change of 1/κ over its slope along the ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import kernel, short_kernel
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.aspects import RayField
from tpm_design.workspace.averages import condition_along, ray_nodes, scanned, step_of


class Crossings(NamedTuple):
    """S segments: whether 1/κ is above the threshold where they begin and end (S,). K crossings of it: their
    ``ray`` (K,) and ray parameter ``t`` (K,), ``sign`` (K,) +1 where a part above ends, −1 where one begins,
    and ``gain`` (K,): how far t moves back per unit of 1/κ, 0 where it has no slope."""

    begins_above: NDArray[np.bool_]
    ends_above: NDArray[np.bool_]
    ray: NDArray[np.int64]
    t: NDArray[np.float64]
    sign: NDArray[np.float64]
    gain: NDArray[np.float64]


@dataclass(frozen=True)
class MovingLevel:
    """Where 1/κ of a machine in a mode of ``signs`` passes a threshold; ``rest`` (K,): gain · 1/κ there."""

    signs: Any
    frobenius: bool
    motor: float
    crossings: Crossings
    rest: NDArray[np.float64]


@kernel
def _crossings(geometry, mode, frobenius, motor, threshold, origin, scale, directions, segments, places):  # type: ignore[no-untyped-def]
    """The members of ``Crossings``."""
    rays, starts, ends = segments
    most = rays.size * (places.size + 1)
    begins_above, ends_above = np.empty(rays.size, np.bool_), np.empty(rays.size, np.bool_)
    ray, t, sign, gain = np.empty(most, np.int64), np.empty(most), np.empty(most), np.empty(most)
    values, found = np.empty(places.size + 2), np.empty(places.size + 1)
    count = 0
    for s in range(rays.size):
        start, end = starts[s], ends[s]
        step = step_of(scale, directions[rays[s]])
        number = scanned(
            geometry, mode, frobenius, motor, threshold, origin, step, start, end, places, values, found
        )
        is_above = values[0] >= threshold
        begins_above[s] = is_above
        for k in range(number):
            # inside the segment, where 1/κ goes with the root of the distance to the shell
            h = min(1e-6 * found[k], 1e-3 * min(found[k] - start, end - found[k]))
            after = condition_along(geometry, mode, frobenius, motor, origin, step, found[k] + h)
            before = condition_along(geometry, mode, frobenius, motor, origin, step, found[k] - h)
            # falls where a part above ends
            falls = (after < before) if is_above else (after > before)
            ray[count], t[count] = rays[s], found[k]
            sign[count] = 1.0 if is_above else -1.0
            gain[count] = 2.0 * h / (after - before) if falls else 0.0
            is_above = not is_above
            count += 1
        ends_above[s] = is_above
    return begins_above, ends_above, ray[:count], t[:count], sign[:count], gain[:count]


@short_kernel
def _above(geometry, mode, frobenius, motor, origin, scale, directions, weights, crossings, rest, segments):  # type: ignore[no-untyped-def]
    """Gain · 1/κ at the crossings (K,), and Σ weight ∫ t² dt of the parts above the threshold."""
    rays, starts, ends = segments
    sums = np.empty(crossings.t.size)
    total = 0.0
    for k in range(sums.size):
        ray = crossings.ray[k]
        step = step_of(scale, directions[ray])
        value = condition_along(geometry, mode, frobenius, motor, origin, step, crossings.t[k])
        sums[k] = crossings.gain[k] * value
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
    *,
    frobenius: bool,
    motor: float,
    threshold: float,
    nodes: int,
) -> MovingLevel:
    """Where 1/κ passes ``threshold`` on the segments of a field, looked for between ``nodes`` along each, as
    ``conditioning_averages`` does."""
    crossings = Crossings(
        *_crossings(
            mechanism.geometry,
            mode.signs,
            frobenius,
            motor,
            threshold,
            field.origin,
            field.scale,
            field.rays.directions,
            (field.segments.ray, field.segments.start, field.segments.end),
            ray_nodes(nodes)[0],
        )
    )
    level = MovingLevel(mode.signs, frobenius, motor, crossings, np.zeros(crossings.t.size))
    rest, _ = _level_of(level, mechanism, field)
    return MovingLevel(mode.signs, frobenius, motor, crossings, rest)


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
        level.crossings,
        level.rest,
        (field.segments.ray, field.segments.start, field.segments.end),
    )
    return sums, total
