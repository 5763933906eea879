"""Singular values, conditioning and transmission against NumPy, also where a matrix is nearly singular."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from tpm_design.mechanisms import velocity


@njit
def _triples(a):  # type: ignore[no-untyped-def]
    return (
        (a[0, 0], a[0, 1], a[0, 2]),
        (a[1, 0], a[1, 1], a[1, 2]),
        (a[2, 0], a[2, 1], a[2, 2]),
    )


@njit(error_model="numpy")
def everything(a, b):  # type: ignore[no-untyped-def]
    rows, diagonal = _triples(a), (b[0], b[1], b[2])
    return (
        velocity.singular_values(rows, diagonal),
        velocity.inverse_condition_2(rows, diagonal),
        velocity.inverse_condition_frobenius(rows, diagonal),
        velocity.jacobian(rows, diagonal),
        velocity.output_transmission(rows),
    )


@njit(error_model="numpy")
def of_columns(a):  # type: ignore[no-untyped-def]
    return velocity.scaled_singular_values(_triples(a.T.copy()))


def rotation(random: np.random.Generator) -> np.ndarray:
    return np.linalg.qr(random.normal(size=(3, 3)))[0]


def matrix(random: np.random.Generator, values: tuple[float, float, float]) -> np.ndarray:
    return rotation(random) @ np.diag(values) @ rotation(random)


def test_random_matrices() -> None:
    random = np.random.default_rng(1)
    for _ in range(300):
        a = random.normal(size=(3, 3))
        b = random.uniform(0.1, 2.0, 3) * random.choice([-1.0, 1.0], 3)
        singular, condition, frobenius, jacobian, transmission = everything(a, b)
        expected = np.linalg.solve(a, np.diag(b))
        values = np.linalg.svd(expected, compute_uv=False)
        np.testing.assert_allclose(jacobian, expected, rtol=1e-9, atol=1e-11 * values[0])
        np.testing.assert_allclose(singular, (values[0], values[-1]), rtol=1e-8)
        assert condition == pytest.approx(values[-1] / values[0], rel=1e-8)
        product = np.linalg.norm(expected) * np.linalg.norm(np.linalg.inv(expected))
        assert frobenius == pytest.approx(3.0 / product, rel=1e-9)
        unit = a / np.linalg.norm(a, axis=1, keepdims=True)
        across = [np.linalg.norm(np.cross(unit[(i + 1) % 3], unit[(i + 2) % 3])) for i in range(3)]
        least = min(abs(np.linalg.det(unit)) / area for area in across)
        assert everything(unit, b)[4] == pytest.approx(least, rel=1e-9)
        assert transmission >= 0.0


@pytest.mark.parametrize("least", [1e-3, 1e-6, 1e-10, 1e-13])
def test_nearly_singular(least: float) -> None:
    """The least singular value keeps relative digits: its error is that of the determinant, ε/least."""
    random = np.random.default_rng(2)
    for _ in range(50):
        values = (2.0, 0.7, least)
        greatest, smallest = of_columns(matrix(random, values))
        assert greatest == pytest.approx(2.0, rel=1e-12)
        assert smallest == pytest.approx(least, rel=1e-9 + 1e-14 / least)


@pytest.mark.parametrize(
    "values", [(1.0, 1.0, 1.0), (1.0, 1.0, 0.3), (1.0, 0.3, 0.3), (1.0, 1.0 - 1e-9, 0.5)]
)
def test_equal_singular_values(values: tuple[float, float, float]) -> None:
    random = np.random.default_rng(3)
    for _ in range(50):
        greatest, smallest = of_columns(matrix(random, values))
        assert greatest == pytest.approx(values[0], rel=1e-7)
        assert smallest == pytest.approx(values[2], rel=1e-7)


def test_exactly_singular() -> None:
    """Parallel rows: no inverse, conditioning and transmission 0, never NaN."""
    a = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    b = np.ones(3)
    _, condition, frobenius, _, transmission = everything(a, b)
    assert (condition, frobenius, transmission) == (0.0, 0.0, 0.0)
    assert of_columns(np.zeros((3, 3))) == (0.0, 0.0)


def test_serial_singularity() -> None:
    """b_i = 0: an actuator that does not move the platform."""
    random = np.random.default_rng(4)
    (greatest, smallest), condition, frobenius, _, _ = everything(
        random.normal(size=(3, 3)), np.array([1.0, 0.0, 1.0])
    )
    assert greatest > 0.0
    assert (smallest, condition, frobenius) == (0.0, 0.0, 0.0)


def test_isotropic() -> None:
    random = np.random.default_rng(5)
    (greatest, smallest), condition, frobenius, _, transmission = everything(
        rotation(random), np.full(3, 0.5)
    )
    assert (greatest, smallest) == pytest.approx((0.5, 0.5))
    assert (condition, frobenius, transmission) == pytest.approx((1.0, 1.0, 1.0))
