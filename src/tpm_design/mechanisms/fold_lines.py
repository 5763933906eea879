"""Lines on which a limb is folded: they bound nothing, and yet no region may hold one in its interior."""

from __future__ import annotations

from dataclasses import dataclass

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class FoldLine:
    """Poses at which one limb is folded: within ``radius`` (m) of the line through ``point`` (m) along the
    unit vector ``direction``. With ``radius`` 0 it has no volume, but a pose cannot pass it at will."""

    point: Vector
    direction: Vector
    radius: float
