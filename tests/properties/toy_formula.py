"""A planar arm whose reach margin is written once, and the engines that evaluate it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tpm_design.arithmetic import FAST_MATH, Interval, formula, lesser, pos, root, sqr, variables

# isort: split
from numba import njit


class Arm(NamedTuple):
    """Link lengths (m) of three joints and the offset of the base."""

    links: tuple[Any, Any, Any]
    offset: tuple[Any, Any]
    gain: Any


class Rail(NamedTuple):
    """Another mechanism of the same questions."""

    length: Any


def reach(geometry: Any, x: Any, y: Any) -> Any:
    """Reach margin (m)."""
    raise NotImplementedError


def height(geometry: Any, x: Any, y: Any) -> Any:
    """A part of the margin."""
    raise NotImplementedError


@formula(height, Arm)
def arm_height(geometry: Any, x: Any, y: Any) -> Any:
    return root(sqr(x - geometry.offset[0]) + sqr(y - geometry.offset[1]))


@formula(reach, Arm)
def arm_reach(geometry: Any, x: Any, y: Any) -> Any:
    rho = height(geometry, x, y)
    longest = geometry.links[0] + geometry.links[1] + geometry.links[2]
    return lesser(longest - rho, geometry.gain * rho * x) + pos(y) / 3


@formula(reach, Rail)
def rail_reach(geometry: Any, x: Any, y: Any) -> Any:
    return geometry.length - x


@njit(cache=True, fastmath=FAST_MATH, error_model="numpy")
def values(geometry: Any, x: np.ndarray, y: float, out: np.ndarray) -> None:
    for i in range(len(x)):
        out[i] = reach(geometry, x[i], y)


@njit(cache=True, error_model="numpy")
def bounds(geometry: Any, x: Interval, y: Interval) -> Interval:
    return reach(geometry, x, y)


@njit(cache=True, error_model="numpy")
def slopes(geometry: Any, x: Any, y: Any) -> Any:
    u, v = variables((x, y))
    return reach(geometry, u, v)
