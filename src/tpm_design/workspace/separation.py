"""Proofs that a box of poses keeps away from a region."""

from __future__ import annotations

import math

from tpm_design.arithmetic import Interval, inner, magnitude, root, sqr
from tpm_design.workspace.region_geometry import BOX, CYLINDER, nearest

PROJECTIONS = 4


@inner
def _held(value, lo, hi):  # type: ignore[no-untyped-def]
    return min(hi, max(lo, value))


@inner
def _support(region, u, v, w):  # type: ignore[no-untyped-def]
    """Bound of (u, v, w)·(p − centre) over the region."""
    a, b, c = region.half
    if region.form == BOX:
        return a * magnitude(u) + b * magnitude(v) + c * magnitude(w)
    if region.form == CYLINDER:
        return a * root(sqr(u) + sqr(v)) + c * magnitude(w)
    return root(sqr(a * u) + sqr(b * v) + sqr(c * w))


@inner
def proved_apart(region, distance, box):  # type: ignore[no-untyped-def]
    """Whether every pose of ``box`` (3, 2) is proved to be farther than ``distance`` (m) from a convex region
    (box, cylinder, ellipsoid): a plane separates them.

    Projecting to and fro finds its normal in floats; the test of the plane itself is in intervals.
    """
    qx = _held(region.centre[0], box[0, 0], box[0, 1])
    qy = _held(region.centre[1], box[1, 0], box[1, 1])
    qz = _held(region.centre[2], box[2, 0], box[2, 1])
    u, v, w = 0.0, 0.0, 0.0
    for _ in range(PROJECTIONS):
        x, y, z = nearest(region, qx, qy, qz)
        qx, qy, qz = (
            _held(x, box[0, 0], box[0, 1]),
            _held(y, box[1, 0], box[1, 1]),
            _held(z, box[2, 0], box[2, 1]),
        )
        u, v, w = qx - x, qy - y, qz - z
    if u == 0.0 and v == 0.0 and w == 0.0:
        return False
    if not math.isfinite(u + v + w):
        return False
    least = Interval(0.0, 0.0)
    normal = (u, v, w)
    for k in range(3):
        end = box[k, 0] if normal[k] >= 0.0 else box[k, 1]
        least = least + normal[k] * (Interval(end, end) - region.centre[k])
    nu, nv, nw = Interval(u, u), Interval(v, v), Interval(w, w)
    reach = _support(region, nu, nv, nw) + distance * root(sqr(nu) + sqr(nv) + sqr(nw))
    return (least - reach).lo > 0.0
