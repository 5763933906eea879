"""What can be proved of every pose of a region: inequalities, written once for floats, Intervals and Duals.

``slacks(statement, geometry, mode, guide, x, y, z)`` gives a tuple of numbers that are all > 0 where the
statement holds. No statement divides by a determinant or takes a root of a matrix: bounds on singular values
and condition numbers are definite symmetric matrices.

With A ẋ = B q̇ and J = A⁻¹ B: σ_min(J) ≥ a where B² − a² A Aᵀ is positive definite, σ_max(J) ≤ b where
b² A Aᵀ − B² is, and 1/κ₂ ≥ c where some scale t > 0 has t c² A Aᵀ ⪯ B² ⪯ t A Aᵀ. The scale may differ from
pose to pose: it is a linear function of pose and parameters, the ``guide``, fitted to a box in floats.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tpm_design.arithmetic import formula, inner, magnitude, sqr
from tpm_design.arithmetic.algebra import determinant
from tpm_design.arithmetic.compilation import STRICT
from tpm_design.arithmetic.dual import componentwise
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.velocity import singular_values
from tpm_design.workspace.frames import identity_frame

# isort: split
from numba.cpython.unsafe.tuple import tuple_setitem
from numba.extending import register_jitable

# relative, for slopes that only choose a scale
PARAMETER_STEP = 1e-5


class Reach(NamedTuple):
    """Every leg margin is at least ``floor`` (m), and the pose belongs to the working mode."""

    floor: float


class Determinant(NamedTuple):
    """``sign`` · determinant number ``part`` of unit rows is at least ``floor``."""

    part: int
    sign: float
    floor: float


class Regular(NamedTuple):
    """``sign`` · determinant number ``part`` is positive wherever the pose is within reach."""

    part: int
    sign: float


class Serial(NamedTuple):
    """Every serial margin is at least ``floor``."""

    floor: float


class Frobenius(NamedTuple):
    """1/κ_F is at least ``floor``. ``motor``: 1 motors, 0 joints."""

    motor: float
    floor: float


class Condition(NamedTuple):
    """1/κ₂ is at least ``floor``."""

    motor: float
    floor: float


class Slowest(NamedTuple):
    """The least singular value of J is at least ``floor``."""

    motor: float
    floor: float


class Fastest(NamedTuple):
    """The greatest singular value of J is at most ``ceiling``."""

    motor: float
    ceiling: float


class Transmission(NamedTuple):
    """The transmission index is at least ``floor``."""

    floor: float


class Sensitivity(NamedTuple):
    """The greatest ‖∂x/∂(length errors)‖, actuators locked, is at most ``ceiling``."""

    motor: float
    ceiling: float


def slacks(statement: Any, geometry: Any, mode: Any, guide: Any, x: Any, y: Any, z: Any) -> Any:
    """Numbers that are all > 0 where the statement holds: a tuple of one kind of number."""
    raise NotImplementedError


def matrix(statement: Any, geometry: Any, mode: Any, guide: Any, x: Any, y: Any, z: Any) -> Any:
    """Diagonal and other entries of the matrix that is positive definite where the statement holds."""
    raise NotImplementedError


def matrices(statement: Any, geometry: Any, mode: Any, guide: Any, x: Any, y: Any, z: Any) -> Any:
    """Two such matrices: one grows with the guide's scale, the other falls."""
    raise NotImplementedError


def diagonals(statement: Any, geometry: Any, mode: Any, guide: Any, x: Any, y: Any, z: Any) -> Any:
    """Numbers of which a negative one refutes: diagonal entries of matrices, else ``slacks``."""
    raise NotImplementedError


def guide(statement: Any, geometry: Any, mode: Any, centre: Any, half: Any) -> Any:
    """What ``slacks`` needs to know of a box, from its centre and half widths and a geometry of floats."""
    raise NotImplementedError


def inherited(statement: Any) -> bool:
    """Whether a slack that is > 0 on a box is so on its parts: not where every box has a guide of its own."""
    raise NotImplementedError


@componentwise("a[i] - b")
def lowered(a: Any, b: Any) -> Any:
    """Every member of a tuple less a number."""


@register_jitable(**STRICT)
def _dot(u: Any, v: Any) -> Any:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@register_jitable(**STRICT)
def _square(u: Any) -> Any:
    return sqr(u[0]) + sqr(u[1]) + sqr(u[2])


@register_jitable(**STRICT)
def _cross(u: Any, v: Any) -> Any:
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


@register_jitable(**STRICT)
def _scaled(factors: Any, values: Any) -> Any:
    return (factors[0] * values[0], factors[1] * values[1], factors[2] * values[2])


@register_jitable(**STRICT)
def _times(factor: Any, rows: Any) -> Any:
    a, b, c = rows
    return (
        (factor * a[0], factor * a[1], factor * a[2]),
        (factor * b[0], factor * b[1], factor * b[2]),
        (factor * c[0], factor * c[1], factor * c[2]),
    )


@register_jitable(**STRICT)
def _combined(weights: Any, rows: Any) -> Any:
    """Σ weights_i · row_i, of floats and rows."""
    a, b, c = rows
    return (
        weights[0] * a[0] + weights[1] * b[0] + weights[2] * c[0],
        weights[0] * a[1] + weights[1] * b[1] + weights[2] * c[1],
        weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2],
    )


@register_jitable(**STRICT)
def _entry(of_b: Any, of_rows: Any, p: Any, q: Any, u: Any, v: Any) -> Any:
    return of_rows * _dot(p, q) + of_b * _dot(u, v)


@register_jitable(**STRICT)
def in_frame(rows: Any, b: Any, of_b: Any, of_rows: Any, frame: Any) -> Any:
    """of_b · diag(b)² + of_rows · A Aᵀ seen in a frame: the diagonal, and the entries 12, 13, 23."""
    f, g, h = frame
    p, q, r = _combined(f, rows), _combined(g, rows), _combined(h, rows)
    u = (f[0] * b[0], f[1] * b[1], f[2] * b[2])
    v = (g[0] * b[0], g[1] * b[1], g[2] * b[2])
    w = (h[0] * b[0], h[1] * b[1], h[2] * b[2])
    diagonal = (
        of_rows * _square(p) + of_b * _square(u),
        of_rows * _square(q) + of_b * _square(v),
        of_rows * _square(r) + of_b * _square(w),
    )
    others = (
        _entry(of_b, of_rows, p, q, u, v),
        _entry(of_b, of_rows, p, r, u, w),
        _entry(of_b, of_rows, q, r, v, w),
    )
    return diagonal, others


@register_jitable(**STRICT)
def dominance(matrix: Any) -> Any:
    """How far each diagonal entry exceeds the others of its row: all > 0 only where the matrix is positive
    definite (Gershgorin). Exact to first order where the matrix is the unit matrix at a box's centre."""
    (s11, s22, s33), (s12, s13, s23) = matrix
    a, b, c = magnitude(s12), magnitude(s13), magnitude(s23)
    return s11 - (a + b), s22 - (a + c), s33 - (b + c)


@inner
def frame_of(rows, b, of_b, of_rows):  # type: ignore[no-untyped-def]
    """The frame in which ``in_frame`` of these floats is nearly the identity."""
    u, v, w = rows
    return identity_frame(
        of_b * b[0] * b[0] + of_rows * _square(u),
        of_b * b[1] * b[1] + of_rows * _square(v),
        of_b * b[2] * b[2] + of_rows * _square(w),
        of_rows * _dot(u, v),
        of_rows * _dot(u, w),
        of_rows * _dot(v, w),
    )


@formula(guide, Reach)
@formula(guide, Determinant)
@formula(guide, Regular)
@formula(guide, Serial)
@formula(guide, Frobenius)
@formula(guide, Transmission)
def _no_guide(statement, geometry, mode, centre, half):  # type: ignore[no-untyped-def]
    return 0.0


@formula(inherited, Reach)
@formula(inherited, Determinant)
@formula(inherited, Regular)
@formula(inherited, Serial)
@formula(inherited, Frobenius)
@formula(inherited, Transmission)
def _the_same_on_parts(statement):  # type: ignore[no-untyped-def]
    return True


@formula(inherited, Condition)
@formula(inherited, Slowest)
@formula(inherited, Fastest)
@formula(inherited, Sensitivity)
def _others_on_parts(statement):  # type: ignore[no-untyped-def]
    return False


@inner
def balanced_scale(statement, geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """σ_max σ_min / c: both matrices of 1/κ₂ ≥ c are then equally far from their limits."""
    rows, b = equations.velocity_map(geometry, mode, statement.motor, x, y, z)
    greatest, least = singular_values(rows, b)
    return greatest * least / statement.floor


@formula(guide, Condition)
def _condition_guide(statement, geometry, mode, centre, half):  # type: ignore[no-untyped-def]
    """t at the centre, its slopes by pose and by the parameters of each limb."""
    x, y, z = centre
    at_centre = balanced_scale(statement, geometry, mode, x, y, z)
    slopes = (
        _slope(statement, geometry, mode, centre, (half[0], 0.0, 0.0), half[0]),
        _slope(statement, geometry, mode, centre, (0.0, half[1], 0.0), half[1]),
        _slope(statement, geometry, mode, centre, (0.0, 0.0, half[2]), half[2]),
    )
    parameters = (
        equations.limb_parameters(geometry, 0),
        equations.limb_parameters(geometry, 1),
        equations.limb_parameters(geometry, 2),
    )
    gains = (
        _gains(statement, geometry, mode, centre, 0),
        _gains(statement, geometry, mode, centre, 1),
        _gains(statement, geometry, mode, centre, 2),
    )
    rows, b, _ = equations.unit_velocity_map(geometry, mode, statement.motor, x, y, z)
    lower = frame_of(rows, b, 1.0, -statement.floor * statement.floor * at_centre)
    upper = frame_of(rows, b, -1.0, at_centre)
    return (at_centre, centre, slopes, parameters, gains), lower, upper


@formula(guide, Slowest)
def _slowest_guide(statement, geometry, mode, centre, half):  # type: ignore[no-untyped-def]
    x, y, z = centre
    rows, b, _ = equations.unit_velocity_map(geometry, mode, statement.motor, x, y, z)
    return frame_of(_times(statement.floor, rows), b, 1.0, -1.0)


@formula(guide, Fastest)
def _fastest_guide(statement, geometry, mode, centre, half):  # type: ignore[no-untyped-def]
    x, y, z = centre
    rows, b, _ = equations.unit_velocity_map(geometry, mode, statement.motor, x, y, z)
    return frame_of(_times(statement.ceiling, rows), b, -1.0, 1.0)


@formula(guide, Sensitivity)
def _sensitivity_guide(statement, geometry, mode, centre, half):  # type: ignore[no-untyped-def]
    x, y, z = centre
    rows, _, factors = equations.unit_velocity_map(geometry, mode, statement.motor, x, y, z)
    gains = equations.length_error_gains(geometry, mode, x, y, z)
    return frame_of(_times(statement.ceiling, rows), _scaled(factors, gains), -1.0, 1.0)


@inner
def _slope(statement, geometry, mode, centre, step, size):  # type: ignore[no-untyped-def]
    if size == 0.0:
        return 0.0
    x, y, z = centre
    dx, dy, dz = step
    above = balanced_scale(statement, geometry, mode, x + dx, y + dy, z + dz)
    below = balanced_scale(statement, geometry, mode, x - dx, y - dy, z - dz)
    slope = (above - below) / (2.0 * size)
    return slope if math.isfinite(slope) else 0.0


@inner
def _gains(statement, geometry, mode, centre, limb):  # type: ignore[no-untyped-def]
    values = equations.limb_parameters(geometry, limb)
    gains = values
    for q in range(len(values)):
        step = PARAMETER_STEP * max(abs(values[q]), PARAMETER_STEP)
        above = equations.with_limb_parameters(geometry, limb, tuple_setitem(values, q, values[q] + step))
        below = equations.with_limb_parameters(geometry, limb, tuple_setitem(values, q, values[q] - step))
        x, y, z = centre
        rise = balanced_scale(statement, above, mode, x, y, z) - balanced_scale(
            statement, below, mode, x, y, z
        )
        gain = rise / (2.0 * step)
        gains = tuple_setitem(gains, q, gain if math.isfinite(gain) else 0.0)
    return gains


@register_jitable(**STRICT)
def guide_value(guide: Any, geometry: Any, x: Any, y: Any, z: Any) -> Any:
    """The scale t of a guide at a pose of a machine."""
    at_centre, centre, slopes, parameters, gains = guide
    value = at_centre + (
        slopes[0] * (x - centre[0]) + slopes[1] * (y - centre[1]) + slopes[2] * (z - centre[2])
    )
    for limb in range(3):
        values = equations.limb_parameters(geometry, limb)
        for q in range(len(values)):
            value = value + gains[limb][q] * (values[q] - parameters[limb][q])
    return value


@formula(slacks, Reach)
def _reach(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    legs = equations.leg_margins(geometry, mode, x, y, z)
    return lowered(legs, statement.floor) + equations.mode_margins(geometry, mode, x, y, z)


@formula(slacks, Determinant)
def _determinant(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    margin = equations.singularity_margins(geometry, mode, x, y, z)[statement.part]
    return (statement.sign * margin - statement.floor,)


@formula(slacks, Regular)
def _regular(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    return (statement.sign * equations.singularity_margins(geometry, mode, x, y, z)[statement.part],)


@formula(slacks, Serial)
def _serial(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    return lowered(equations.serial_margins(geometry, mode, x, y, z), statement.floor)


@formula(slacks, Frobenius)
def _frobenius(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    """κ_F = ‖J‖_F ‖J⁻¹‖_F / 3 with J = adj(A) B / det A and J⁻¹ = B⁻¹ A, squared and multiplied out."""
    (a, b, c), (p, q, r), _ = equations.unit_velocity_map(geometry, mode, statement.motor, x, y, z)
    volume = determinant(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2])
    forward = sqr(p) * _square(_cross(b, c)) + sqr(q) * _square(_cross(c, a)) + sqr(r) * _square(_cross(a, b))
    backward = sqr(q * r) * _square(a) + sqr(r * p) * _square(b) + sqr(p * q) * _square(c)
    return (9.0 * sqr(volume * (p * q * r)) - statement.floor * (statement.floor * (forward * backward)),)


@formula(matrices, Condition)
def _condition(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    rows, b, _ = equations.unit_velocity_map(geometry, mode, statement.motor, x, y, z)
    linear, lower_frame, upper_frame = guide
    scale = guide_value(linear, geometry, x, y, z)
    lower = statement.floor * (statement.floor * scale)
    return in_frame(rows, b, 1.0, -lower, lower_frame), in_frame(rows, b, -1.0, scale, upper_frame)


@formula(matrix, Slowest)
def _slowest(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    rows, b, _ = equations.unit_velocity_map(geometry, mode, statement.motor, x, y, z)
    return in_frame(_times(statement.floor, rows), b, 1.0, -1.0, guide)


@formula(matrix, Fastest)
def _fastest(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    rows, b, _ = equations.unit_velocity_map(geometry, mode, statement.motor, x, y, z)
    return in_frame(_times(statement.ceiling, rows), b, -1.0, 1.0, guide)


@formula(matrix, Sensitivity)
def _sensitivity(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    rows, _, factors = equations.unit_velocity_map(geometry, mode, statement.motor, x, y, z)
    gains = equations.length_error_gains(geometry, mode, x, y, z)
    return in_frame(_times(statement.ceiling, rows), _scaled(factors, gains), -1.0, 1.0, guide)


@formula(slacks, Transmission)
def _transmission(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    """λ_i ≥ c, and η_i = |det A| / (|a_i| |a_j × a_k|) ≥ c, squared and multiplied out."""
    (a, b, c), _, _ = equations.unit_velocity_map(geometry, mode, 0.0, x, y, z)
    entering = lowered(equations.input_transmission(geometry, mode, x, y, z), statement.floor)
    volume = sqr(determinant(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]))
    first = volume - statement.floor * (statement.floor * (_square(a) * _square(_cross(b, c))))
    second = volume - statement.floor * (statement.floor * (_square(b) * _square(_cross(c, a))))
    third = volume - statement.floor * (statement.floor * (_square(c) * _square(_cross(a, b))))
    return (*entering, first, second, third)


@formula(slacks, Slowest)
@formula(slacks, Fastest)
@formula(slacks, Sensitivity)
def _one_matrix(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    return dominance(matrix(statement, geometry, mode, guide, x, y, z))


@formula(slacks, Condition)
def _two_matrices(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    first, second = matrices(statement, geometry, mode, guide, x, y, z)
    return dominance(first) + dominance(second)


@formula(diagonals, Slowest)
@formula(diagonals, Fastest)
@formula(diagonals, Sensitivity)
def _diagonal(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    return matrix(statement, geometry, mode, guide, x, y, z)[0]


@formula(diagonals, Condition)
def _two_diagonals(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    first, second = matrices(statement, geometry, mode, guide, x, y, z)
    return first[0] + second[0]


@formula(diagonals, Reach)
@formula(diagonals, Determinant)
@formula(diagonals, Regular)
@formula(diagonals, Serial)
@formula(diagonals, Frobenius)
@formula(diagonals, Transmission)
def _slacks_themselves(statement, geometry, mode, guide, x, y, z):  # type: ignore[no-untyped-def]
    return slacks(statement, geometry, mode, guide, x, y, z)
