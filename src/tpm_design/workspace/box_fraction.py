"""The share of a box that a plane cuts off, in closed form."""

from __future__ import annotations

import math

from tpm_design.arithmetic import inner

# of the largest; flatter slopes would cost digits below
FLATTEST = 1e-4
# relative to the products that are summed: more than their rounding
ROUNDING = 1e-13
# beyond them, cubes of slopes underflow or overflow
SMALLEST_CUBED, LARGEST_CUBED = 1e-80, 1e80


@inner
def _power(x, n):  # type: ignore[no-untyped-def]
    if x <= 0.0:
        return 0.0
    if n == 1:
        return x
    return x * x if n == 2 else x * x * x


@inner
def _share(level, p, q, r, count, side):  # type: ignore[no-untyped-def]
    """The share of ``share_below`` for ``count`` slopes that are not 0, and beyond it on the ``side`` ±1 what
    rounding may have done."""
    total = 2.0 * (p + q + r)
    a = 0.5 * total - level
    if a <= 0.0:
        return 0.0
    if a >= total:
        return 1.0
    p, q, r = 2.0 * p, 2.0 * q, 2.0 * r
    if count == 1:
        share, scale = a / p, 1.0
    elif count == 2:
        squares = _power(a, 2) - _power(a - p, 2) - _power(a - q, 2) + _power(a - p - q, 2)
        share, scale = squares / (2.0 * p * q), total * total / (p * q)
    else:
        single = _power(a - p, 3) + _power(a - q, 3) + _power(a - r, 3)
        double = _power(a - p - q, 3) + _power(a - q - r, 3) + _power(a - r - p, 3)
        share = (_power(a, 3) - single + double) / (6.0 * p * q * r)
        scale = total * total * total / (p * q * r)
    return min(1.0, max(0.0, share + side * ROUNDING * scale))


@inner
def share_below(level, first, second, third):  # type: ignore[no-untyped-def]
    """(lower, upper) bound of the share of the box |t_i| ≤ 1 where level + Σ n_i t_i < 0, for slopes n_i ≥ 0.

    The part Σ n_i w_i < a of the unit cube is Σ ± (a − sums of n_i)₊³/(6 n₁n₂n₃), over all subsets of the
    n_i. Slopes that are too flat go into the level instead.
    """
    total = first + second + third
    if level > 2.0 * total:
        return 0.0, 0.0
    if level < -2.0 * total:
        return 1.0, 1.0
    largest = max(first, second, third)
    if not SMALLEST_CUBED < largest < LARGEST_CUBED:
        _, exponent = math.frexp(largest)
        level, first = math.ldexp(level, -exponent), math.ldexp(first, -exponent)
        second, third = math.ldexp(second, -exponent), math.ldexp(third, -exponent)
        largest = max(first, second, third)
    p, q, r, flat = 0.0, 0.0, 0.0, 0.0
    count = 0
    for slope in (first, second, third):
        if slope > FLATTEST * largest:
            count += 1
            p, q, r = slope, p, q
        else:
            flat += slope
    # covers the rounding of the level's sums
    flat += 1e-15 * (abs(level) + flat + 3.0 * largest)
    if count == 0:
        return 1.0 if level + flat < 0.0 else 0.0, 1.0 if level - flat < 0.0 else 0.0
    return _share(level + flat, p, q, r, count, -1.0), _share(level - flat, p, q, r, count, 1.0)
