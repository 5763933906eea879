"""One answer of forward kinematics."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Assembly:
    """One way in which the limbs close. ``pose`` (3,) in SI units; ``box``: bounds of its coordinates;
    ``unique``: the box is proved to hold this assembly and no other (else it may hold none or several)."""

    pose: tuple[float, float, float]
    box: tuple[tuple[float, float], ...]
    unique: bool
