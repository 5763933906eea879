"""One design seen by its metrics: what several of them need is computed once, when first asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tpm_design.computed_once import computed_once
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.mechanisms.pointwise import kept_sides
from tpm_design.metrics.moving_fields import MovingFields
from tpm_design.workspace.aspects import RayField, locate, located, mode_fields, region_fields
from tpm_design.workspace.extremes import Extreme, IndicesNear, extremes_over_region
from tpm_design.workspace.fold_clearance import fold_clearance
from tpm_design.workspace.indices import DETERMINANT, EXTENT, REACH, Index
from tpm_design.workspace.loci import LocusDistance, locus_distance
from tpm_design.workspace.region_geometry import PlacedRegion
from tpm_design.workspace.sampling import feelers, lattice
from tpm_design.workspace.survey import Survey, survey
from tpm_design.workspace.volume import coarser, rays_for

FEELERS_PER_SAMPLE = 0.8
SURVEY_RAYS_PER_SAMPLE = 1.4

POLE = -10.0
"""Some determinants have poles. Beyond this no value says more, and larger ones would hide other
shortfalls."""


@dataclass(frozen=True)
class Sides:
    """For one determinant over the region: ``margin`` its least value on the side it mostly keeps
    (negative where it changes sign), with ``error`` and the ``pieces`` of it; ``index`` and ``extreme``: what
    it is the extreme of."""

    margin: float
    error: float
    pieces: tuple[float, ...]
    index: Index
    extreme: Extreme


@dataclass(frozen=True)
class Span:
    """``value``: greatest less least value of an ``index`` over the region, with its ``error``; the ``least``
    and ``greatest`` are attained at poses of their own."""

    value: float
    error: float
    index: Index
    least: Extreme
    greatest: Extreme


@dataclass(frozen=True)
class Context:
    """A mechanism in a working mode with its placed region, if the study has one.

    ``volume_rtol``: relative error aimed at by volumes and averages. ``region_samples``: lattice poses
    along the region's longest edge.
    """

    mechanism: Mechanism
    mode: Mode
    region: PlacedRegion | None
    volume_rtol: float
    region_samples: int

    @property
    def placed(self) -> PlacedRegion:
        """The region; metrics that need one are refused by the study where there is none."""
        if self.region is None:
            raise ValueError("this metric needs a region")
        return self.region

    @computed_once
    def grid(self) -> NDArray[np.float64]:
        """The region's lattice (I, J, K, 3) in metres."""
        return lattice(self.placed, self.region_samples)

    @computed_once
    def poses(self) -> NDArray[np.float64]:
        """The lattice as (N, 3)."""
        return np.ascontiguousarray(self.grid.reshape(-1, 3))

    @property
    def spacing(self) -> float:
        """Distance (m) between lattice poses along the longest edge."""
        longest = 2.0 * max(self.placed.half)
        return longest / max(1, self.region_samples - 1) if longest > 0.0 else 1e-3

    def least(self, index: Index) -> Extreme:
        """Least value of an index over the region (greatest for sign −1)."""
        return self.extremes(index)[0]

    def extremes(self, *indices: Index) -> tuple[Extreme, ...]:
        """As ``least``, of several indices."""
        return extremes_over_region(
            self.mechanism.geometry, self.mode.signs, self.placed, indices, self.poses, self.spacing
        )

    @computed_once
    def reach(self) -> Extreme:
        """Least workspace margin (m) over the region: negative by the worst shortfall, or by the depth to
        which a line on which a limb is folded enters the region."""
        found = self.least(Index(REACH))
        folds = [fold_clearance(self.placed, line) for line in self.mechanism.fold_lines()]
        pieces = (*found.pieces, *(fold.value for fold in folds))
        nearest = min(folds, key=lambda fold: fold.value, default=None)
        if nearest is None or nearest.value >= found.value:
            return replace(found, pieces=pieces)
        return replace(found, value=nearest.value, pose=nearest.pose, pieces=pieces)

    @computed_once
    def reach_near(self) -> IndicesNear:
        """Reach at the poses of its pieces, for neighbouring designs."""
        return IndicesNear([Index(REACH)], self.reach.piece_poses[None, :, :], self.placed.centre)

    @property
    def reachable(self) -> bool:
        """Whether the whole region is reachable in the mode."""
        return self.reach.value >= 0.0

    @computed_once
    def lattice_determinants(self) -> NDArray[np.float64]:
        """Signed determinants (D, I, J, K) on the lattice, 0 where undefined."""
        margins = self.mechanism.determinants_at(self.poses, self.mode)
        return margins.reshape(len(margins), *self.grid.shape[:3])

    @computed_once
    def lattice_sides(self) -> tuple[float, ...]:
        """The side, ±1, that each determinant mostly keeps on the lattice."""
        values = self.lattice_determinants
        return tuple(kept_sides(values.reshape(len(values), -1)).tolist())

    @computed_once
    def sides(self) -> tuple[Sides, ...]:
        """Every determinant over the region, in the order of the mechanism; none counts for less than
        ``POLE``."""
        signs = self.lattice_sides
        indices = [Index(DETERMINANT, part=part, sign=sign) for part, sign in enumerate(signs)]
        return tuple(
            Sides(
                max(index.sign * found.value, POLE),
                found.error,
                tuple(max(index.sign * piece, POLE) for piece in found.pieces),
                index,
                found,
            )
            for index, found in zip(indices, self.extremes(*indices), strict=True)
        )

    @computed_once
    def sides_near(self) -> IndicesNear:
        """Every determinant at the poses of its pieces, for neighbouring designs."""
        poses = np.array([side.extreme.piece_poses for side in self.sides])
        return IndicesNear([side.index for side in self.sides], poses, self.placed.centre)

    def side_driven_by(self, drive: str) -> Sides:
        """The determinant whose zero takes control from these actuators: W for motors, V for joints."""
        kind = self.mechanism.kind
        return self.sides[kind.determinants.index(kind.guard(drive))]

    @computed_once
    def _survey(self) -> Survey:
        order = max(3, round(SURVEY_RAYS_PER_SAMPLE * self.region_samples))
        return survey(self.mechanism, self.mode, order=order)

    @computed_once
    def _feelers(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return feelers(self.placed, max(3, round(FEELERS_PER_SAMPLE * self.region_samples)))

    def locus_distance(self, part: int) -> LocusDistance:
        """Distance (m) to the locus of one determinant, for a region reachable throughout.

        Feelers from the region see what is near, a survey of the whole mode what is small or far.
        """
        points, normals = self._feelers
        return locus_distance(
            self.mechanism.geometry,
            self.mode.signs,
            self.placed,
            part,
            determinants=self.lattice_determinants,
            grid=self.grid,
            feeler_points=points,
            feeler_normals=normals,
            seen=self._survey,
            spacing=self.spacing,
            limit=2.0 * self.mechanism.reach_radius(),
        )

    def widest(self, indices: Sequence[Index]) -> Span:
        """Of several indices the greatest difference between its extremes over the region."""
        ends = [index._replace(sign=sign) for sign in (1.0, -1.0) for index in indices]
        found = self.extremes(*ends)
        spans = [
            Span(high.value - low.value, high.error + low.error, index, low, high)
            for index, low, high in zip(indices, found[: len(indices)], found[len(indices) :], strict=True)
        ]
        return max(spans, key=lambda span: (span.value, span.error))

    @computed_once
    def size(self) -> Span:
        """Longest side (m) of the bounding box of the joint centres over the region."""
        return self.widest([Index(EXTENT, part=axis) for axis in range(3)])

    def mode_rays(self, margin: float, *, sided: bool) -> tuple[RayField, RayField]:
        """Ray fields of the whole mode at the working order and at a coarser one."""
        order = rays_for(self.volume_rtol)
        orders = order, coarser(order)
        return mode_fields(self.mechanism, self.mode, orders=orders, sided=sided, floor=margin)

    @computed_once
    def aspects(self) -> tuple[RayField, RayField]:
        """Ray fields of the mode's aspects, fine and coarse."""
        return self.mode_rays(0.0, sided=True)

    @computed_once
    def region_aspects(self) -> tuple[RayField, RayField]:
        """Ray fields of the region's parts in each aspect, fine and coarse."""
        order = max(3, (rays_for(self.volume_rtol) + 1) // 3)
        return region_fields(self.mechanism, self.mode, self.placed, orders=(order, order - 1))

    @computed_once
    def moving_aspects(self) -> MovingFields | None:
        """The largest aspect by each of ``aspects``, ready to be moved; None where one found none."""
        fine, coarse = (field.largest() for field in self.aspects)
        if fine is None or coarse is None:
            return None
        return MovingFields(self.mechanism, self.mode, self.aspects, (fine, coarse), 0.0)

    @computed_once
    def moving_region_aspects(self) -> MovingFields | None:
        """``region_aspects``, ready to be moved; None where one of them is empty."""
        fields = self.region_aspects
        if not all(field.volumes.size for field in fields):
            return None
        return MovingFields(self.mechanism, self.mode, fields, (None, None), 0.0, of_region=True)

    @computed_once
    def _moved(self) -> dict[MovingFields, tuple[RayField, RayField]]:
        return {}

    def moved(self, moving: MovingFields) -> tuple[RayField, RayField]:
        """Fields of a design next to this one as this one has them, to first order."""
        if moving not in self._moved:
            self._moved[moving] = moving.near(self.mechanism, self.region)
        return self._moved[moving]

    def aspect_of(self, field: RayField, pose: tuple[float, float, float]) -> int | None:
        """Component of ``field`` that holds ``pose``."""
        return locate(self.mechanism, self.mode, field, pose)

    def aspects_of(self, field: RayField, poses: NDArray[np.float64]) -> NDArray[np.int64]:
        """Components (N,) of ``field`` that hold poses (N, 3), −1 where none does."""
        return located(self.mechanism, self.mode, field, poses)
