"""Eigenvalues of 3 × 3 matrices in plain numbers. Nothing is proved by them: they choose what is tried."""

from __future__ import annotations

import math
from collections.abc import Sequence

Vector = tuple[float, float, float]
Row = Sequence[float]
SWEEPS = 12


def eigenpairs(matrix: Sequence[Row]) -> list[tuple[float, Vector]]:
    """(eigenvalue, unit eigenvector), the least first, by Jacobi's rotations."""
    m = [list(row) for row in matrix]
    vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    for _ in range(SWEEPS):
        if abs(m[0][1]) + abs(m[0][2]) + abs(m[1][2]) <= 1e-15 * (abs(m[0][0]) + abs(m[1][1]) + abs(m[2][2])):
            break
        for i, j in ((0, 1), (0, 2), (1, 2)):
            if m[i][j] == 0.0:
                continue
            turn = (m[j][j] - m[i][i]) / (2.0 * m[i][j])
            tangent = math.copysign(1.0, turn) / (abs(turn) + math.hypot(turn, 1.0))
            cos = 1.0 / math.hypot(tangent, 1.0)
            sin = tangent * cos
            for row in m:
                row[i], row[j] = cos * row[i] - sin * row[j], sin * row[i] + cos * row[j]
            m[i], m[j] = (
                [cos * a - sin * b for a, b in zip(m[i], m[j], strict=True)],
                [sin * a + cos * b for a, b in zip(m[i], m[j], strict=True)],
            )
            for row in vectors:
                row[i], row[j] = cos * row[i] - sin * row[j], sin * row[i] + cos * row[j]
    pairs = [(m[n][n], (vectors[0][n], vectors[1][n], vectors[2][n])) for n in range(3)]
    return sorted(pairs)


def inner(u: Row, v: Row) -> float:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Row, v: Row) -> Vector:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def singular_pairs(rows: Sequence[Row], b: Row) -> list[tuple[float, Vector, Vector]]:
    """Of J = A⁻¹ diag(b), for A given by rows: (σ², u, w), the least first, with w = Aᵀu a unit vector and
    diag(b²) u = σ² A Aᵀ u. Raises ZeroDivisionError where A is singular."""
    columns = (cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1]))
    determinant = inner(rows[0], columns[0])
    jacobian = [[columns[j][i] * b[j] / determinant for j in range(3)] for i in range(3)]
    gram = [[inner(one, other) for other in jacobian] for one in jacobian]
    return [
        (value, tuple_of(*(inner(column, w) / determinant for column in columns)), w)
        for value, w in eigenpairs(gram)
    ]


def tuple_of(x: float, y: float, z: float) -> Vector:
    return x, y, z
