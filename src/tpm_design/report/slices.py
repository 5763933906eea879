"""Plane slices of the pose space: reach, determinants, conditioning and one aspect on fine grids.

Grids hold multiples of their step, so that the coordinate planes, where octants end, lie on grid lines and
contours there are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import contourpy
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from tpm_design.metrics.context import Context
from tpm_design.report.aspect import ChosenAspect
from tpm_design.workspace.aspects import locate
from tpm_design.workspace.indices import REACH, Index, index_values
from tpm_design.workspace.region_geometry import BOX, CYLINDER, POINTS, PlacedRegion

FloatArray = NDArray[np.float64]

NODES = 400
COARSE_NODES = 120
PADDING = 0.06
SMALLEST_PATCH = 4
ROUND = 181


@dataclass(frozen=True)
class Plane:
    """The pose coordinates ``across`` (to the right) and ``up``; the third, ``normal``, is ``height`` (m)."""

    across: int
    up: int
    normal: int
    height: float

    def poses(self, across: FloatArray, up: FloatArray) -> FloatArray:
        """Poses (U·A, 3) of the grid, rows first."""
        grid = np.empty((up.size, across.size, 3))
        grid[..., self.across] = across
        grid[..., self.up] = up[:, None]
        grid[..., self.normal] = self.height
        return grid.reshape(-1, 3)


def planes_through(pose: Sequence[float]) -> tuple[Plane, Plane, Plane]:
    """xy, xz and yz through a pose (m)."""
    x, y, z = (float(value) for value in pose)
    return Plane(0, 1, 2, z), Plane(0, 2, 1, y), Plane(1, 2, 0, x)


@dataclass(frozen=True)
class Window:
    """The part of the pose space that is drawn: ``low`` and ``high`` (SI) of every coordinate. ``to_scale``:
    all are lengths, drawn to one scale."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    to_scale: bool = True

    def steps(self, nodes: int) -> FloatArray:
        """Steps (3,) of a grid with so many nodes along the longest side, or along each."""
        sides = np.asarray(self.high) - np.asarray(self.low)
        return np.asarray(np.where(self.to_scale, sides.max(), sides) / nodes)

    def nodes(self, coordinate: int, step: float) -> FloatArray:
        """Multiples of ``step`` that cover one coordinate."""
        first = np.floor(self.low[coordinate] / step)
        last = np.ceil(self.high[coordinate] / step)
        return np.asarray(step * np.arange(first, last + 1))


def window(context: Context, planes: Sequence[Plane]) -> Window:
    """What holds the reachable poses of the planes and the region, with some room around."""
    half = np.asarray(context.mechanism.reach_half_axes())
    whole = Window(_triple(-half), _triple(half), context.mechanism.kind.translational)
    step = whole.steps(COARSE_NODES)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for plane in planes:
        poses = plane.poses(*(whole.nodes(side, step[side]) for side in (plane.across, plane.up)))
        inside = poses[reach_margins(context, poses) >= 0.0]
        for coordinate in (plane.across, plane.up):
            if inside.size:
                low[coordinate] = min(low[coordinate], inside[:, coordinate].min() - step[coordinate])
                high[coordinate] = max(high[coordinate], inside[:, coordinate].max() + step[coordinate])
    if context.region is not None:
        box_low, box_high = region_box(context.region)
        low, high = np.minimum(low, box_low), np.maximum(high, box_high)
    low, high = np.where(low <= high, low, -half), np.where(low <= high, high, half)
    room = PADDING * ((high - low).max() if whole.to_scale else high - low)
    return Window(_triple(low - room), _triple(high + room), whole.to_scale)


def reach_margins(context: Context, poses: FloatArray) -> FloatArray:
    """Metres (N,), ≥ 0 within reach of the mode and, other than ``Mechanism.margins``, without a jump at the
    octant's planes; 0 where undefined."""
    values = index_values(context.mechanism.geometry, context.mode.signs, Index(REACH), poses)
    return np.asarray(np.where(np.isfinite(values), values, 0.0))


@dataclass(frozen=True)
class Slice:
    """Fields (U, A) on a plane's grid (``across`` (A,) and ``up`` (U,) in metres).

    ``reach``: metres, ≥ 0 within reach of the mode. ``determinants`` (D, U, A): signed, NaN out of reach.
    ``conditioning``: 1/κ, 0 where undefined. ``aspect``: ≥ 0 in the chosen aspect.
    """

    plane: Plane
    across: FloatArray
    up: FloatArray
    reach: FloatArray
    determinants: FloatArray
    conditioning: FloatArray
    aspect: FloatArray

    @property
    def longest(self) -> float:
        """Longer side of the plane's window (m)."""
        return float(max(np.ptp(self.across), np.ptp(self.up)))

    def reach_outline(self) -> list[FloatArray]:
        """The edge of reach: polylines (K, 2) in metres."""
        return zero_lines(self.across, self.up, self.reach)

    def determinant_lines(self, part: int) -> list[FloatArray]:
        """Where one determinant vanishes within reach: polylines (K, 2) in metres."""
        return zero_lines(self.across, self.up, self.determinants[part])

    @property
    def reachable(self) -> bool:
        """Whether any pose of the plane is within reach."""
        return bool((self.reach >= 0.0).any())

    def vanishing(self, part: int) -> bool:
        """Whether a determinant vanishes all over the reachable part of the plane."""
        values = self.determinants[part][np.isfinite(self.determinants[part])]
        return bool(values.size) and not values.any()


def slice_fields(
    context: Context,
    plane: Plane,
    extent: Window,
    aspect: ChosenAspect | None,
    index: Index,
    nodes: int = NODES,
) -> Slice:
    """The fields on one plane. ``index``: the conditioning that is shown."""
    step = extent.steps(nodes)
    across, up = (extent.nodes(side, step[side]) for side in (plane.across, plane.up))
    poses = plane.poses(across, up)
    shape = (up.size, across.size)
    mechanism, mode = context.mechanism, context.mode
    reach = reach_margins(context, poses)
    everywhere = mechanism.determinants_at(poses, mode)
    conditioning = index_values(mechanism.geometry, mode.signs, index, poses)
    return Slice(
        plane=plane,
        across=across,
        up=up,
        reach=reach.reshape(shape),
        determinants=np.where(reach >= 0.0, everywhere, np.nan).reshape(-1, *shape),
        conditioning=np.where(np.isfinite(conditioning), conditioning, 0.0).reshape(shape),
        aspect=_aspect_field(context, aspect, poses, reach, everywhere, shape),
    )


def _aspect_field(
    context: Context,
    aspect: ChosenAspect | None,
    poses: FloatArray,
    reach: FloatArray,
    determinants: FloatArray,
    shape: tuple[int, int],
) -> FloatArray:
    """≥ 0 in the aspect. Patches of the right signs are kept if they belong to it in space."""
    if aspect is None:
        return np.full(shape, -1.0)
    signed = np.asarray(aspect.signs)[:, None] * determinants
    values = np.minimum(reach / context.mechanism.reach_radius(), signed.min(axis=0, initial=1.0))
    field = values.reshape(shape)
    labels, count = ndimage.label(field > 0.0)
    for label in range(1, count + 1):
        patch = labels == label
        inside = np.flatnonzero(patch.ravel())
        pose = poses[inside[np.argmax(values[inside])]]
        if inside.size < SMALLEST_PATCH or not _belongs(context, aspect, pose):
            field[patch] *= -1.0
    return np.asarray(field)


def _belongs(context: Context, aspect: ChosenAspect, pose: FloatArray) -> bool:
    at = (float(pose[0]), float(pose[1]), float(pose[2]))
    return locate(context.mechanism, context.mode, aspect.field, at) == aspect.component


def zero_lines(across: FloatArray, up: FloatArray, values: FloatArray) -> list[FloatArray]:
    """Polylines (K, 2) where ``values`` (U, A) are zero, NaN cells left out."""
    finite = values[np.isfinite(values)]
    if not finite.size or not finite.any():
        return []
    # an edge where values fall to zero is a line only as seen from the positive side
    turned = -values if finite.max() <= 0.0 else values
    generator = contourpy.contour_generator(across, up, np.ma.masked_invalid(turned), corner_mask=True)
    lines = [np.asarray(line, dtype=np.float64) for line in generator.lines(0.0)]
    return [line for line in lines if len(line) > 1 and np.ptp(line, axis=0).any()]


def region_box(region: PlacedRegion) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest coordinates (3,) of a region (m)."""
    if region.form == POINTS:
        return region.points.min(axis=0), region.points.max(axis=0)
    centre, half = np.asarray(region.centre), np.asarray(region.half)
    return centre - half, centre + half


def region_middle(region: PlacedRegion) -> FloatArray:
    """Middle (3,) of the region's bounding box (m): its centre, except for points."""
    low, high = region_box(region)
    return np.asarray(0.5 * (low + high))


def region_outline(region: PlacedRegion, plane: Plane) -> FloatArray:
    """Closed outline (K, 2) in metres of a solid region in a plane through its centre; the projections of
    points (K, 2)."""
    axes = [plane.across, plane.up]
    if region.form == POINTS:
        return region.points[:, axes]
    centre, half = np.asarray(region.centre)[axes], np.asarray(region.half)[axes]
    if region.form == BOX or (region.form == CYLINDER and plane.normal != 2):
        corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)])
        return np.asarray(centre + half * corners)
    turn = np.linspace(0.0, 2.0 * np.pi, ROUND)
    return np.asarray(centre + half * np.column_stack([np.cos(turn), np.sin(turn)]))


def _triple(values: FloatArray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
