"""Forms of every constraint over boxes and the constraints' values at poses, in compiled loops."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpm_design.mechanisms import equations
from tpm_design.workspace.box_fraction import share_below
from tpm_design.workspace.box_verdicts import MOST_CONSTRAINTS, settle

# isort: split
from numba import njit


@njit(error_model="numpy")
def forms_of(
    geometry: Any, mode: Any, counts: Any, signs: Any, margin: float, charts: Any, boxes: Any, known: Any
) -> Any:
    """Bits proved (N,) or −1, and the open forms (N, K, 5), with ``known`` bits taken as proved before."""
    forms = np.full((len(boxes), MOST_CONSTRAINTS, 5), np.nan)
    proved = np.empty(len(boxes), np.int64)
    for n in range(len(boxes)):
        octant = (float(charts[n, 1]), float(charts[n, 2]), float(charts[n, 3]))
        proved[n] = settle(
            geometry, mode, counts, signs, margin, charts[n, 0], octant, boxes[n], known[n], forms[n]
        )
    return proved, forms


@njit(error_model="numpy")
def values_at(geometry: Any, mode: Any, counts: Any, signs: Any, margin: float, poses: Any) -> Any:
    """All constraints (N, K) at poses (N, 3), by floats."""
    values = np.empty((len(poses), counts[0] + counts[1] + counts[2]))
    for n in range(len(poses)):
        x, y, z = poses[n, 0], poses[n, 1], poses[n, 2]
        k = 0
        for value in equations.leg_margins(geometry, mode, x, y, z):
            values[n, k] = value
            k += 1
        for value in equations.mode_margins(geometry, mode, x, y, z):
            values[n, k] = value
            k += 1
        if counts[2] > 0:
            for i, value in enumerate(equations.singularity_margins(geometry, mode, x, y, z)):
                values[n, k + i] = signs[i] * value - margin
    return values


@njit
def share_at(level: float, first: float, second: float, third: float) -> Any:
    return share_below(level, first, second, third)
