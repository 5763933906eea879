"""Every interval operation, compiled and in Python, encloses the exact result."""

from __future__ import annotations

import itertools
import math
import operator
import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tpm_design import arithmetic as ar
from tpm_design.arithmetic import Interval
from tpm_design.errors import ParameterError

# isort: split
from interval_kernel import BINARY, UNARY, enclose

LARGEST = sys.float_info.max
LEAST = 5e-324
INFINITY = math.inf
EVERY = BINARY + UNARY
NOT_MONOTONE = ("sine", "cosine", "arctangent2", "direction_cosine", "direction_c", "direction_s")

PRECISION = 1200  # bits

SPECIAL = [0.0, LEAST, 3e-310, 1e-200, 0.1, 1.0, 1.0 + 2**-52, 3.0, math.pi, 1e5, 1e200, LARGEST]
SPECIAL = sorted({*SPECIAL, *(-value for value in SPECIAL)})


def exact(name: str, x: float, y: float) -> Fraction | mpmath.mpf | None:
    """The true value; None where there is none."""
    u, v = Fraction(x), Fraction(y)
    if name == "div":
        return u / v if v else None
    rational = {
        "add": lambda: u + v,
        "sub": lambda: u - v,
        "mul": lambda: u * v,
        "lesser": lambda: min(u, v),
        "greater": lambda: max(u, v),
        "neg": lambda: -u,
        "sqr": lambda: u * u,
        "pos": lambda: max(u, Fraction(0)),
        "magnitude": lambda: abs(u),
        "affine": lambda: 3 - u * Fraction(0.1) + 2,
        "times_positive": lambda: u * Fraction(7.3e4),
        "times_negative": lambda: u * Fraction(-1e-300),
    }
    if name in rational:
        return rational[name]()
    p, q = mpmath.mpf(x), mpmath.mpf(y)
    with mpmath.workprec(PRECISION):
        if name in ("direction_cosine", "arctangent2", "direction_c", "direction_s") and x == y == 0:
            return mpmath.mpf(0)
        return {
            "direction_c": lambda: p / mpmath.sqrt(p * p + q * q),
            "direction_s": lambda: q / mpmath.sqrt(p * p + q * q),
            "direction_cosine": lambda: p / mpmath.sqrt(p * p + q * q),
            "arctangent2": lambda: mpmath.atan2(p, q),
            "root": lambda: mpmath.sqrt(max(p, mpmath.mpf(0))),
            "sine": lambda: mpmath.sin(p),
            "cosine": lambda: mpmath.cos(p),
        }[name]()


def holds(bounds: np.ndarray, value: Fraction | mpmath.mpf) -> bool:
    number = Fraction if isinstance(value, Fraction) else mpmath.mpf
    lo, hi = float(bounds[0]), float(bounds[1])
    above = lo == -INFINITY or number(lo) <= value
    return bool(above and (hi == INFINITY or value <= number(hi)))


def members(lo: float, hi: float, share: float) -> list[float]:
    """Finite numbers between the bounds: both ends, or what is nearest to them, and one between."""
    lo, hi = max(lo, -LARGEST), min(hi, LARGEST)
    between = min(max(lo * (1 - share) + hi * share, lo), hi)
    return [lo, hi, between]


def run(a: np.ndarray, b: np.ndarray) -> dict[str, np.ndarray]:
    """Bounds (N, 2) of every operation on the intervals a and b (N, 2), by name."""
    out = np.empty((len(EVERY), len(a), 2))
    enclose(a, b, out)
    return dict(zip(EVERY, out, strict=True))


def check_enclosure(a: np.ndarray, b: np.ndarray, share: float) -> None:
    for name, bounds in run(a, b).items():
        assert not np.isnan(bounds).any(), name
        assert (bounds[:, 0] <= bounds[:, 1]).all(), name
        for u, v, result in zip(a.tolist(), b.tolist(), bounds, strict=True):
            others = members(*v, share) if name in BINARY else [0.0]
            for x, y in itertools.product(members(*u, share), others):
                value = exact(name, x, y)
                assert value is None or holds(result, value), (name, u, v, x, y, result)


numbers = st.one_of(
    st.sampled_from(SPECIAL),
    st.floats(-10, 10),
    st.floats(allow_nan=False, allow_infinity=False),
)
bounds = st.one_of(numbers, st.sampled_from([-INFINITY, INFINITY]))


@st.composite
def intervals(draw: st.DrawFn, ends: st.SearchStrategy[float] = bounds) -> tuple[float, float]:
    lo, hi = sorted((draw(ends), draw(ends)))
    # an interval of real numbers neither begins at +∞ nor ends at −∞
    return (min(lo, LARGEST), max(hi, -LARGEST))


batches = st.lists(st.tuples(intervals(), intervals()), min_size=20, max_size=20)


@settings(derandomize=True, max_examples=25, deadline=None)
@given(batches, st.floats(0, 1))
def test_encloses_the_exact_result(batch: list, share: float) -> None:
    pairs = np.array(batch)
    check_enclosure(pairs[:, 0], pairs[:, 1], share)


def test_encloses_the_exact_result_at_extreme_bounds() -> None:
    ends = [-INFINITY, -LARGEST, -1.0, -LEAST, 0.0, LEAST, 1.0, LARGEST, INFINITY]
    every = [(lo, hi) for lo, hi in itertools.combinations_with_replacement(ends, 2)]
    every = [(lo, hi) for lo, hi in every if lo < INFINITY and hi > -INFINITY]
    pairs = np.array(list(itertools.product(every, every)))
    some = pairs[np.random.default_rng(1).permutation(len(pairs))[:600]]
    check_enclosure(some[:, 0], some[:, 1], 0.5)


def test_encloses_the_exact_result_of_ordinary_numbers() -> None:
    generator = np.random.default_rng(2)
    pairs = np.sort(generator.uniform(-4, 4, (300, 2, 2)), axis=2)
    check_enclosure(pairs[:, 0], pairs[:, 1], 0.37)


@settings(derandomize=True, max_examples=50, deadline=None)
@given(batches, st.floats(0, 1), st.floats(0, 1))
def test_a_part_gives_a_part(batch: list, first: float, second: float) -> None:
    """Inclusion monotonicity: narrower operands give bounds inside."""
    pairs = np.array(batch)

    def part(u: np.ndarray) -> np.ndarray:
        lo, hi = np.maximum(u[:, 0], -LARGEST), np.minimum(u[:, 1], LARGEST)
        cuts = [np.clip(lo * (1 - t) + hi * t, lo, hi) for t in sorted((first, second))]
        return np.stack([np.minimum(*cuts), np.maximum(*cuts)], axis=1)

    whole = run(pairs[:, 0].copy(), pairs[:, 1].copy())
    inner = run(part(pairs[:, 0]), part(pairs[:, 1]))
    for name in EVERY:
        # the C library's functions are not monotone to the last bit
        slack = 8 * 2.0**-52 if name in NOT_MONOTONE else 0.0
        assert (inner[name][:, 0] >= whole[name][:, 0] - slack).all(), name
        assert (inner[name][:, 1] <= whole[name][:, 1] + slack).all(), name


def test_points_give_bounds_a_few_ulps_apart() -> None:
    generator = np.random.default_rng(3)
    x, y = generator.uniform(-1, 1, (2, 2000)) * 10.0 ** generator.integers(-5, 5, (2, 2000))
    results = run(np.stack([x, x], axis=1), np.stack([y, y], axis=1))
    for name, result in results.items():
        # a sum can be far smaller than its terms, whose products are rounded first
        scale = 10 + np.abs(x) if name == "affine" else np.abs(result).max(axis=1)
        width = result[:, 1] - result[:, 0]
        assert (width <= 20 * 2.0**-52 * scale + 50 * LEAST).all(), name
        if name in ("add", "sub", "mul", "div", "sqr", "root", "times_positive", "times_negative"):
            assert (width <= 4 * np.spacing(scale) + 2 * LEAST).all(), name
        if name in ("neg", "pos", "magnitude", "lesser", "greater"):
            assert (width == 0).all(), name


def test_an_unknown_operand_gives_no_bound() -> None:
    unknown = np.full((1, 2), math.nan)
    known = np.array([[1.0, 2.0]])
    for first, second in ((unknown, known), (known, unknown)):
        results = run(first, second)
        for name in ("add", "sub", "mul", "div"):
            assert results[name].tolist() == [[-INFINITY, INFINITY]], name
    results = run(unknown, unknown)
    assert results["sqr"].tolist() == results["root"].tolist() == [[0.0, INFINITY]]
    assert results["sine"].tolist() == results["direction_cosine"].tolist() == [[-1.0, 1.0]]
    assert holds(results["arctangent2"][0], mpmath.pi)
    assert holds(results["arctangent2"][0], -mpmath.pi)


def test_infinite_numbers_lie_beyond_all_floats() -> None:
    """Compiled code may meet them: they never turn into NaN or into a bound that excludes everything."""
    ends = np.array([[INFINITY, INFINITY], [-INFINITY, -INFINITY], [1.0, 2.0], [0.0, 0.0], [-1.0, INFINITY]])
    pairs = np.array(list(itertools.product(ends, ends)))
    for name, found in run(pairs[:, 0].copy(), pairs[:, 1].copy()).items():
        assert (found[:, 0] <= found[:, 1]).all(), name
        assert (found[:, 0] < INFINITY).all(), name
        assert (found[:, 1] > -INFINITY).all(), name
    total = run(ends[:1].copy(), ends[1:2].copy())["add"]
    assert total[0, 0] <= 0 <= total[0, 1]


def test_zero_times_a_missing_bound_in_every_place() -> None:
    """0·∞ may be any of the four products: the bounds are those of the finite numbers, however large."""
    ends = [-INFINITY, -2.0, -0.0, 0.0, 3.0, INFINITY]
    every = [
        (lo, hi) for lo, hi in itertools.product(ends, ends) if lo <= hi and lo < INFINITY and hi > -INFINITY
    ]
    pairs = np.array(list(itertools.product(every, every)))
    found = run(pairs[:, 0].copy(), pairs[:, 1].copy())["mul"]
    large = 1e30
    for (a, b), (lo, hi) in zip(np.clip(pairs, -large, large).tolist(), found.tolist(), strict=True):
        products = [x * y for x, y in itertools.product(a, b)]
        least, most = min(products), max(products)
        assert lo == -INFINITY if least <= -large else least - 1e-14 <= lo <= least
        assert hi == INFINITY if most >= large else most <= hi <= most + 1e-14


def test_division_by_an_interval_with_zero() -> None:
    assert Interval(1, 2) / Interval(-1, 1) == Interval(-INFINITY, INFINITY)
    assert Interval(-1, 2) / Interval(0, 1) == Interval(-INFINITY, INFINITY)
    half = Interval(1, 2) / Interval(0, 4)
    assert half.hi == INFINITY
    assert 0.25 * (1 - 1e-15) < half.lo < 0.25
    assert (Interval(1, 2) / Interval(-4, 0)).hi == -half.lo
    assert (Interval(-2, -1) / Interval(0, 4)).hi == -half.lo


def test_an_overflow_leaves_the_largest_float_as_a_bound() -> None:
    big = Interval(LARGEST, LARGEST)
    total = big + big
    assert total.hi == INFINITY
    assert LARGEST * (1 - 2.0**-50) < total.lo <= LARGEST
    assert (-big - big).lo == -INFINITY


def test_zero_times_unbounded_is_zero() -> None:
    result = Interval(0, 0) * Interval(-INFINITY, INFINITY)
    assert -LEAST <= result.lo <= 0 <= result.hi <= LEAST


def test_sum_of_squares_that_reach_zero_is_not_negative() -> None:
    touching = ar.sqr(Interval(-1, 1)) + ar.sqr(Interval(0, 2))
    assert touching.lo == 0
    assert (1 / touching).lo > 0


def test_direction_cosine_has_no_pole() -> None:
    assert ar.direction_cosine(Interval(-1, 2), Interval(-1, 1)) == Interval(-1, 1)
    assert ar.direction_cosine(Interval(0, 2), Interval(0, 1)) == Interval(0, 1)
    right = ar.direction_cosine(Interval(3, 3), Interval(4, 4))
    assert 0.6 in right
    assert right.hi - right.lo < 2e-15


def test_arctangent_and_its_cut() -> None:
    circle = ar.arctangent2(Interval(-1, 1), Interval(-2, -1))
    assert circle.lo < -math.pi < math.pi < circle.hi  # the float nearest π lies inside π itself
    upper = ar.arctangent2(Interval(1, 1), Interval(-1, 1))
    assert abs(upper.lo - math.pi / 4) < 4e-15
    assert abs(upper.hi - 3 * math.pi / 4) < 4e-15
    assert ar.arctangent2(Interval(0, 1), Interval(-2, -1)).hi > math.pi


def test_waves_find_their_crests() -> None:
    assert ar.cosine(Interval(-0.1, 0.1)).hi == 1
    assert ar.sine(Interval(1, 2)).hi == 1
    assert ar.sine(Interval(4, 5)).lo == -1
    assert ar.sine(Interval(0, 7)) == Interval(-1, 1)
    assert ar.sine(Interval(2e5, 2e5)) == Interval(-1, 1)
    assert ar.cosine(Interval(0.5, 1)).hi < 0.88


def test_python_and_compiled_code_agree_to_the_last_bit() -> None:
    generator = np.random.default_rng(4)
    pairs = np.sort(generator.uniform(-3, 3, (200, 2, 2)), axis=2)
    compiled = run(pairs[:, 0].copy(), pairs[:, 1].copy())
    functions = {"add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv}
    functions |= {name: getattr(ar, name) for name in ("lesser", "direction_cosine")}
    for name, function in functions.items():
        for (u, v), (lo, hi) in zip(pairs.tolist(), compiled[name].tolist(), strict=True):
            assert function(Interval(*u), Interval(*v)) == Interval(lo, hi), name
    for name in ("sqr", "root", "pos", "magnitude"):
        for u, (lo, hi) in zip(pairs[:, 0].tolist(), compiled[name].tolist(), strict=True):
            assert getattr(ar, name)(Interval(*u)) == Interval(lo, hi), name


def test_numbers_are_taken_exactly() -> None:
    x = Interval(1, 2)
    assert 3 - x == Interval(3, 3) - x
    assert np.float64(0.1) * x == x * 0.1 == x * Interval(0.1, 0.1)
    assert 1 / x == Interval(1, 1) / x
    assert x + 1 == 1 + x
    assert -x == Interval(-2, -1)
    assert +x == x


@pytest.mark.parametrize(
    ("lo", "hi"),
    [(2.0, 1.0), (math.nan, 1.0), (0.0, math.nan), (INFINITY, INFINITY), (-INFINITY, -INFINITY)],
)
def test_an_interval_that_holds_nothing_is_refused(lo: float, hi: float) -> None:
    with pytest.raises(ParameterError, match="holds nothing"):
        Interval(lo, hi)


def test_a_fast_math_caller_does_not_reach_the_bounds(tmp_path: Path) -> None:
    """In a fresh process the caller is compiled first, with every licence that it could hand down."""
    ends = [-INFINITY, -1e300, -3.0, -0.1, -1e-320, 0.0, 1e-320, 0.1, 7.0, 1e300, INFINITY, math.nan]
    every = [(lo, hi) for lo, hi in itertools.product(ends, ends) if not lo > hi]
    pairs = np.array(list(itertools.product(every, every)))
    a, b = pairs[:, 0].copy(), pairs[:, 1].copy()
    np.savez(tmp_path / "in.npz", a=a, b=b)
    script = (
        "import sys, numpy as np, numba, interval_kernel as k\n"
        "given = np.load(sys.argv[1]); a, b = given['a'], given['b']\n"
        "out = np.empty((len(k.BINARY + k.UNARY), len(a), 2))\n"
        "numba.njit(fastmath=True)(k.enclose.py_func)(a, b, out)\n"
        "np.save(sys.argv[2], out)\n"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "in.npz"), str(tmp_path / "out.npy")]
    subprocess.run(
        command, check=True, timeout=300, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    )
    fast = np.load(tmp_path / "out.npy")
    for name, found in zip(EVERY, fast, strict=True):
        np.testing.assert_array_equal(found, run(a, b)[name], err_msg=name)
