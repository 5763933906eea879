"""Ray fields of a design, moved to its neighbours."""

from __future__ import annotations

from dataclasses import dataclass

from tpm_design.computed_once import computed_once
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.aspects import RayField
from tpm_design.workspace.moving_boundary import (
    MovingBoundary,
    field_near,
    mode_field_near,
    moving_boundary,
)
from tpm_design.workspace.region_geometry import PlacedRegion


@dataclass(frozen=True, eq=False)
class MovingFields:
    """A fine and a coarse ray field of a design, of each one connected set (its index in ``components``) or
    all (None). ``floor``: as they were traced with, None where reach alone was looked at. ``of_region``: rays
    of the placed region, not of the whole mode. What moves their ends is found when a neighbour first asks.
    """

    mechanism: Mechanism
    mode: Mode
    fields: tuple[RayField, RayField]
    components: tuple[int | None, int | None]
    floor: float | None
    of_region: bool = False

    @computed_once
    def boundaries(self) -> tuple[MovingBoundary, ...]:
        """Of the fine field and of the coarse one."""
        return tuple(
            moving_boundary(self.mechanism, self.mode, field, component, self.floor)
            for field, component in zip(self.fields, self.components, strict=True)
        )

    def near(self, machine: Mechanism, region: PlacedRegion | None) -> tuple[RayField, RayField]:
        """The fields of a neighbouring design, to first order. Metrics ask its ``Context.moved``."""
        if self.of_region and region is not None:
            fine, coarse = (field_near(b, machine, region.centre, region.half) for b in self.boundaries)
        else:
            fine, coarse = (mode_field_near(b, machine) for b in self.boundaries)
        return fine, coarse
