"""Distances between straight links."""

from __future__ import annotations

import math

from tpm_design.arithmetic import inner

Point = tuple[float, float, float]


@inner
def _dot(u, v):  # type: ignore[no-untyped-def]
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@inner
def _clamp(value):  # type: ignore[no-untyped-def]
    return min(1.0, max(0.0, value))


@inner
def segment_distance(a, b, c, d):  # type: ignore[no-untyped-def]
    """Distance (m) between segments ab and cd.

    The squared distance is a convex quadratic of the two parameters on the unit square: the interior
    minimum if it lies inside, else the best of the four edges.
    """
    u = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    v = (d[0] - c[0], d[1] - c[1], d[2] - c[2])
    w = (a[0] - c[0], a[1] - c[1], a[2] - c[2])
    uu, uv, vv, uw, vw = _dot(u, u), _dot(u, v), _dot(v, v), _dot(u, w), _dot(v, w)
    determinant = uu * vv - uv * uv
    least = math.inf
    if determinant > 1e-14 * uu * vv:
        s = (uv * vw - vv * uw) / determinant
        t = (uu * vw - uv * uw) / determinant
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            least = _square(w, u, v, s, t)
    for end in (0.0, 1.0):
        t = _clamp((vw + end * uv) / vv) if vv > 0.0 else 0.0
        least = min(least, _square(w, u, v, end, t))
        s = _clamp((end * uv - uw) / uu) if uu > 0.0 else 0.0
        least = min(least, _square(w, u, v, s, end))
    return math.sqrt(max(0.0, least))


@inner
def _square(w, u, v, s, t):  # type: ignore[no-untyped-def]
    x = w[0] + s * u[0] - t * v[0]
    y = w[1] + s * u[1] - t * v[1]
    z = w[2] + s * u[2] - t * v[2]
    return x * x + y * y + z * z


@inner
def chain_distance(chain, other):  # type: ignore[no-untyped-def]
    """Distance (m) between two chains of straight links, each a tuple of joint centres."""
    least = math.inf
    for i in range(len(chain) - 1):
        for j in range(len(other) - 1):
            least = min(least, segment_distance(chain[i], chain[i + 1], other[j], other[j + 1]))
    return least
