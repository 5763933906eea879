"""Two links and the determinant in compiled loops, so that tests drive them in bulk."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpm_design.arithmetic import Interval, root, sqr, variables
from tpm_design.arithmetic.algebra import determinant
from tpm_design.mechanisms.two_link import distal_link

# isort: split
from numba import njit


@njit
def link_at(points: np.ndarray, f: float, r: float, elbow: float, out: np.ndarray) -> None:
    """(a, c, γ) at the points (N, 2) into out (N, 3)."""
    for n in range(len(points)):
        alpha, beta = points[n, 0], points[n, 1]
        values = distal_link(alpha, beta, alpha * alpha + beta * beta, f, r, elbow)
        for k in range(3):
            out[n, k] = values[k]


@njit
def link_bounds(boxes: np.ndarray, f: Any, r: Any, elbow: float, out: np.ndarray) -> None:
    """Bounds of value and two derivatives over the boxes (N, 2, 2) into out (N, 3, 3, 2); the point is given
    as the limbs give it, β as a root."""
    for n in range(len(boxes)):
        alpha, beta = variables(
            (Interval(boxes[n, 0, 0], boxes[n, 0, 1]), Interval(boxes[n, 1, 0], boxes[n, 1, 1]))
        )
        values = distal_link(alpha, root(sqr(beta)), sqr(alpha) + sqr(beta), f, r, elbow)
        for k in range(3):
            out[n, k, 0, 0], out[n, k, 0, 1] = values[k].value.lo, values[k].value.hi
            for j in range(2):
                slope = values[k].derivatives[j]
                out[n, k, 1 + j, 0], out[n, k, 1 + j, 1] = slope.lo, slope.hi


@njit
def length_slopes(alpha: Any, beta: Any, f: Any, r: Any, elbow: float) -> Any:
    """(a, c, γ) with derivatives by α, f and r."""
    u, proximal, distal = variables((alpha, f, r))
    return distal_link(u, beta, sqr(u) + sqr(beta), proximal, distal, elbow)


@njit
def determinant_bounds(entries: np.ndarray, half: float) -> Any:
    """Bounds of the determinant of a matrix, given within ± half as nine numbers, and of its derivatives."""
    e = variables(
        (
            Interval(entries[0] - half, entries[0] + half),
            Interval(entries[1] - half, entries[1] + half),
            Interval(entries[2] - half, entries[2] + half),
            Interval(entries[3] - half, entries[3] + half),
            Interval(entries[4] - half, entries[4] + half),
            Interval(entries[5] - half, entries[5] + half),
            Interval(entries[6] - half, entries[6] + half),
            Interval(entries[7] - half, entries[7] + half),
            Interval(entries[8] - half, entries[8] + half),
        )
    )
    return determinant(e[0], e[1], e[2], e[3], e[4], e[5], e[6], e[7], e[8])
