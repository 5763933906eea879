"""From A ẋ = diag(b) q̇ to the Jacobian, its singular values and its conditioning.

Everything is formed from K = adj(A) diag(b) = det(A) J, so that nothing is divided by a determinant
that may vanish: at a parallel or serial singularity the conditioning is 0, not undefined.
"""

from __future__ import annotations

import math

from tpm_design.arithmetic import inlined, inner

# rows of a matrix, of which the cross product is then mostly rounding
NEARLY_PARALLEL = 1e-10


@inlined
def cross(u, v):  # type: ignore[no-untyped-def]
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


@inlined
def _square(u):  # type: ignore[no-untyped-def]
    return u[0] * u[0] + u[1] * u[1] + u[2] * u[2]


@inlined
def adjugate_columns(rows):  # type: ignore[no-untyped-def]
    """Columns of adj(A) for A given by rows, and det A."""
    first = cross(rows[1], rows[2])
    second = cross(rows[2], rows[0])
    third = cross(rows[0], rows[1])
    determinant = rows[0][0] * first[0] + rows[0][1] * first[1] + rows[0][2] * first[2]
    return (first, second, third), determinant


@inlined
def _gram(columns):  # type: ignore[no-untyped-def]
    """Diagonal of the matrix of the columns' products, then its entries (1, 2), (1, 3), (2, 3)."""
    u, v, w = columns
    g12 = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    g13 = u[0] * w[0] + u[1] * w[1] + u[2] * w[2]
    g23 = v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
    return _square(u), _square(v), _square(w), g12, g13, g23


@inner
def _greatest_singular_value(columns):  # type: ignore[no-untyped-def]
    """Of the matrix with these columns: greatest eigenvalue of the Gram matrix, in closed form."""
    g11, g22, g33, g12, g13, g23 = _gram(columns)
    mean = (g11 + g22 + g33) / 3.0
    d1, d2, d3 = g11 - mean, g22 - mean, g33 - mean
    off = g12 * g12 + g13 * g13 + g23 * g23
    spread = math.sqrt((d1 * d1 + d2 * d2 + d3 * d3 + 2.0 * off) / 6.0)
    if spread <= 1e-15 * mean:
        return math.sqrt(mean)
    shifted = d1 * (d2 * d3 - g23 * g23) - g12 * (g12 * d3 - g23 * g13) + g13 * (g12 * g23 - d2 * g13)
    angle = math.acos(min(1.0, max(-1.0, 0.5 * shifted / spread**3))) / 3.0
    return math.sqrt(mean + 2.0 * spread * math.cos(angle))


@inner
def greatest_singular_vector(columns):  # type: ignore[no-untyped-def]
    """Unit vector x for which |K x| is greatest, K the matrix with these columns: an eigenvector of the Gram
    matrix, square to its rows less the eigenvalue. Where two eigenvalues are nearly the greatest, any vector
    of theirs."""
    g11, g22, g33, g12, g13, g23 = _gram(columns)
    eigenvalue = _greatest_singular_value(columns) ** 2
    first = (g11 - eigenvalue, g12, g13)
    second = (g12, g22 - eigenvalue, g23)
    third = (g13, g23, g33 - eigenvalue)
    longest = first
    for row in (second, third):
        if _square(row) > _square(longest):
            longest = row
    best = cross(first, second)
    for vector in (cross(second, third), cross(third, first)):
        if _square(vector) > _square(best):
            best = vector
    if _square(best) <= (NEARLY_PARALLEL * _square(longest)) ** 2:
        x, y, z = longest
        best = (-y, x, 0.0) if abs(z) <= max(abs(x), abs(y)) else (0.0, -z, y)
        if _square(best) == 0.0:
            best = (1.0, 0.0, 0.0)
    size = math.sqrt(_square(best))
    return best[0] / size, best[1] / size, best[2] / size


@inner
def scaled_singular_values(columns):  # type: ignore[no-untyped-def]
    """(greatest, least) singular value of the matrix with these columns.

    The cross products of the columns have the products of two singular values as theirs: the least is the
    determinant over the greatest of these, which keeps its digits when the matrix is nearly singular. The
    middle eigenvalue in closed form would not.
    """
    u, v, w = columns
    first, second, third = cross(v, w), cross(w, u), cross(u, v)
    greatest = _greatest_singular_value(columns)
    pair = _greatest_singular_value((first, second, third))
    if not pair > 0.0:
        return greatest, 0.0
    determinant = u[0] * first[0] + u[1] * first[1] + u[2] * first[2]
    return greatest, abs(determinant) / pair


@inlined
def scaled_columns(columns, b):  # type: ignore[no-untyped-def]
    u, v, w = columns
    return (
        (u[0] * b[0], u[1] * b[0], u[2] * b[0]),
        (v[0] * b[1], v[1] * b[1], v[2] * b[1]),
        (w[0] * b[2], w[1] * b[2], w[2] * b[2]),
    )


@inner
def inverse_condition_2(rows, b):  # type: ignore[no-untyped-def]
    """1/κ₂ = σ_min/σ_max of J, in [0, 1]."""
    columns, _ = adjugate_columns(rows)
    greatest, least = scaled_singular_values(scaled_columns(columns, b))
    return least / greatest if greatest > 0.0 else 0.0


@inlined
def inverse_condition_frobenius(rows, b):  # type: ignore[no-untyped-def]
    """1/κ_F = 3/(‖J‖_F ‖J⁻¹‖_F), in [0, 1] (Gosselin & Angeles 1991, weight 1/n)."""
    columns, determinant = adjugate_columns(rows)
    u, v, w = scaled_columns(columns, b)
    forward = _square(u) + _square(v) + _square(w)
    c1, c2, c3 = b[1] * b[2], b[2] * b[0], b[0] * b[1]
    backward = c1 * c1 * _square(rows[0]) + c2 * c2 * _square(rows[1]) + c3 * c3 * _square(rows[2])
    product = forward * backward
    value = 3.0 * abs(determinant * b[0] * c1) / math.sqrt(product)
    return value if product > 0.0 else 0.0


@inner
def singular_values(rows, b):  # type: ignore[no-untyped-def]
    """(greatest, least) singular value of J; the greatest is infinite where det A = 0."""
    columns, determinant = adjugate_columns(rows)
    greatest, least = scaled_singular_values(scaled_columns(columns, b))
    size = abs(determinant)
    if size == 0.0:
        return math.inf, (math.inf if least > 0.0 else 0.0)
    return greatest / size, least / size


@inner
def jacobian(rows, b):  # type: ignore[no-untyped-def]
    """J = A⁻¹ diag(b) as three rows."""
    columns, determinant = adjugate_columns(rows)
    u, v, w = scaled_columns(columns, b)
    return (
        (u[0] / determinant, v[0] / determinant, w[0] / determinant),
        (u[1] / determinant, v[1] / determinant, w[1] / determinant),
        (u[2] / determinant, v[2] / determinant, w[2] / determinant),
    )


@inner
def output_transmission(rows):  # type: ignore[no-untyped-def]
    """Least η_i = |det[a_1 a_2 a_3]| / |a_j × a_k| of unit rows; 0 where two rows are parallel."""
    columns, determinant = adjugate_columns(rows)
    least = math.inf
    for column in columns:
        area = math.sqrt(_square(column))
        least = min(least, abs(determinant) / area if area > 0.0 else 0.0)
    return least
