"""Distances between links against bounded least squares."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.optimize import lsq_linear

from tpm_design.mechanisms import segments

Point = tuple[float, float, float]

coordinate = st.floats(-1.0, 1.0, width=32) | st.sampled_from([-1.0, 0.0, 0.5, 1.0])
point = st.tuples(coordinate, coordinate, coordinate)


@njit
def distance(a, b, c, d):  # type: ignore[no-untyped-def]
    return segments.segment_distance(a, b, c, d)


@njit
def between_chains(a, b, c, d, e, f):  # type: ignore[no-untyped-def]
    return segments.chain_distance((a, b, c), (d, e, f))


def expected(a: Point, b: Point, c: Point, d: Point) -> float:
    """Least |a + s (b − a) − c − t (d − c)| for s, t in [0, 1]."""
    directions = np.column_stack([np.subtract(b, a), np.subtract(c, d)])
    offset = np.subtract(c, a)
    ends = [np.subtract(p, q) for p in (a, b) for q in (c, d)]
    # the active-set method may stop early on dependent columns: the corners are known bounds
    solution = lsq_linear(directions, offset, bounds=(0.0, 1.0), method="bvls", tol=1e-14)
    return float(min(np.linalg.norm(directions @ solution.x - offset), *map(np.linalg.norm, ends)))


@settings(max_examples=300, deadline=None, derandomize=True)
@given(point, point, point, point)
@example((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.5, 1.0, 0.0), (1.5, 1.0, 0.0))  # parallel, side by side
@example((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.5, 0.0, 0.0), (1.0, 0.0, 0.0))  # on top of each other
@example((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))  # two points
def test_segments(a: Point, b: Point, c: Point, d: Point) -> None:
    found = distance(a, b, c, d)
    assert found == pytest.approx(expected(a, b, c, d), abs=1e-7)
    assert found == pytest.approx(distance(d, c, b, a), abs=1e-7)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(point, point, point, point, point, point)
def test_chains(a: Point, b: Point, c: Point, d: Point, e: Point, f: Point) -> None:
    pairs = [expected(*first, *second) for first in ((a, b), (b, c)) for second in ((d, e), (e, f))]
    assert between_chains(a, b, c, d, e, f) == pytest.approx(min(pairs), abs=1e-7)


def test_skew_segments() -> None:
    """Crossing at a right angle at height h, and beside the crossing."""
    assert distance((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.3), (0.0, 1.0, 0.3)) == pytest.approx(
        0.3
    )
    beside = distance((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 1.0, 0.3), (2.0, 2.0, 0.3))
    assert beside == pytest.approx(math.sqrt(1.0 + 1.0 + 0.09))
