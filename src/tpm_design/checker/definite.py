"""Symmetric matrices that are positive definite for all values of what they depend on.

A 3 × 3 matrix is given by its entries 11, 22, 33, 23, 31, 12.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from flint import arb

Entries = Sequence[arb]

PARTS = 200
"""How many parts of the corners may be looked at."""


def positive_definite(entries: Entries) -> bool:
    """Whether the leading minors are > 0, whatever the entries are in their balls."""
    p, q, r, u, v, w = entries
    first = p * q - w * w
    if not (p > 0 and first > 0):
        return False
    return bool(r * first + w * (u * v) + v * (w * u - v * q) - u * (p * u) > 0)


def positive_definite_throughout(middle: Entries, swings: Iterable[Entries]) -> bool:
    """Whether M + Σ x_i S_i is positive definite for all |x_i| ≤ 1 and all M and S_i in their balls.

    For middles of balls it is if it is at the corners, x_i = ±1: a positive definite matrix stays one on the
    way to another. The corners are parted by one x_i after the other, the greatest S_i first. A part is done
    with where no sum of the other S_i, and of what is unknown of all, is as large as the least eigenvalue.
    """
    unknown = [entry.rad() for entry in middle]
    moves = []
    for swing in swings:
        unknown = [total + entry.rad() for total, entry in zip(unknown, swing, strict=True)]
        centre = [entry.mid() for entry in swing]
        moves.append((float(norm(magnitudes(centre))), centre))
    moves.sort(key=lambda move: move[0])
    rest = [norm(unknown)]
    for _, centre in moves:
        unknown = [total + part for total, part in zip(unknown, magnitudes(centre), strict=True)]
        rest.append(norm(unknown))
    waiting = [([entry.mid() for entry in middle], len(moves))]
    for _ in range(PARTS):
        if not waiting:
            return True
        part, left = waiting.pop()
        less = rest[left]
        if positive_definite((part[0] - less, part[1] - less, part[2] - less, *part[3:])):
            continue
        if left == 0:
            return False
        centre = moves[left - 1][1]
        waiting.append(([a + b for a, b in zip(part, centre, strict=True)], left - 1))
        waiting.append(([a - b for a, b in zip(part, centre, strict=True)], left - 1))
    return not waiting


def magnitudes(entries: Entries) -> list[arb]:
    return [abs(entry) for entry in entries]


def norm(magnitudes: Entries) -> arb:
    """The greatest sum of a row: no eigenvalue of a matrix with entries so large is larger (Gershgorin)."""
    p, q, r, u, v, w = magnitudes
    return (p + v + w).max(q + w + u).max(r + u + v)


def congruent(lower: Sequence[Sequence[arb]], entries: Entries) -> list[arb]:
    """P M Pᵀ of a lower triangular P and a symmetric M."""
    (a, _, _), (b, c, _), (d, e, f) = lower
    p, q, r, u, v, w = entries
    # rows of P M
    second = (b * p + c * w, b * w + c * q, b * v + c * u)
    third = (d * p + e * w + f * v, d * w + e * q + f * u, d * v + e * u + f * r)
    return [
        a * a * p,
        b * second[0] + c * second[1],
        d * third[0] + e * third[1] + f * third[2],
        b * third[0] + c * third[1],
        a * third[0],
        a * second[0],
    ]
