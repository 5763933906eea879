"""Duals carry the derivatives that differences approach, and their bounds hold them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tpm_design.arithmetic import Dual, Interval, arctangent2, direction_cosine, pos, root, sqr, variables

# isort: split
from dual_kernel import expressions, slope_bounds, slopes, values
from numba import njit

COUNT = len(expressions(0.5, 0.6, 0.7))


def value_at(points: np.ndarray) -> np.ndarray:
    out = np.empty((len(points), COUNT))
    values(points, out)
    return out


def slope_at(points: np.ndarray) -> np.ndarray:
    out = np.empty((len(points), COUNT, 4))
    slopes(points, out)
    return out


def differences(points: np.ndarray, step: float) -> np.ndarray:
    """Central differences (N, K, 3)."""
    sides = [value_at(points + step * e) - value_at(points - step * e) for e in np.eye(3)]
    return np.stack(sides, axis=2) / (2 * step)


def smooth(points: np.ndarray) -> np.ndarray:
    """Points away from the kinks of the expressions and from the poles of their higher derivatives."""
    x, y, z = points.T
    gaps = [x - y, x - z, x * z - y, x - 0.8, y - 0.4]
    return points[np.min(np.abs(gaps), axis=0) > 0.1]


def test_derivatives_are_what_differences_approach() -> None:
    """A central difference is wrong by h²: half the step leaves a quarter of the error."""
    points = smooth(np.random.default_rng(1).uniform(0.3, 1.3, (3000, 3)))
    assert len(points) > 300
    found = slope_at(points)
    np.testing.assert_allclose(found[..., 0], value_at(points), rtol=1e-13, atol=1e-13)
    wide = np.abs(differences(points, 2e-3) - found[..., 1:])
    narrow = np.abs(differences(points, 1e-3) - found[..., 1:])
    told = wide > 1e-7  # above rounding, which is about 1e-13 over the step
    # differences are exact for the eight expressions that are at most quadratic in each variable
    assert told.any(axis=(0, 2)).sum() == COUNT - 8
    ratio = wide[told] / narrow[told]
    assert np.median(ratio) == pytest.approx(4, rel=0.01)
    assert (ratio > 3).all()
    assert (narrow[~told] < 1e-7).all()


@settings(derandomize=True, max_examples=30, deadline=None)
@given(
    st.lists(st.tuples(*[st.integers(-1500, 1500)] * 3), min_size=30, max_size=30),
    st.sampled_from([0.0, 1e-9, 1e-3, 0.3]),
    st.integers(0, 1000),
)
def test_bounds_hold_values_and_derivatives(centres: list, half: float, seed: int) -> None:
    centre = np.array(centres) / 1000
    generator = np.random.default_rng(seed)
    halves = half * generator.uniform(0, 1, centre.shape)
    bounds = np.empty((len(centre), COUNT, 4, 2))
    slope_bounds(centre, halves, bounds)
    assert not np.isnan(bounds).any()
    for share in (-1, 1, *generator.uniform(-1, 1, (3, *centre.shape))):
        found = slope_at(np.clip(centre + share * halves, centre - halves, centre + halves))
        # a float result is itself rounded, and has no value at a pole
        pole = ~np.isfinite(found)
        found[pole] = 0.0
        slack = 1e-12 * (1 + np.abs(found))
        inside = (bounds[..., 0] <= found + slack) & (found - slack <= bounds[..., 1])
        assert (inside | pole).all()


def test_bounds_of_a_point_are_narrow() -> None:
    points = smooth(np.random.default_rng(2).uniform(0.3, 1.3, (2000, 3)))
    bounds = np.empty((len(points), COUNT, 4, 2))
    slope_bounds(points, np.zeros_like(points), bounds)
    assert (bounds[..., 1] - bounds[..., 0] < 1e-12 * (1 + np.abs(bounds[..., 0]))).all()


def test_the_root_at_zero() -> None:
    assert root(Dual(0.0, (1.0,))) == Dual(0.0, (0.0,))
    assert root(Dual(-2.0, (1.0,))) == Dual(0.0, (0.0,))
    one = Interval(1, 1)
    reaching = root(Dual(Interval(0, 4), (one,)))
    assert reaching.derivatives[0].lo <= 0.25
    assert reaching.derivatives[0].hi == math.inf
    assert root(Dual(Interval(-2, -1), (one,))).derivatives[0] == Interval(0, 0) * one
    assert 0.25 in root(Dual(Interval(4, 4), (one,))).derivatives[0]


def test_pos_switches_its_slope() -> None:
    one = Interval(1, 1)
    assert pos(Dual(0.0, (1.0,))).derivatives == (0.0,)
    assert pos(Dual(2.0, (1.0,))).derivatives == (1.0,)
    across = pos(Dual(Interval(-1, 1), (one,))).derivatives[0]
    assert 0 in across
    assert 1 in across
    assert across.hi - across.lo < 1 + 1e-15


def test_direction_cosine_slopes_in_closed_form() -> None:
    p, q = variables((3.0, 4.0))
    along = direction_cosine(p, q)
    assert along.value == pytest.approx(0.6)
    assert along.derivatives == pytest.approx((16 / 125, -12 / 125))
    turned = arctangent2(q, p)
    assert turned.derivatives == pytest.approx((-4 / 25, 3 / 25))


def test_the_number_of_derivatives_is_free() -> None:
    @njit
    def sum_of_squares(values: tuple[float, ...]) -> Dual:
        a, b, c, d, e = variables(values)
        return sqr(a) + 2 * sqr(b) + sqr(c) * 3 + sqr(d) * e

    result = sum_of_squares((1.0, 2.0, 3.0, 4.0, 5.0))
    assert result == Dual(1 + 8 + 27 + 80.0, (2.0, 8.0, 18.0, 40.0, 16.0))


def test_duals_pass_in_and_out_of_compiled_code() -> None:
    @njit
    def twice(x: Dual) -> Dual:
        return x * 2

    assert twice(Dual(1.5, (1.0, 0.5))) == Dual(3.0, (2.0, 1.0))
    bounds = twice(Dual(Interval(1, 2), (Interval(1, 1),)))
    assert 2.0 in bounds.value
    assert 4.0 in bounds.value
    assert 2.0 in bounds.derivatives[0]


def test_python_and_compiled_duals_agree() -> None:
    points = np.random.default_rng(5).uniform(0.3, 1.3, (20, 3))
    compiled = slope_at(points)
    for point, found in zip(points.tolist(), compiled, strict=True):
        for result, expected in zip(expressions(*variables(tuple(point))), found.tolist(), strict=True):
            assert [result.value, *result.derivatives] == pytest.approx(expected, rel=1e-12, abs=1e-12)
