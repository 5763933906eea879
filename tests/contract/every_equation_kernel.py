"""All equations of a mechanism over a box of poses and at poses, in compiled functions."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpm_design.arithmetic import Interval, variables
from tpm_design.mechanisms import equations

# isort: split
from numba import njit


@njit(error_model="numpy")
def all_values(geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> Any:
    """Every equation that proofs use, as one tuple of one kind of number."""
    (p, q, r), b, _ = equations.unit_velocity_map(geometry, mode, 1.0, x, y, z)
    margins = equations.leg_margins(geometry, mode, x, y, z) + equations.mode_margins(geometry, mode, x, y, z)
    distances = equations.singularity_margins(geometry, mode, x, y, z) + equations.serial_margins(
        geometry, mode, x, y, z
    )
    return margins + distances + p + q + r + b


@njit(error_model="numpy")
def bounds_over(geometry: Any, mode: Any, box: Any) -> Any:
    """Lower and upper bounds (M, 2) of every value, and of its derivatives (M, 3, 2), over ``box`` (3, 2)."""
    pose = (Interval(box[0, 0], box[0, 1]), Interval(box[1, 0], box[1, 1]), Interval(box[2, 0], box[2, 1]))
    u, v, w = variables(pose)
    values = all_values(geometry, mode, pose[0], pose[1], pose[2])
    duals = all_values(geometry, mode, u, v, w)
    bounds, slopes = np.empty((len(values), 2)), np.empty((len(values), 3, 2))
    for m in range(len(values)):
        bounds[m, 0], bounds[m, 1] = values[m].lo, values[m].hi
        for k in range(3):
            slopes[m, k, 0], slopes[m, k, 1] = duals[m].derivatives[k].lo, duals[m].derivatives[k].hi
    return bounds, slopes


@njit(error_model="numpy")
def values_at(geometry: Any, mode: Any, pose: Any) -> Any:
    """Every value (M,) at one pose, by floats."""
    return np.array(all_values(geometry, mode, pose[0], pose[1], pose[2]))
