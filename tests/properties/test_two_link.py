"""Bounds of two links: they hold the geometry, are exact where nothing turns round, and never invert."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tpm_design.arithmetic import Interval

# isort: split
from two_link_kernel import determinant_bounds, length_slopes, link_at, link_bounds

LENGTHS = [(1.0, 1.0), (1.0, 0.8), (0.7, 1.1)]
ELBOWS = (1.0, -1.0)


def by_angles(points: np.ndarray, f: float, r: float, elbow: float) -> np.ndarray:
    """(a, c, γ) by the angles of the triangle."""
    alpha, beta = points.T
    rho = np.hypot(alpha, beta)
    first = np.arctan2(beta, alpha) + elbow * np.arccos((rho**2 + f**2 - r**2) / (2 * f * rho))
    distal = np.arctan2(beta - f * np.sin(first), alpha - f * np.cos(first))
    return np.stack([np.cos(distal), np.sin(distal), f * np.sin(distal - first)], axis=1)


def floats(points: np.ndarray, f: float, r: float, elbow: float) -> np.ndarray:
    out = np.empty((len(points), 3))
    link_at(points, f, r, elbow, out)
    return out


def bounds(boxes: np.ndarray, f: float | Interval, r: float | Interval, elbow: float) -> np.ndarray:
    out = np.empty((len(boxes), 3, 3, 2))
    link_bounds(boxes, f, r, elbow, out)
    assert not np.isnan(out).any()
    assert (out[..., 0] <= out[..., 1]).all()
    return out


def points_within(f: float, r: float, share: float, count: int, seed: int) -> np.ndarray:
    """Points (count, 2) of the upper half plane, up to the bounds of reach less ``share`` of f + r."""
    generator = np.random.default_rng(seed)
    slack = share * (f + r)
    rho = generator.uniform(abs(f - r) + slack, f + r - slack, count)
    angle = generator.uniform(0.01, np.pi - 0.01, count)
    return np.stack([rho * np.cos(angle), rho * np.sin(angle)], axis=1)


def boxes_about(points: np.ndarray, half: float) -> np.ndarray:
    boxes = np.stack([points - half, points + half], axis=2)
    boxes[:, 1] = np.maximum(boxes[:, 1], 0.0)
    return boxes


def inside(boxes: np.ndarray, seed: int) -> list[np.ndarray]:
    """Corners and random points of the boxes, arrays (N, 2)."""
    shares = list(itertools.product((0.0, 1.0), repeat=2))
    random = np.random.default_rng(seed).uniform(0, 1, (12, *boxes.shape[:2]))
    return [
        boxes[..., 0] + share * (boxes[..., 1] - boxes[..., 0]) for share in (*map(np.array, shares), *random)
    ]


@pytest.mark.parametrize(("f", "r"), LENGTHS)
@pytest.mark.parametrize("elbow", ELBOWS)
def test_the_links_close(f: float, r: float, elbow: float) -> None:
    points = points_within(f, r, 0.01, 500, 1)
    found = floats(points, f, r, elbow)
    np.testing.assert_allclose(found, by_angles(points, f, r, elbow), atol=1e-11)
    assert (found[:, 2] * elbow < 0).all()
    proximal = points - r * found[:, :2]
    np.testing.assert_allclose(np.hypot(*proximal.T), f, atol=1e-12)


@pytest.mark.parametrize(("f", "r"), LENGTHS)
@pytest.mark.parametrize("elbow", ELBOWS)
@pytest.mark.parametrize("half", [1e-9, 0.01, 0.1])
def test_bounds_hold_values_and_derivatives(f: float, r: float, elbow: float, half: float) -> None:
    """Inside, across the bounds of reach, where the elbow stays straight, and down to the axis β = 0."""
    near = points_within(f, r, 0.0, 1000, 2)
    anywhere = np.random.default_rng(3).uniform([-2, 0], [2, 2], (500, 2))
    boxes = boxes_about(np.concatenate([near, anywhere]), half)
    held = bounds(boxes, f, r, elbow)
    step = 1e-6
    for points in inside(boxes, 4):
        values = floats(points, f, r, elbow)
        # a value at the bounds of reach has lost half its digits to the root
        reach = np.hypot(*points.T)
        from_rim = np.minimum(np.abs(f + r - reach), np.abs(reach - abs(f - r)))
        slack = (1e-13 + 3e-15 / np.sqrt(from_rim + 1e-16))[:, None] * (1 + 1 / (reach + 1e-9))[:, None]
        assert (held[:, :, 0, 0] - slack <= values).all()
        assert (values <= held[:, :, 0, 1] + slack).all()
        smooth = (reach < f + r - 0.01) & (reach > abs(f - r) + 0.01)
        for j in range(2):
            shift = step * np.eye(2)[j]
            slope = (floats(points + shift, f, r, elbow) - floats(points - shift, f, r, elbow)) / (2 * step)
            slack = 1e-6 * (1 + np.abs(slope[smooth]))
            assert (held[smooth, :, 1 + j, 0] - slack <= slope[smooth]).all()
            assert (slope[smooth] <= held[smooth, :, 1 + j, 1] + slack).all()


@pytest.mark.parametrize(("f", "r"), LENGTHS)
def test_bounds_are_the_exact_range_where_no_link_turns_round(f: float, r: float) -> None:
    half = 0.01
    points = points_within(f, r, 0.1, 2000, 5)
    points = points[points[:, 1] > 2 * half]
    middle = floats(points, f, r, 1.0)
    proximal = points - r * middle[:, :2]
    clear = (np.abs(np.column_stack([proximal, middle[:, :2]])) > 0.2).all(axis=1)
    assert clear.sum() > 200
    boxes = boxes_about(points[clear], half)
    held = bounds(boxes, f, r, 1.0)[:, :2, 0]
    corners = np.stack([floats(corner, f, r, 1.0)[:, :2] for corner in inside(boxes, 6)[:4]])
    np.testing.assert_allclose(held[..., 0], corners.min(axis=0), atol=1e-13)
    np.testing.assert_allclose(held[..., 1], corners.max(axis=0), atol=1e-13)


def test_bounds_hold_every_machine_within_the_tolerances() -> None:
    f, r, tolerance = 1.0, 0.8, 1e-3
    boxes = boxes_about(points_within(f, r, 0.02, 1000, 7), 0.005)
    held = bounds(boxes, Interval(f - tolerance, f + tolerance), Interval(r - tolerance, r + tolerance), -1.0)
    for df, dr in itertools.product((-tolerance, 0.4 * tolerance, tolerance), repeat=2):
        for points in inside(boxes, 8):
            values = floats(points, f + df, r + dr, -1.0)
            assert (held[:, :, 0, 0] - 1e-12 <= values).all()
            assert (values <= held[:, :, 0, 1] + 1e-12).all()


@pytest.mark.parametrize(("f", "r"), LENGTHS)
@pytest.mark.parametrize("elbow", ELBOWS)
def test_derivatives_by_the_lengths(f: float, r: float, elbow: float) -> None:
    step = 1e-6
    for alpha, beta in points_within(f, r, 0.1, 30, 10).tolist():
        found = length_slopes(alpha, beta, f, r, elbow)
        arguments = [Interval(x - 1e-3, x + 1e-3) for x in (alpha, beta, f, r)]
        held = length_slopes(*arguments, elbow)
        for j, (da, df, dr) in enumerate(step * np.eye(3)):
            more = floats(np.array([[alpha + da, beta]]), f + df, r + dr, elbow)[0]
            less = floats(np.array([[alpha - da, beta]]), f - df, r - dr, elbow)[0]
            for value, bound, slope in zip(found, held, (more - less) / (2 * step), strict=True):
                assert value.derivatives[j] == pytest.approx(slope, rel=1e-6, abs=1e-7)
                assert bound.derivatives[j].lo <= value.derivatives[j] <= bound.derivatives[j].hi


def test_the_determinant_and_its_cofactors() -> None:
    generator = np.random.default_rng(9)
    for matrix in generator.uniform(-1, 1, (50, 3, 3)):
        found = determinant_bounds(matrix.ravel(), 0.01)
        for other in matrix + generator.uniform(-0.01, 0.01, (10, 3, 3)):
            assert found.value.lo <= np.linalg.det(other) <= found.value.hi
            cofactors = (np.linalg.det(other) * np.linalg.inv(other).T).ravel()
            for bound, cofactor in zip(found.derivatives, cofactors, strict=True):
                assert bound.lo <= cofactor <= bound.hi
        exact = determinant_bounds(matrix.ravel(), 0.0)
        assert exact.value.hi - exact.value.lo < 1e-14
