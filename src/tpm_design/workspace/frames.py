"""A frame in which a symmetric 3 × 3 matrix is nearly the identity, found in floats.

Whether a matrix is positive definite does not depend on the frame in which it is written, but how wide its
interval bounds are does: an entry along a nearly vanishing direction is a small difference of large numbers
in any frame but its own.
"""

from __future__ import annotations

import math

from tpm_design.arithmetic import inner

SWEEPS = 6
# eigenvalues below this share of the greatest are not scaled up to 1
LEAST_SHARE = 1e-12


@inner
def _rotated(pp, qq, pq, rp, rq, u, v):  # type: ignore[no-untyped-def]
    """One Jacobi rotation that makes the entry pq vanish: the new pp, qq, rp, rq and the new axes."""
    if pq == 0.0:
        return pp, qq, rp, rq, u, v
    theta = (qq - pp) / (2.0 * pq)
    tangent = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta * theta + 1.0))
    c = 1.0 / math.sqrt(tangent * tangent + 1.0)
    s = tangent * c
    first = (c * u[0] - s * v[0], c * u[1] - s * v[1], c * u[2] - s * v[2])
    second = (s * u[0] + c * v[0], s * u[1] + c * v[1], s * u[2] + c * v[2])
    return pp - tangent * pq, qq + tangent * pq, c * rp - s * rq, s * rp + c * rq, first, second


@inner
def identity_frame(s11, s22, s33, s12, s13, s23):  # type: ignore[no-untyped-def]
    """Three vectors q with qᵀ S q near 1 and qᵀ S p near 0: eigenvectors over the roots of the magnitudes of
    their eigenvalues. The unit vectors where S is not finite."""
    u, v, w = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    if not math.isfinite(s11 + s22 + s33 + s12 + s13 + s23):
        return u, v, w
    for _ in range(SWEEPS):
        s11, s22, s13, s23, u, v = _rotated(s11, s22, s12, s13, s23, u, v)
        s12 = 0.0
        s11, s33, s12, s23, u, w = _rotated(s11, s33, s13, s12, s23, u, w)
        s13 = 0.0
        s22, s33, s12, s13, v, w = _rotated(s22, s33, s23, s12, s13, v, w)
        s23 = 0.0
    least = LEAST_SHARE * max(abs(s11), abs(s22), abs(s33))
    if least == 0.0:
        return u, v, w
    return _scaled(u, s11, least), _scaled(v, s22, least), _scaled(w, s33, least)


@inner
def _scaled(u, eigenvalue, least):  # type: ignore[no-untyped-def]
    factor = 1.0 / math.sqrt(max(abs(eigenvalue), least))
    return u[0] * factor, u[1] * factor, u[2] * factor
