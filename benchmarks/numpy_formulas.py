"""The 3-URU's formulas in NumPy: what one would write without the package. Octant +++, elbows +++."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vector = tuple[Array, Array, Array]


class Limb(NamedTuple):
    """Rows of V (unit) and W along e_i, e_j, e_k, k γ, and the two reach margins."""

    v: Vector
    w: Vector
    gain: Array
    outer: Array
    inner: Array


def limb(offset: float, f: float, r: float, k: float, p: Array, pj: Array, pk: Array, *, unit: bool) -> Limb:
    alpha = p + offset
    beta_squared = pj * pj + pk * pk
    beta = np.sqrt(beta_squared)
    rho_squared = alpha * alpha + beta_squared
    rho = np.sqrt(rho_squared)
    inverse = 1.0 / rho_squared
    share = 0.5 + (0.5 * (r * r - f * f)) * inverse
    bend = 0.5 * np.sqrt(
        np.maximum((f + r) ** 2 * inverse - 1.0, 0.0) * np.maximum(1.0 - (f - r) ** 2 * inverse, 0.0)
    )
    a = (alpha * share + beta * bend) / r
    c = (beta * share - alpha * bend) / r
    hj, hk = pj / beta, pk / beta
    gain = (-k / r) * (rho_squared * bend)
    if unit:
        scale = 1.0 / np.sqrt(beta_squared + gain * gain)
        toward, across = beta * scale, gain * scale
    else:
        toward, across = np.ones_like(beta), gain / beta
    vj, vk = c * hj, c * hk
    w = toward * a, toward * vj - across * hk, toward * vk + across * hj
    return Limb((a, vj, vk), w, gain, f + r - rho, rho - abs(f - r))


def cross(u: Vector, v: Vector) -> Vector:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def dot(u: Vector, v: Vector) -> Array:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def second(row: Vector) -> Vector:
    return row[2], row[0], row[1]


def third(row: Vector) -> Vector:
    return row[1], row[2], row[0]


def reachable(offset: float, f: float, r: float, x: Array, y: Array, z: Array) -> NDArray[np.bool_]:
    """Whether the pose is in every leg space; squared lengths, without a root."""
    square = x * x + y * y + z * z + offset * offset
    inside = np.ones(square.shape, dtype=bool)
    for p in (x, y, z):
        rho_squared = square + (2.0 * offset) * p
        inside &= rho_squared <= (f + r) ** 2
        inside &= rho_squared >= (f - r) ** 2
    return inside


def margins(offset: float, f: float, r: float, k: float, x: Array, y: Array, z: Array) -> tuple[Array, ...]:
    """Least leg margin, least side, det V, det W of unit rows, det H."""
    one = limb(offset, f, r, k, x, y, z, unit=True)
    two = limb(offset, f, r, k, y, z, x, unit=True)
    three = limb(offset, f, r, k, z, x, y, unit=True)
    legs = one.outer
    for margin in (one.inner, two.outer, two.inner, three.outer, three.inner):
        legs = np.minimum(legs, margin)
    side = np.minimum(np.minimum(x, y), z)
    translation = dot(one.v, cross(second(two.v), third(three.v)))
    actuation = dot(one.w, cross(second(two.w), third(three.w)))
    size = np.sqrt((x * x + y * y) * (y * y + z * z) * (z * z + x * x))
    return legs, side, translation, actuation, 2.0 * x * y * z / size


def conditioning(offset: float, f: float, r: float, k: float, x: Array, y: Array, z: Array) -> Array:
    """1/κ_F driven by the motors."""
    one = limb(offset, f, r, k, x, y, z, unit=False)
    two = limb(offset, f, r, k, y, z, x, unit=False)
    three = limb(offset, f, r, k, z, x, y, unit=False)
    r1, r2, r3 = one.w, second(two.w), third(three.w)
    u, v, w = cross(r2, r3), cross(r3, r1), cross(r1, r2)
    b1, b2, b3 = one.gain, two.gain, three.gain
    c1, c2, c3 = b2 * b3, b3 * b1, b1 * b2
    forward = b1 * b1 * dot(u, u) + b2 * b2 * dot(v, v) + b3 * b3 * dot(w, w)
    backward = c1 * c1 * dot(r1, r1) + c2 * c2 * dot(r2, r2) + c3 * c3 * dot(r3, r3)
    return 3.0 * np.abs(dot(r1, u) * b1 * c1) / np.sqrt(forward * backward)
