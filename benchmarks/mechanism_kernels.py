"""Loops over the equations that the package does not have: everything in one go, and boxes of poses in the
three arithmetics that prove."""

from __future__ import annotations

from typing import Any

from tpm_design.arithmetic import Interval, kernel, variables
from tpm_design.arithmetic.affine import bounds
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.velocity import inverse_condition_frobenius
from tpm_design.workspace.equal_volume_charts import pose_forms


@kernel
def everything(geometry: Any, mode: Any, x: Any, y: Any, z: Any, out: Any) -> None:
    """Least reach margin, least mode margin, determinants and 1/κ_F of the motors into out (3 + D, N)."""
    for n in range(x.size):
        px, py, pz = x[n], y[n], z[n]
        legs = equations.leg_margins(geometry, mode, px, py, pz)
        sides = equations.mode_margins(geometry, mode, px, py, pz)
        determinants = equations.singularity_margins(geometry, mode, px, py, pz)
        rows, b, _ = equations.unit_velocity_map(geometry, mode, 1.0, px, py, pz)
        condition = inverse_condition_frobenius(rows, b)
        least = legs[0]
        for margin in legs:
            least = min(least, margin)
        out[0, n] = least
        least = sides[0]
        for margin in sides:
            least = min(least, margin)
        out[1, n] = least
        for k in range(len(determinants)):
            out[2 + k, n] = determinants[k]
        out[2 + len(determinants), n] = condition


@kernel
def values(geometry: Any, mode: Any, centres: Any, out: Any) -> None:
    """At the centres (3, N) into out (K, N)."""
    for n in range(centres.shape[1]):
        x, y, z = centres[0, n], centres[1, n], centres[2, n]
        k = 0
        for value in equations.leg_margins(geometry, mode, x, y, z):
            out[k, n] = value
            k += 1
        for value in equations.mode_margins(geometry, mode, x, y, z):
            out[k, n] = value
            k += 1
        for value in equations.singularity_margins(geometry, mode, x, y, z):
            out[k, n] = value
            k += 1


@kernel
def interval_bounds(geometry: Any, mode: Any, boxes: Any, out: Any) -> None:
    """Bounds over the boxes (N, 3, 2) into out (K, 2, N)."""
    for n in range(boxes.shape[0]):
        x = Interval(boxes[n, 0, 0], boxes[n, 0, 1])
        y = Interval(boxes[n, 1, 0], boxes[n, 1, 1])
        z = Interval(boxes[n, 2, 0], boxes[n, 2, 1])
        k = 0
        for value in equations.leg_margins(geometry, mode, x, y, z):
            out[k, 0, n], out[k, 1, n] = value.lo, value.hi
            k += 1
        for value in equations.mode_margins(geometry, mode, x, y, z):
            out[k, 0, n], out[k, 1, n] = value.lo, value.hi
            k += 1
        for value in equations.singularity_margins(geometry, mode, x, y, z):
            out[k, 0, n], out[k, 1, n] = value.lo, value.hi
            k += 1


@kernel
def slope_bounds(geometry: Any, mode: Any, boxes: Any, out: Any) -> None:
    """Bounds and those of the three derivatives over the boxes (N, 3, 2) into out (K, 2, N, 4)."""
    for n in range(boxes.shape[0]):
        x, y, z = variables(
            (
                Interval(boxes[n, 0, 0], boxes[n, 0, 1]),
                Interval(boxes[n, 1, 0], boxes[n, 1, 1]),
                Interval(boxes[n, 2, 0], boxes[n, 2, 1]),
            )
        )
        k = 0
        for value in equations.leg_margins(geometry, mode, x, y, z):
            out[k, 0, n, 0], out[k, 1, n, 0] = value.value.lo, value.value.hi
            for j in range(3):
                out[k, 0, n, 1 + j], out[k, 1, n, 1 + j] = value.derivatives[j].lo, value.derivatives[j].hi
            k += 1
        for value in equations.mode_margins(geometry, mode, x, y, z):
            out[k, 0, n, 0], out[k, 1, n, 0] = value.value.lo, value.value.hi
            for j in range(3):
                out[k, 0, n, 1 + j], out[k, 1, n, 1 + j] = value.derivatives[j].lo, value.derivatives[j].hi
            k += 1
        for value in equations.singularity_margins(geometry, mode, x, y, z):
            out[k, 0, n, 0], out[k, 1, n, 0] = value.value.lo, value.value.hi
            for j in range(3):
                out[k, 0, n, 1 + j], out[k, 1, n, 1 + j] = value.derivatives[j].lo, value.derivatives[j].hi
            k += 1


@kernel
def form_bounds(geometry: Any, mode: Any, axes: Any, octants: Any, boxes: Any, out: Any) -> None:
    """Bounds by linear forms over the boxes (N, 6) of the charts of proved volumes into out (K, 2, N)."""
    for n in range(boxes.shape[0]):
        octant = (octants[n, 0], octants[n, 1], octants[n, 2])
        x, y, z = pose_forms(axes[n], octant, boxes[n])
        k = 0
        for form in equations.leg_margins(geometry, mode, x, y, z):
            within = bounds(form)
            out[k, 0, n], out[k, 1, n] = within.lo, within.hi
            k += 1
        for form in equations.mode_margins(geometry, mode, x, y, z):
            within = bounds(form)
            out[k, 0, n], out[k, 1, n] = within.lo, within.hi
            k += 1
        for form in equations.singularity_margins(geometry, mode, x, y, z):
            within = bounds(form)
            out[k, 0, n], out[k, 1, n] = within.lo, within.hi
            k += 1
