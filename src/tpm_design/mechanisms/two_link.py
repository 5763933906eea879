"""Two links in a plane that join the origin to the point (α, β): the distal link's direction.

α = f cos θ + r a, β = f sin θ + r c with the distal link's unit vector (a, c). Seen as a function of the
point, that vector turns by φ with dφ = −[(α − r a) dα + (β − r c) dβ]/(r γ), γ = f sin of the elbow angle
(the scalar product of the loop's differential with the proximal link). Where the signs of both brackets are
known over a box, φ is least and greatest at two of its corners: intervals then get the exact range where
interval evaluation of the closed form is two to three times as wide.
"""

from __future__ import annotations

import math
from typing import Any

from tpm_design.arithmetic import Dual, Interval, root, sqr
from tpm_design.arithmetic.affine import is_affine
from tpm_design.arithmetic.compilation import FAST, STRICT, is_number
from tpm_design.arithmetic.dual import as_dual, combinations, differences, is_dual, multiples
from tpm_design.arithmetic.interval import bounded, hull
from tpm_design.arithmetic.interval_functions import as_interval, keeps_away

# isort: split
from numba.extending import overload, register_jitable


def distal_link(alpha: Any, beta: Any, rho_squared: Any, f: Any, r: Any, elbow: Any) -> Any:
    """(a, c, γ) of links f and r for a point with ρ² = α² + β²; elbow + has γ < 0.

    Out of reach the elbow stays straight. In compiled code, for floats, Intervals, Duals of either, and
    Affine points with ``r`` Affine or constant.
    """
    raise NotImplementedError


def _closed_form(alpha: Any, beta: Any, rho_squared: Any, f: Any, r: Any, elbow: Any) -> Any:
    inverse = 1.0 / rho_squared
    share = 0.5 + 0.5 * (r * r - f * f) * inverse
    stretch, fold = (f + r) * (f + r) * inverse - 1.0, 1.0 - (f - r) * (f - r) * inverse
    bend = (0.5 * elbow) * math.sqrt(max(max(stretch, 0.0) * max(fold, 0.0), 0.0))
    a = (alpha * share + beta * bend) / r
    c = (beta * share - alpha * bend) / r
    return a, c, -(rho_squared * bend) / r


@register_jitable(**STRICT)
def bounds_from_lengths(f: Interval, r: Interval) -> Any:
    """What the bounds need of the lengths: f² + r², 4f²r², (r² − f²)/2, 1/r."""
    f_squared, r_squared = sqr(f), sqr(r)
    return f_squared + r_squared, sqr(2.0 * f * r), 0.5 * (r_squared - f_squared), 1.0 / r


@register_jitable(**STRICT)
def natural_bounds(alpha: Interval, beta: Interval, rho_squared: Interval, lengths: Any, elbow: float) -> Any:
    """Interval evaluation of the closed form."""
    both, product, difference, inverse_r = lengths
    # (2 f r)² sin² of the elbow angle
    bend = 0.5 * root(product - sqr(rho_squared - both))
    signed = bend if elbow > 0.0 else -bend
    inverse = 1.0 / rho_squared
    share, bent = 0.5 + difference * inverse, signed * inverse
    a = (alpha * share + beta * bent) * inverse_r
    c = (beta * share - alpha * bent) * inverse_r
    return a, c, -(signed * inverse_r)


@register_jitable(**STRICT)
def ends(x: Interval, rate: Interval) -> Any:
    """The end of ``x`` where what changes at this rate, in one sense, is least, and where it is greatest."""
    rising = rate.lo >= 0.0
    falling = (rate.hi <= 0.0) & (not rising)
    first = bounded(x.hi if falling else x.lo, x.lo if rising else x.hi)
    last = bounded(x.hi if rising else x.lo, x.lo if falling else x.hi)
    return first, last


@register_jitable(**STRICT)
def interval_bounds(
    alpha: Interval, beta: Interval, rho_squared: Interval, f: Interval, r: Interval, elbow: float
) -> Any:
    lengths = bounds_from_lengths(f, r)
    a, c, gamma = natural_bounds(alpha, beta, rho_squared, lengths, elbow)
    if not keeps_away(gamma):
        return a, c, gamma
    alpha_first, alpha_last = ends(alpha, alpha - r * a)
    beta_first, beta_last = ends(beta, beta - r * c)
    squared_first, squared_last = sqr(alpha_first) + sqr(beta_first), sqr(alpha_last) + sqr(beta_last)
    a_first, c_first, _ = natural_bounds(alpha_first, beta_first, squared_first, lengths, elbow)
    a_last, c_last, _ = natural_bounds(alpha_last, beta_last, squared_last, lengths, elbow)
    # the cosine of φ is monotone where its sine keeps its sign, and the other way round
    return (
        hull(a_first, a_last) if keeps_away(c) else a,
        hull(c_first, c_last) if keeps_away(a) else c,
        gamma,
    )


def _intervals(alpha: Any, beta: Any, rho_squared: Any, f: Any, r: Any, elbow: Any) -> Any:
    return interval_bounds(
        as_interval(alpha), as_interval(beta), as_interval(rho_squared), as_interval(f), as_interval(r), elbow
    )


def _duals_of_the_point(alpha: Any, beta: Any, rho_squared: Any, f: Any, r: Any, elbow: Any) -> Any:
    along, across = as_dual(alpha, rho_squared), as_dual(beta, rho_squared)
    a, c, gamma = distal_link(along.value, across.value, rho_squared.value, f, r, elbow)
    scale = -1.0 / (r * gamma)
    turn = combinations(
        (along.value - r * a) * scale, along.derivatives, (across.value - r * c) * scale, across.derivatives
    )
    # γ² = f² − q², q = (ρ² − f² − r²)/2r
    slope = (rho_squared.value - (sqr(f) + sqr(r))) * scale / (4.0 * r)
    return (
        Dual(a, multiples(-c, turn)),
        Dual(c, multiples(a, turn)),
        Dual(gamma, multiples(slope, rho_squared.derivatives)),
    )


def _duals_of_the_lengths(alpha: Any, beta: Any, rho_squared: Any, f: Any, r: Any, elbow: Any) -> Any:
    """As above with dφ = [… − f df − q dr] and γ dγ = (1 + q/r)(f df + q dr) − (q/2r) dρ²."""
    proximal, distal = as_dual(f, r), as_dual(r, f)
    point = as_dual(rho_squared, proximal)
    along, across = as_dual(alpha, proximal), as_dual(beta, proximal)
    f_value, r_value = proximal.value, distal.value
    a, c, gamma = distal_link(along.value, across.value, point.value, f_value, r_value, elbow)
    q = (point.value - (sqr(f_value) + sqr(r_value))) / (2.0 * r_value)
    scale = -1.0 / (r_value * gamma)
    by_point = combinations(
        along.value - r_value * a, along.derivatives, across.value - r_value * c, across.derivatives
    )
    by_lengths = combinations(f_value, proximal.derivatives, q, distal.derivatives)
    turn = multiples(scale, differences(by_point, by_lengths))
    gain = combinations((1.0 + q / r_value) / gamma, by_lengths, q * scale * 0.5, point.derivatives)
    return Dual(a, multiples(-c, turn)), Dual(c, multiples(a, turn)), Dual(gamma, gain)


def _forms_of_the_point(alpha: Any, beta: Any, rho_squared: Any, f: Any, r: Any, elbow: Any) -> Any:
    return _forms(alpha, beta, rho_squared, bounds_from_lengths(as_interval(f), as_interval(r)), elbow)


def _forms_of_all(alpha: Any, beta: Any, rho_squared: Any, f: Any, r: Any, elbow: Any) -> Any:
    return _forms(alpha, beta, rho_squared, bounds_from_lengths(as_interval(f), r), elbow)


@register_jitable(**STRICT)
def _forms(alpha: Any, beta: Any, rho_squared: Any, lengths: Any, elbow: Any) -> Any:
    both, product, difference, inverse_r = lengths
    bent = (0.5 * elbow) * root(product - sqr(rho_squared - both))
    inverse = 1.0 / rho_squared
    share, turn = 0.5 + difference * inverse, bent * inverse
    a = (alpha * share + beta * turn) * inverse_r
    c = (beta * share - alpha * turn) * inverse_r
    return a, c, -(bent * inverse_r)


def _for_floats(alpha: Any, beta: Any, rho_squared: Any, f: Any, r: Any, elbow: Any) -> Any:
    return _closed_form if all(map(is_number, (alpha, beta, rho_squared, f, r))) else None


def _for_others(alpha: Any, beta: Any, rho_squared: Any, f: Any, r: Any, elbow: Any) -> Any:
    if is_dual(f) or is_dual(r):
        return _duals_of_the_lengths
    if is_dual(rho_squared):
        return _duals_of_the_point
    if is_affine(rho_squared):
        return _forms_of_all if is_affine(r) else _forms_of_the_point
    return None if all(map(is_number, (alpha, beta, rho_squared, f, r))) else _intervals


overload(distal_link, jit_options=FAST, strict=False)(_for_floats)
overload(distal_link, jit_options=STRICT, strict=False)(_for_others)
