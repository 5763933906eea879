"""All interval operations in one compiled loop, so that tests drive compiled code in bulk."""

from __future__ import annotations

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
)

# isort: split
from numba import njit

BINARY = (
    "add",
    "sub",
    "mul",
    "div",
    "lesser",
    "greater",
    "direction_cosine",
    "arctangent2",
    "direction_c",
    "direction_s",
)
UNARY = (
    "neg",
    "sqr",
    "root",
    "pos",
    "magnitude",
    "sine",
    "cosine",
    "affine",
    "times_positive",
    "times_negative",
)


@njit
def enclose(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    """Bounds of every operation on the intervals a and b (N, 2) into out (operations, N, 2)."""
    for i in range(len(a)):
        x = Interval(a[i, 0], a[i, 1])
        y = Interval(b[i, 0], b[i, 1])
        along, across = direction(x, y)
        results = (
            x + y,
            x - y,
            x * y,
            x / y,
            lesser(x, y),
            greater(x, y),
            direction_cosine(x, y),
            arctangent2(x, y),
            along,
            across,
            -x,
            sqr(x),
            root(x),
            pos(x),
            magnitude(x),
            sine(x),
            cosine(x),
            3 - x * 0.1 + 2.0,
            x * 7.3e4,
            -1e-300 * x,
        )
        for k in range(len(results)):
            out[k, i, 0] = results[k].lo
            out[k, i, 1] = results[k].hi
