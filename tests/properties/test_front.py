"""The front of a table of objectives, its knee, extremes and hypervolume."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tpm_design.runs.front import (
    FloatArray,
    FrontBox,
    extended,
    extremes,
    front_box,
    knee,
    non_dominated,
    spread,
)

# few values, so that there are ties and equal rows
TABLES = st.tuples(st.integers(1, 30), st.integers(2, 4)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=st.sampled_from([-2.0, -0.0, 0.0, 0.5, 1.0, 3.0, 1e9]))
)


def dominates(one: FloatArray, other: FloatArray) -> bool:
    return bool(np.all(one <= other) and np.any(one < other))


@given(TABLES)
@settings(max_examples=200, deadline=None)
def test_the_front_is_what_nothing_dominates(table: FloatArray) -> None:
    rows = non_dominated(table)
    front = {tuple(row) for row in table[rows] + 0.0}
    best = {tuple(row + 0.0) for row in table if not any(dominates(other, row) for other in table)}
    assert front == best
    assert len(rows) == len(front)  # of equal rows one, the first
    for row in rows:
        assert not any(np.array_equal(table[earlier], table[row]) for earlier in range(row))
    assert [tuple(row) for row in table[rows]] == sorted(tuple(row) for row in table[rows])


@given(TABLES)
@settings(max_examples=100, deadline=None)
def test_the_front_of_a_front_is_itself_and_more_rows_only_push_it(table: FloatArray) -> None:
    front = table[non_dominated(table)]
    assert np.array_equal(front[non_dominated(front)], front)
    part = table[: len(table) // 2 + 1]
    for row in part[non_dominated(part)]:
        assert any(np.all(other <= row) for other in front)


@given(TABLES)
@settings(max_examples=100, deadline=None)
def test_a_front_grows_row_by_row_to_the_same(table: FloatArray) -> None:
    front = np.empty((0, table.shape[1]))
    for row in table:
        front = extended(front, row)
    assert sorted(map(tuple, front + 0.0)) == sorted(map(tuple, table[non_dominated(table)] + 0.0))


@given(TABLES)
@settings(max_examples=100, deadline=None)
def test_knee_and_extremes_are_on_the_front_and_the_extremes_are_the_least(table: FloatArray) -> None:
    front = table[non_dominated(table)]
    assert 0 <= knee(front) < len(front)
    assert np.array_equal([front[row, k] for k, row in enumerate(extremes(front))], front.min(axis=0))


@pytest.mark.parametrize("scales", [(1.0, 1.0), (1e-3, 40.0), (-1e4, 7.0)])
def test_the_knee_of_a_circular_front_is_at_45_degrees_in_any_units(scales: tuple[float, float]) -> None:
    """(1 − sin t, 1 − cos t): farthest from the chord at t = π/4; less is better after any positive scale."""
    angles = np.linspace(0.0, math.pi / 2.0, 91)
    front = np.column_stack([1.0 - np.sin(angles), 1.0 - np.cos(angles)])
    moved = front * np.abs(scales) + np.array(scales)
    assert knee(moved) == 45
    assert set(extremes(moved)) == {0, 90}


def test_the_knee_of_a_front_with_a_corner_is_the_corner() -> None:
    """Two straight lines that meet at (0.2, 0.3)."""
    one = np.linspace([0.0, 1.0], [0.2, 0.3], 8)
    other = np.linspace([0.2, 0.3], [1.0, 0.0], 12)
    front = np.vstack([one, other[1:]])
    assert front[knee(front)] == pytest.approx([0.2, 0.3])


def test_the_knee_of_a_sphere_is_on_its_diagonal() -> None:
    """1 − u on the octant of the unit sphere: the three extremes are the unit vectors."""
    a, b = np.meshgrid(np.linspace(0.0, math.pi / 2.0, 41), np.linspace(0.0, math.pi / 2.0, 41))
    unit = np.column_stack(
        [(np.cos(a) * np.cos(b)).ravel(), (np.cos(a) * np.sin(b)).ravel(), np.sin(a).ravel()]
    )
    front = 1.0 - np.vstack([unit, np.full(3, 1.0 / math.sqrt(3.0))])
    front = front[non_dominated(front)]
    assert front[knee(front)] == pytest.approx(np.full(3, 1.0 - 1.0 / math.sqrt(3.0)))


def test_a_front_that_bulges_away_from_the_ideal_has_its_knee_at_an_extreme() -> None:
    angles = np.linspace(0.0, math.pi / 2.0, 20)
    front = np.column_stack([np.sin(angles), np.cos(angles)])
    assert knee(front) in extremes(front)


def test_a_front_of_one_design_is_all_of_it_and_has_no_box() -> None:
    front = np.array([[3.0, -2.0]])
    assert (knee(front), list(extremes(front))) == (0, [0, 0])
    assert front_box(front) is None


@pytest.mark.parametrize("steps", [1, 2, 5, 100])
def test_hypervolume_of_a_staircase(steps: int) -> None:
    """n + 1 points on x + y = 1 in the unit square: (1 − 1/n)/2 is dominated, of the box of edge 1.1 besides
    two strips of 0.1."""
    first = np.linspace(0.0, 1.0, steps + 1)
    front = np.column_stack([first, 1.0 - first])
    box = front_box(front)
    assert box is not None
    assert box.reference == pytest.approx([1.1, 1.1])
    expected = (1.21 - (1.0 - (1.0 - 1.0 / steps) / 2.0)) / 1.21
    assert box.hypervolume(front) == pytest.approx(expected, rel=1e-12)


def test_hypervolume_of_three_bricks() -> None:
    """Inclusion and exclusion of three boxes up to (1, 1, 1)."""
    front = np.array([[0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]])
    box = FrontBox(np.zeros(3), np.ones(3))
    assert box.hypervolume(front) == pytest.approx(3 * 0.25 - 3 * 0.125 + 0.125, rel=1e-12)


@given(
    arrays(
        np.float64, st.tuples(st.integers(1, 12), st.just(2)), elements=st.floats(-0.5, 1.5, allow_nan=False)
    )
)
@settings(max_examples=150, deadline=None)
def test_hypervolume_of_any_two_columns_is_the_sum_of_its_strips(table: FloatArray) -> None:
    """Clipped to the box, sorted: each strip as wide as the step to the next point. Rows that are dominated,
    equal or beyond the reference point change nothing."""
    box = FrontBox(np.zeros(2), np.ones(2))
    inside = np.maximum(table[np.all(table < 1.0, axis=1)], 0.0)
    area, lowest = 0.0, 1.0
    for x, y in sorted(map(tuple, inside)):
        area += (1.0 - x) * max(0.0, lowest - y)
        lowest = min(lowest, y)
    assert box.hypervolume(table) == pytest.approx(area, abs=1e-12)


@given(TABLES, st.integers(1, 12))
@settings(max_examples=100, deadline=None)
def test_rows_that_stand_for_a_front_are_in_order_and_hold_those_to_be_kept(
    table: FloatArray, count: int
) -> None:
    front = table[non_dominated(table)]
    kept = [*extremes(front).tolist(), knee(front)]
    rows = spread(front, kept, count)
    assert rows == sorted(set(rows))
    assert set(kept) <= set(rows) <= set(range(len(front)))
    assert len(rows) == max(min(count, len(front)), len(set(kept)))


def test_a_crowd_on_a_front_counts_as_one_and_the_widest_gaps_are_shown() -> None:
    crowd = np.linspace(0.0, 1e-3, 90)
    first = np.concatenate([crowd, [0.25, 0.5, 0.75, 1.0]])
    front = np.column_stack([first, 1.0 - first])
    assert spread(front, [0, 93], 5) == [0, 90, 91, 92, 93]
