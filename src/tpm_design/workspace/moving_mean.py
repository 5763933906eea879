"""The integral of 1/κ over a ray field, for neighbouring machines, to first order.

Nodes move with the ends of their segments. Singular values are taken as |K x| with the singular vectors x of
the machine whose nodes they are: by Rayleigh's quotient they are off by the square of what x would turn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tpm_design.arithmetic import fast_kernel, inlined, inner, kernel, short_kernel
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.mechanisms.pointwise import frobenius_row
from tpm_design.mechanisms.velocity import adjugate_columns, cross, greatest_singular_vector, scaled_columns
from tpm_design.workspace.aspects import RayField
from tpm_design.workspace.averages import ray_nodes
from tpm_design.workspace.rays import step_of


@dataclass(frozen=True)
class MovingMean:
    """1/κ along the segments of a field in a mode of ``signs``, at ``nodes`` of each.

    ``vectors`` (6, N): at all nodes unit vectors x and y with σ_max = |K x| and σ_max σ_mid = |L y|, where K
    is a multiple of J and L has the cross products of its columns; none for the Frobenius norm.
    """

    signs: Any
    frobenius: bool
    motor: float
    nodes: int
    vectors: NDArray[np.float64]


@inlined
def _combined(columns, a, b, c):  # type: ignore[no-untyped-def]
    u, v, w = columns
    return (a * u[0] + b * v[0] + c * w[0], a * u[1] + b * v[1] + c * w[1], a * u[2] + b * v[2] + c * w[2])


@inlined
def _length(u):  # type: ignore[no-untyped-def]
    return math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])


@inlined
def _multiple_of_jacobian(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    """Columns of adj(A) diag(b), and their cross products."""
    rows, b = equations.velocity_map(geometry, mode, motor, x, y, z)
    columns, _ = adjugate_columns(rows)
    u, v, w = scaled_columns(columns, b)
    return (u, v, w), (cross(v, w), cross(w, u), cross(u, v))


@inner
def _node_poses(origin, scale, directions, segments, places):  # type: ignore[no-untyped-def]
    """x, y, z (N,) and ray parameters (N,) of the places along all segments."""
    rays, starts, ends = segments
    size = rays.size * places.size
    x, y, z, t = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    n = 0
    for s in range(rays.size):
        u, v, w = step_of(scale, directions[rays[s]])
        for place in places:
            t[n] = starts[s] + (ends[s] - starts[s]) * place
            x[n], y[n], z[n] = origin[0] + t[n] * u, origin[1] + t[n] * v, origin[2] + t[n] * w
            n += 1
    return x, y, z, t


@kernel
def _vectors(geometry, mode, motor, origin, scale, directions, segments, places):  # type: ignore[no-untyped-def]
    """``MovingMean.vectors`` of the 2-norm."""
    x, y, z, _ = _node_poses(origin, scale, directions, segments, places)
    vectors = np.empty((6, x.size))
    for n in range(x.size):
        columns, pairs = _multiple_of_jacobian(geometry, mode, motor, x[n], y[n], z[n])
        vectors[0, n], vectors[1, n], vectors[2, n] = greatest_singular_vector(columns)
        vectors[3, n], vectors[4, n], vectors[5, n] = greatest_singular_vector(pairs)
    return vectors


@fast_kernel
def _condition_row(geometry, mode, motor, x, y, z, vectors, out):  # type: ignore[no-untyped-def]
    """1/κ₂ (N,) with known singular vectors, written in place; NaN where undefined."""
    for n in range(x.size):
        columns, pairs = _multiple_of_jacobian(geometry, mode, motor, x[n], y[n], z[n])
        greatest = _length(_combined(columns, vectors[0, n], vectors[1, n], vectors[2, n]))
        pair = _length(_combined(pairs, vectors[3, n], vectors[4, n], vectors[5, n]))
        u, first = columns[0], pairs[0]
        out[n] = abs(u[0] * first[0] + u[1] * first[1] + u[2] * first[2]) / (greatest * pair)


@short_kernel
def _integral(geometry, mode, frobenius, motor, origin, scale, directions, weights, segments, nodes, vectors):  # type: ignore[no-untyped-def]
    """Σ weight ∫ 1/κ t² dt."""
    rays, starts, ends = segments
    places, shares = nodes
    x, y, z, t = _node_poses(origin, scale, directions, segments, places)
    values = np.empty(x.size)
    if frobenius:
        frobenius_row(geometry, mode, motor, x, y, z, values)
    else:
        _condition_row(geometry, mode, motor, x, y, z, vectors, values)
    total = 0.0
    n = 0
    for s in range(rays.size):
        inside = 0.0
        for share in shares:
            if values[n] == values[n]:
                inside += share * (ends[s] - starts[s]) * t[n] * t[n] * values[n]
            n += 1
        total += weights[rays[s]] * inside
    return total


def moving_mean(
    mechanism: Mechanism, mode: Mode, field: RayField, *, frobenius: bool, motor: float, nodes: int
) -> MovingMean:
    """1/κ at ``nodes`` of each segment of a field, as ``conditioning_averages`` takes them."""
    vectors = np.empty((6, 0))
    if not frobenius:
        vectors = _vectors(
            mechanism.geometry,
            mode.signs,
            motor,
            field.origin,
            field.scale,
            field.rays.directions,
            (field.segments.ray, field.segments.start, field.segments.end),
            ray_nodes(nodes)[0],
        )
    return MovingMean(mode.signs, frobenius, motor, nodes, vectors)


def integral_near(mean: MovingMean, mechanism: Mechanism, moved: RayField) -> float:
    """∫ 1/κ dV (m³) of a neighbouring machine, to first order; ``moved``: its segments, by ``field_near``
    from those of the mean."""
    total: float = _integral(
        mechanism.geometry,
        mean.signs,
        mean.frobenius,
        mean.motor,
        moved.origin,
        moved.scale,
        moved.rays.directions,
        moved.rays.weights,
        (moved.segments.ray, moved.segments.start, moved.segments.end),
        ray_nodes(mean.nodes),
        mean.vectors,
    )
    return abs(moved.scale[0] * moved.scale[1] * moved.scale[2]) * total
