"""Two bars in a plane, from the origin to a point, without inverse trigonometry."""

from __future__ import annotations

from typing import NamedTuple

from flint import arb

from tpm_design.checker.balls import (
    ZERO,
    Enclosure,
    chained,
    constant,
    direction,
    inverse,
    root,
    square,
    wide_square,
)
from tpm_design.checker.mechanisms.configuration import Configuration

ONE, TWO = arb(1), arb(2)
UNIT = arb(0, 1)
NARROWINGS = 1


class End(NamedTuple):
    """The point (α, β), α² + β², and the bars: f from the origin, r to the point."""

    alpha: Enclosure
    beta: Enclosure
    rho_squared: Enclosure
    f: Enclosure
    r: Enclosure


class Chain(NamedTuple):
    """The unit vector (a, c) along the second bar, and cosine and sine of its angle from the first."""

    a: Enclosure
    c: Enclosure
    elbow_cosine: Enclosure
    elbow_sine: Enclosure

    @property
    def first(self) -> tuple[Enclosure, Enclosure]:
        """The unit vector along the first bar."""
        a, c, cos, sin = self
        return a * cos + c * sin, c * cos - a * sin


def chain(at: Configuration, end: End, elbow: int, middle: Chain | None) -> Chain:
    """``elbow``: +1 where the first bar is turned from (α, β) in the positive sense. ``middle``: the chain in
    the middle of the box.

    r a = α q + β e and r c = β q − α e, with S = 2 ρ² e twice the area that the elbow spans.
    """
    alpha, beta, rho_squared, f, r = end
    cos = (rho_squared - square(f) - square(r)) / (f * r).times(TWO)
    sin = sine_of(cos, -elbow)
    # (a, c) is the direction of (α, β) turned by the angle of the triangle f, r, ρ at its end
    toward, up, rho = (part.value for part in direction(constant(alpha.value), constant(beta.value)))
    per_rho = inverse(rho)
    excess = wide_square(r.value) - wide_square(f.value)
    near = (rho + excess * per_rho) * inverse(2 * r.value)
    aside = -f.value * sin.value * per_rho
    a = unit(toward * near + up * aside)
    c = unit(up * near - toward * aside)
    if middle is None:
        return Chain(Enclosure(a, {}), Enclosure(c, {}), cos, sin)
    for _ in range(NARROWINGS):
        turn = turning(end, a, c, cos.value, sin.value)
        along, across = chained(a, ((-c, turn),)), chained(c, ((a, turn),))
        a, c = at.narrowed(along, middle.a).value, at.narrowed(across, middle.c).value
    turn = turning(end, a, c, cos.value, sin.value)
    return Chain(chained(a, ((-c, turn),)), chained(c, ((a, turn),)), cos, sin)


def turning(end: End, a: arb, c: arb, cos: arb, sin: arb) -> Enclosure:
    """Derivatives of the angle φ of the second bar: |(α, β) − r (a, c)| = f differentiated, with the first
    bar's direction u and the elbow θ, gives r sin θ dφ = df + cos θ dr − u·(dα, dβ)."""
    share = inverse(end.r.value * sin)
    u = (unit(a * cos + c * sin), unit(c * cos - a * sin))
    partials = (
        (share, end.f),
        (share * cos, end.r),
        (-share * u[0], end.alpha),
        (-share * u[1], end.beta),
    )
    return chained(ZERO, partials)


def sine_of(cos: Enclosure, sign: int) -> Enclosure:
    """The sine of an angle of which the cosine is known; 0 where the cosine is beyond ±1."""
    sin = root(constant(ONE - wide_square(cos.value))).value
    if sign < 0:
        sin = -sin
    return chained(sin, ((-cos.value * inverse(sin), cos),))


def unit(part: arb) -> arb:
    """What is known of a component of a unit vector."""
    return part.intersection(UNIT) if part.overlaps(UNIT) else UNIT
