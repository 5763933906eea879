"""Volumes by rays, with an error from two resolutions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tpm_design.errors import ParameterError, did_you_mean
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.aspects import RayField, mode_fields

VolumeKind = Literal["reachable", "singularity_free"]
FINEST_ORDER = 96


@dataclass(frozen=True)
class Volume:
    """``value`` (m³) and ``error``: the change (m³) from a coarser set of rays."""

    value: float
    error: float


def rays_for(rtol: float) -> int:
    """Rays along each square at which ``rtol`` is usually met, a fixed number so that volumes stay smooth."""
    return max(4, min(FINEST_ORDER, round(8 * (1e-3 / rtol) ** 0.5)))


def coarser(order: int) -> int:
    """The order whose result is compared with that of ``order``."""
    return max(3, (2 * order) // 3)


def check_asked(kind: str, margin: float) -> None:
    """Raises ParameterError on an unknown kind of volume or a margin that is no number in [0, 1)."""
    kinds = ("reachable", "singularity_free")
    if kind not in kinds:
        raise ParameterError(f"Unknown kind of volume {kind!r}.", remedy=did_you_mean(str(kind), kinds))
    if not isinstance(margin, int | float) or not 0.0 <= margin < 1.0:
        raise ParameterError(f"margin = {margin!r} is not in [0, 1).", remedy="Margins are dimensionless.")


def workspace_volume(
    mechanism: Mechanism,
    mode: Mode,
    kind: VolumeKind = "singularity_free",
    margin: float = 0.0,
    rtol: float = 1e-3,
) -> Volume:
    """Volume (m³) of the mode's reachable poses, or of its largest aspect with every |determinant| above
    ``margin``. Rays are doubled until the error is within ``rtol`` of the value.

    Raises ParameterError on an unknown kind, a margin outside [0, 1) or an rtol outside [1e-6, 0.1].
    """
    check_asked(kind, margin)
    if not 1e-6 <= rtol <= 0.1:
        raise ParameterError(f"rtol = {rtol!r} is not in [1e-6, 0.1].")
    order = rays_for(rtol)
    while True:
        volume = volume_at(mechanism, mode, kind, margin, order)
        if volume.error <= rtol * volume.value or order >= FINEST_ORDER:
            return volume
        order = min(FINEST_ORDER, 2 * order)


def volume_at(mechanism: Mechanism, mode: Mode, kind: VolumeKind, margin: float, order: int) -> Volume:
    """The volume at one fixed resolution, smooth in the dimensions of the mechanism."""
    sided = kind == "singularity_free"
    fields = mode_fields(mechanism, mode, orders=(order, coarser(order)), sided=sided, floor=margin)
    fine, coarse = (selected_volume(field, sided) for field in fields)
    return Volume(fine, abs(fine - coarse))


def selected_volume(field: RayField, largest_only: bool) -> float:
    """Volume of the largest component, or of all."""
    if not field.volumes.size:
        return 0.0
    return float(np.max(field.volumes) if largest_only else np.sum(field.volumes))
