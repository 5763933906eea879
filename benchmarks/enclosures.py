"""Reach margins and determinants over boxes of poses: bounds, and bounds of derivatives too, against the
values at the boxes' centres."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numba import njit

from machines import machine
from row import Row, interleaved, seconds
from tpm_design.arithmetic import FAST_MATH, Interval, variables
from tpm_design.mechanisms import equations

BOXES = 100_000
HALF_WIDTH = 0.01
ROUNDS = 9
DESIGN = "R2"
LINES = (("det V", 6), ("det W", 7))


@njit(nogil=True, error_model="numpy", fastmath=FAST_MATH)
def values(geometry: Any, mode: Any, centres: Any, half: float, out: Any) -> None:
    """Six reach margins and three determinants at the centres (3, N) into out (9, N)."""
    for n in range(centres.shape[1]):
        x, y, z = centres[0, n], centres[1, n], centres[2, n]
        legs = equations.leg_margins(geometry, mode, x, y, z)
        determinants = equations.singularity_margins(geometry, mode, x, y, z)
        for k in range(6):
            out[k, n] = legs[k]
        for k in range(3):
            out[6 + k, n] = determinants[k]


@njit(nogil=True, error_model="numpy")
def bounds(geometry: Any, mode: Any, centres: Any, half: float, out: Any) -> None:
    """Bounds of the same over the boxes into out (9, 2, N)."""
    for n in range(centres.shape[1]):
        x = Interval(centres[0, n] - half, centres[0, n] + half)
        y = Interval(centres[1, n] - half, centres[1, n] + half)
        z = Interval(centres[2, n] - half, centres[2, n] + half)
        legs = equations.leg_margins(geometry, mode, x, y, z)
        determinants = equations.singularity_margins(geometry, mode, x, y, z)
        for k in range(6):
            out[k, 0, n], out[k, 1, n] = legs[k].lo, legs[k].hi
        for k in range(3):
            out[6 + k, 0, n], out[6 + k, 1, n] = determinants[k].lo, determinants[k].hi


@njit(nogil=True, error_model="numpy")
def slope_bounds(geometry: Any, mode: Any, centres: Any, half: float, out: Any) -> None:
    """Bounds of the same and of their three derivatives into out (9, 4, 2, N)."""
    for n in range(centres.shape[1]):
        x, y, z = variables(
            (
                Interval(centres[0, n] - half, centres[0, n] + half),
                Interval(centres[1, n] - half, centres[1, n] + half),
                Interval(centres[2, n] - half, centres[2, n] + half),
            )
        )
        legs = equations.leg_margins(geometry, mode, x, y, z)
        determinants = equations.singularity_margins(geometry, mode, x, y, z)
        for k in range(6):
            out[k, 0, 0, n], out[k, 0, 1, n] = legs[k].value.lo, legs[k].value.hi
            for j in range(3):
                slope = legs[k].derivatives[j]
                out[k, 1 + j, 0, n], out[k, 1 + j, 1, n] = slope.lo, slope.hi
        for k in range(3):
            out[6 + k, 0, 0, n], out[6 + k, 0, 1, n] = determinants[k].value.lo, determinants[k].value.hi
            for j in range(3):
                slope = determinants[k].derivatives[j]
                out[6 + k, 1 + j, 0, n], out[6 + k, 1 + j, 1, n] = slope.lo, slope.hi


def toleranced(geometry: Any) -> Any:
    """The geometry with its dimensions as intervals, as a proof takes them."""
    names = ("base", "platform", "proximal", "distal", "gear")
    return geometry._replace(
        **{name: tuple(Interval(value, value) for value in getattr(geometry, name)) for name in names}
    )


def reached(geometry: Any, signs: Any) -> np.ndarray:
    """Centres (3, N) of random boxes in the octant that lie inside reach."""
    centres = np.random.default_rng(1).uniform(HALF_WIDTH, 2.0, (3, 3 * BOXES))
    found = np.empty((9, 2, centres.shape[1]))
    bounds(geometry, signs, centres, HALF_WIDTH, found)
    return np.ascontiguousarray(centres[:, (found[:6, 0] > 0.0).all(axis=0)][:, :BOXES])


def overestimation(geometry: Any, signs: Any, centres: np.ndarray, held: np.ndarray) -> list[float]:
    """Mean width of the bounds of det V and det W over the mean width of 5³ poses of each box."""
    sampled = np.empty((9, centres.shape[1]))
    least, most = np.full_like(sampled, np.inf), np.full_like(sampled, -np.inf)
    steps = np.linspace(-HALF_WIDTH, HALF_WIDTH, 5)
    for shift in itertools.product(steps, repeat=3):
        values(geometry, signs, centres + np.array(shift)[:, None], 0.0, sampled)
        np.minimum(least, sampled, out=least)
        np.maximum(most, sampled, out=most)
    if not ((held[6:, 0] <= least[6:] + 1e-12) & (most[6:] <= held[6:, 1] + 1e-12)).all():
        raise SystemExit("a value lies outside its bounds")
    widths, ranges = held[:, 1] - held[:, 0], most - least
    return [float(widths[k].mean() / ranges[k].mean()) for _, k in LINES]


def rows() -> list[Row]:
    uru = machine(DESIGN)
    signs = uru.mode(octant="+++", elbows="+++").signs
    centres = reached(uru.geometry, signs)
    count = centres.shape[1]
    enclosed = toleranced(uru.geometry)
    held = np.empty((9, 2, count))
    tasks: list[tuple[Callable[..., None], Any, Any]] = [
        (values, uru.geometry, np.empty((9, count))),
        (bounds, enclosed, held),
        (slope_bounds, enclosed, np.empty((9, 4, 2, count))),
    ]
    calls: list[Callable[[], float]] = []
    for function, geometry, out in tasks:
        call = partial(function, geometry, signs, centres, HALF_WIDTH, out)
        call()
        calls.append(partial(seconds, call))
    value, bound, slope = (1e6 * time / count for time in interleaved(calls, ROUNDS))
    table = [
        Row(f"{name} per box", f"{time:.2f} µs", f"{value:.4f} µs", f"{time / value:.0f}", "-", None)
        for name, time in (("bounds", bound), ("bounds of slopes", slope))
    ]
    for (name, _), ratio in zip(LINES, overestimation(uru.geometry, signs, centres, held), strict=True):
        table.append(Row(f"{name}: width of bounds", f"{ratio:.2f}", "1", f"{ratio:.2f}", "-", None))
    return table
