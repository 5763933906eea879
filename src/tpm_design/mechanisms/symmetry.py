"""Which working modes of a machine with three orthogonal limbs are the same machine seen from elsewhere.

A signed permutation R of the axes sends axis e_i to ε_i e_π(i) and limb i to limb π(i). Angular velocities
are pseudovectors, so that the gear ratios go with det R. The machine is unchanged if

    f_π(i) = f_i,  r_π(i) = r_i,  δ_π(i) = ε_i δ_i,  k_π(i) = det R · k_i,

and R then sends octant o and elbows s to o_π(i) → ε_i o_i and s_π(i) → ε_i s_i: a mode of the same volumes,
determinant margins and conditioning.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from tpm_design.mechanisms.mechanism import Mechanism, Mode

FREE = -2.0  # bound of a joint without limits


class SignedPermutation(NamedTuple):
    """Axis i goes to ``signs[i]`` times axis ``permutation[i]``."""

    permutation: tuple[int, ...]
    signs: tuple[float, ...]

    @property
    def determinant(self) -> float:
        """+1 for a rotation, −1 with a reflection."""
        pairs = itertools.combinations(self.permutation, 2)
        parity = sum(first > second for first, second in pairs)
        flips = sum(sign < 0.0 for sign in self.signs)
        return 1.0 if (parity + flips) % 2 == 0 else -1.0

    def moved(self, values: Sequence[float], signed: bool = True) -> tuple[float, ...]:
        """One value per axis, carried to the axis it goes to, with that axis' sign or without."""
        result = [0.0] * len(values)
        for axis, value in enumerate(values):
            result[self.permutation[axis]] = (self.signs[axis] if signed else 1.0) * value
        return tuple(result)


IDENTITY = SignedPermutation((0, 1, 2), (1.0, 1.0, 1.0))
SIGNED_PERMUTATIONS = tuple(
    SignedPermutation(permutation, signs)
    for permutation in itertools.permutations(range(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
)


def symmetries(geometry: Any) -> tuple[SignedPermutation, ...]:
    """The signed permutations that leave a machine unchanged, the identity first.

    ``geometry`` has base, platform, proximal, distal and gear of each limb, and limit_bound of each joint.
    Joint limits are one-sided: limits of θ_i2, θ_i3 or θ_i4 leave no reflected axis, limits of θ_i1 only the
    identity, since its zero lies differently in each limb.
    """
    return tuple(candidate for candidate in SIGNED_PERMUTATIONS if _unchanged(geometry, candidate))


def _unchanged(geometry: Any, candidate: SignedPermutation) -> bool:
    if geometry.limit_bound[0] != FREE and candidate != IDENTITY:
        return False
    if any(bound != FREE for bound in geometry.limit_bound[1:]) and min(candidate.signs) < 0.0:
        return False
    offsets = tuple(p - b for p, b in zip(geometry.platform, geometry.base, strict=True))
    gears = tuple(candidate.determinant * gear for gear in geometry.gear)
    return (
        candidate.moved(geometry.proximal, signed=False) == geometry.proximal
        and candidate.moved(geometry.distal, signed=False) == geometry.distal
        and candidate.moved(offsets) == offsets
        and candidate.moved(gears, signed=False) == geometry.gear
    )


def mode_orbits(moves: Iterable[SignedPermutation]) -> tuple[tuple[dict[str, str], ...], ...]:
    """The 64 modes (octant, elbows) in the orbits of a group, each sorted, "+" before "-"."""
    group = tuple(moves)
    left = list(itertools.product((1.0, -1.0), repeat=6))
    orbits = []
    while left:
        first = left[0]
        orbit = {move.moved(first[:3]) + move.moved(first[3:]) for move in group}
        orbits.append(tuple(_named(signs) for signs in left if signs in orbit))
        left = [signs for signs in left if signs not in orbit]
    return tuple(orbits)


def inequivalent_modes(mechanism: Mechanism) -> tuple[Mode, ...]:
    """One working mode of each orbit under the machine's symmetries, in the order of their signs."""
    return tuple(mechanism.mode_of(orbit[0]) for orbit in mode_orbits(symmetries(mechanism.geometry)))


def _named(signs: Sequence[float]) -> dict[str, str]:
    text = "".join("+" if sign > 0.0 else "-" for sign in signs)
    return {"octant": text[:3], "elbows": text[3:]}
