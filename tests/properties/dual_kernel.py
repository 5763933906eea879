"""Every function of three variables in one compiled loop: values, derivatives, and bounds of both."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpm_design.arithmetic import (
    Interval,
    arctangent2,
    cosine,
    direction,
    direction_cosine,
    greater,
    lesser,
    magnitude,
    pos,
    root,
    sine,
    sqr,
    variables,
)

# isort: split
from numba import njit
from numba.extending import register_jitable


@register_jitable(fastmath=False)
def expressions(x: Any, y: Any, z: Any) -> Any:
    return (
        x * y + z,
        x - y * 2,
        3 - x / y,
        2 / z + 1.0,
        -(x * z) / 7,
        sqr(sqr(x) * y - z),
        root(x + sqr(z)),
        pos(x - y),
        magnitude(x - z),
        lesser(x * z, y),
        greater(x * z, y),
        lesser(x, 0.8) + greater(0.4, y),
        direction_cosine(x, y - z),
        direction_cosine(y - x, 0.3),
        direction(x - 2 * y, z)[0],
        direction(0.4, x - y)[1],
        sine(3 * x + y),
        cosine(x - 4 * z),
        arctangent2(y - x, z),
        arctangent2(0.2, x - y),
    )


@njit
def values(points: np.ndarray, out: np.ndarray) -> None:
    """Values at the points (N, 3) into out (N, K)."""
    for i in range(len(points)):
        results = expressions(points[i, 0], points[i, 1], points[i, 2])
        for k in range(len(results)):
            out[i, k] = results[k]


@njit
def slopes(points: np.ndarray, out: np.ndarray) -> None:
    """Value and derivatives at the points (N, 3) into out (N, K, 4)."""
    for i in range(len(points)):
        x, y, z = variables((points[i, 0], points[i, 1], points[i, 2]))
        results = expressions(x, y, z)
        for k in range(len(results)):
            out[i, k, 0] = results[k].value
            for j in range(3):
                out[i, k, 1 + j] = results[k].derivatives[j]


@njit
def slope_bounds(centres: np.ndarray, halves: np.ndarray, out: np.ndarray) -> None:
    """Bounds of the same over boxes (N, 3) into out (N, K, 4, 2)."""
    for i in range(len(centres)):
        c, h = centres[i], halves[i]
        x, y, z = variables(
            (
                Interval(c[0] - h[0], c[0] + h[0]),
                Interval(c[1] - h[1], c[1] + h[1]),
                Interval(c[2] - h[2], c[2] + h[2]),
            )
        )
        results = expressions(x, y, z)
        for k in range(len(results)):
            out[i, k, 0, 0] = results[k].value.lo
            out[i, k, 0, 1] = results[k].value.hi
            for j in range(3):
                out[i, k, 1 + j, 0] = results[k].derivatives[j].lo
                out[i, k, 1 + j, 1] = results[k].derivatives[j].hi
