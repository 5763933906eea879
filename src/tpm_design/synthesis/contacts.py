"""Where a body comes nearest to each bound of the free set, or beyond it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tpm_design.synthesis.body_forms import BodyForm
from tpm_design.synthesis.free_set import FreeSet
from tpm_design.workspace.extremes import extremes_over_region
from tpm_design.workspace.region_geometry import nearest_pose
from tpm_design.workspace.sampling import lattice

FloatArray = NDArray[np.float64]

# of each bound, the nearest ones
MOST_SLOPED, MOST_BARE = 24, 6
# of the body's size: what is deeper inside touches nothing soon
DEEP = 0.3
# rows of a Jacobian closer than this are one contact
ALIKE, ALIKE_WALLS = 1e-4, 1e-7
# of the unit body, from its surface: what is deeper lies inside
INSIDE = 1e-6
BISECTIONS = 50
# of the reach, in metres, for determinants too: gains of a polish that are rounding
FLAT = 1e-13


@dataclass(frozen=True, eq=False)
class Walls:
    """Planes ``normals`` (W, 3) · x ≤ ``offsets`` (W,), in front of parts of a bound that lie in a body."""

    normals: FloatArray
    offsets: FloatArray

    def joined(self, other: Walls) -> Walls:
        return Walls(np.vstack([self.normals, other.normals]), np.append(self.offsets, other.offsets))

    def rooms(self, form: BodyForm, centre: FloatArray, sizes: FloatArray) -> FloatArray:
        """What the body keeps from each (m), negative where the plane cuts it."""
        return np.asarray(self.offsets - self.normals @ centre - form.extents(self.normals, sizes))


NO_WALLS = Walls(np.zeros((0, 3)), np.zeros(0))


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of a body. ``unit`` (K, 3): its point, of the unit body; ``bound`` (K,): number of the margin;
    ``distance`` (K,): metres to the bound, to first order, negative beyond it; ``normal`` (K, 3): outward,
    ``steepness`` (K,): of the margin. ``walls``: instead of contacts with what lies inside the body."""

    unit: FloatArray
    bound: NDArray[np.int64]
    distance: FloatArray
    normal: FloatArray
    steepness: FloatArray
    walls: Walls = NO_WALLS

    def joined(self, other: Contacts) -> Contacts:
        return Contacts(
            np.vstack([self.unit, other.unit]),
            np.append(self.bound, other.bound),
            np.append(self.distance, other.distance),
            np.vstack([self.normal, other.normal]),
            np.append(self.steepness, other.steepness),
            self.walls.joined(other.walls),
        )

    def chosen(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Contacts:
        return Contacts(
            self.unit[which],
            self.bound[which],
            self.distance[which],
            self.normal[which],
            self.steepness[which],
            self.walls,
        )

    def distinct(self) -> Contacts:
        """One of each kind: contacts with equal normals and equal leverage on the sizes move as one."""
        rows = np.column_stack([self.bound, self.normal, self.unit * self.normal, self.distance])
        order = np.argsort(self.distance, kind="stable")
        _, first = np.unique(np.round(rows[order] / ALIKE), axis=0, return_index=True)
        planes = np.column_stack([self.walls.normals, self.walls.offsets])
        _, one = np.unique(np.round(planes / ALIKE_WALLS), axis=0, return_index=True)
        walls = Walls(self.walls.normals[one], self.walls.offsets[one])
        return replace(self.chosen(order[np.sort(first)]), walls=walls)


def seen_from(
    form: BodyForm, free: FreeSet, centre: FloatArray, sizes: FloatArray, others: Contacts
) -> Contacts:
    """The contacts of another body for this one: the same points of the unit body, the same walls."""
    here = contacts_at(form, free, centre, sizes, others.unit, others.bound)
    return replace(here, walls=others.walls)


def contacts_at(
    form: BodyForm,
    free: FreeSet,
    centre: FloatArray,
    sizes: FloatArray,
    unit: FloatArray,
    bound: NDArray[np.int64],
) -> Contacts:
    """Contacts at points ``unit`` (K, 3) of the unit body with bounds (K,), where these have slopes."""
    poses = centre + form.half(sizes) * unit
    values, slopes = free.slopes(poses)
    pick = np.arange(len(bound))
    values, slopes = values[bound, pick], slopes[bound, pick]
    steepness = np.linalg.norm(slopes, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = Contacts(unit, bound, values / steepness, -slopes / steepness[:, None], steepness)
    usable = np.isfinite(found.distance) & np.isfinite(found.normal).all(axis=1)
    return found.chosen(usable)


def contacts(
    form: BodyForm, free: FreeSet, centre: FloatArray, sizes: FloatArray, *, aside: float, samples: int
) -> Contacts:
    """The local minima of every margin over the body: of a lattice with ``samples`` poses along the longest
    side, polished; and points beside them, a share ``aside`` of the half sizes away, since several bounds may
    meet there."""
    region, half = form.region(centre, sizes), form.half(sizes)
    grid = lattice(region, samples)
    poses = np.ascontiguousarray(grid.reshape(-1, 3))
    margins = free.margins(poses)
    spacing = 2.0 * float(half.max()) / (samples - 1)
    units, bounds = [], []
    for number, index in enumerate(free.indices):
        lowest = _local_minima(margins[number].reshape(grid.shape[:3]))
        lowest = lowest[np.argsort(margins[number][lowest], kind="stable")]
        lowest = lowest[_unlike(form, free, centre, sizes, (poses[lowest] - centre) / half, number)]
        for n in lowest:
            (found,) = extremes_over_region(
                free.mechanism.geometry, free.mode.signs, region, [index], poses[n : n + 1], spacing
            )
            # along a bound that is flat a polish leads anywhere
            gained = margins[number, n] - float(free.margins(np.array([found.pose]))[number, 0])
            pose = np.asarray(found.pose) if gained > FLAT * free.length else poses[n]
            units.append((pose - centre) / half)
            bounds.append(number)
    unit, bound = np.array(units).reshape(-1, 3), np.array(bounds, dtype=np.int64)
    enclosed, walls = _walls(form, free, centre, sizes, unit, bound)
    unit, bound = unit[~enclosed], bound[~enclosed]
    unit, bound = _with_points_beside(form, free, centre, sizes, unit, bound, aside)
    every = contacts_at(form, free, centre, sizes, unit, bound)
    near = every.chosen(every.distance <= DEEP * float(half.max()))
    return replace(near, walls=walls).distinct()


def _with_points_beside(
    form: BodyForm,
    free: FreeSet,
    centre: FloatArray,
    sizes: FloatArray,
    unit: FloatArray,
    bound: NDArray[np.int64],
    aside: float,
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Points of the unit body, and others beside each along the axes; where no slope shows that bounds meet,
    between the axes too, since in a corner of a box three faces may each be on a bound of their own."""
    region, half = form.region(centre, sizes), form.half(sizes)
    slopes = free.slopes(centre + half * unit)[1][bound, np.arange(len(bound))]
    bare = ~np.isfinite(slopes).all(axis=1)
    ways = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], dtype=np.float64)
    few, more = (ways[np.abs(ways).sum(axis=1) <= count] for count in (1, 2))
    around = [(unit[some][:, None] + aside * to).reshape(-1, 3) for some, to in ((~bare, few), (bare, more))]
    bounds = [np.repeat(bound[some], len(to)) for some, to in ((~bare, few), (bare, more))]
    poses = centre + half * np.vstack(around)
    inside = np.array([nearest_pose(region, (x, y, z)) for x, y, z in poses.tolist()]).reshape(-1, 3)
    return (inside - centre) / half, np.concatenate(bounds)


def _walls(
    form: BodyForm,
    free: FreeSet,
    centre: FloatArray,
    sizes: FloatArray,
    unit: FloatArray,
    bound: NDArray[np.int64],
) -> tuple[NDArray[np.bool_], Walls]:
    """Which minima lie inside the body and beyond their bound, and the walls in front of them: there a bound
    may be met from both sides, as where a determinant touches 0 without a change of sign, and has no slope
    at the minimum itself."""
    poses, pick = centre + form.half(sizes) * unit, np.arange(len(bound))
    depth = form.gauge(poses - centre, sizes)
    enclosed = (free.margins(poses)[bound, pick] < 0.0) & (depth < 1.0 - INSIDE)
    if not enclosed.any() or not free.holds(centre):
        return np.zeros(len(bound), dtype=np.bool_), NO_WALLS
    ways, bounds, row = poses[enclosed] - centre, bound[enclosed], np.arange(int(enclosed.sum()))
    low, high = np.zeros(row.size), np.ones(row.size)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        inside = free.margins(centre + middle[:, None] * ways)[bounds, row] >= 0.0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    there = centre + low[:, None] * ways
    slopes = free.slopes(there)[1][bounds, row]
    steepness = np.linalg.norm(slopes, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        normals = -slopes / steepness
    # without a slope, and where it points back: across the way there
    lost = ~np.isfinite(normals).all(axis=1) | (np.einsum("wj,wj->w", normals, ways) <= 0.0)
    normals[lost] = (ways / np.linalg.norm(ways, axis=1, keepdims=True))[lost]
    return enclosed, Walls(normals, np.einsum("wj,wj->w", normals, there))


def _unlike(
    form: BodyForm, free: FreeSet, centre: FloatArray, sizes: FloatArray, unit: FloatArray, bound: int
) -> NDArray[np.int64]:
    """Numbers of the points, given in order of their margins, that are worth a polish: not deep, and no two
    alike; and some of those without a slope."""
    poses = centre + form.half(sizes) * unit
    values, slopes = (of_all[bound] for of_all in free.slopes(poses))
    steepness = np.linalg.norm(slopes, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        normals, distance = slopes / steepness, values[:, None] / steepness
    rows = np.column_stack([normals, unit * normals, distance / float(form.half(sizes).max())])
    sloped = np.isfinite(rows).all(axis=1)
    _, first = np.unique(np.round(rows[sloped] / ALIKE), axis=0, return_index=True)
    unlike = np.flatnonzero(sloped)[np.sort(first)]
    bare = np.flatnonzero(~sloped)
    # of a whole edge along which two bounds meet, the lowest and some all along it
    spread = bare[np.linspace(0, bare.size - 1, min(bare.size, MOST_BARE)).astype(np.int64)]
    bare = np.unique(np.append(bare[:MOST_BARE], spread))
    return np.append(unlike[rows[unlike, -1] <= DEEP][:MOST_SLOPED], bare)


def _local_minima(values: FloatArray) -> NDArray[np.int64]:
    """Flat indices of lattice values that no neighbour is below."""
    padded = np.pad(values, 1, constant_values=math.inf)
    lowest = np.ones(values.shape, dtype=np.bool_)
    inner = tuple(slice(1, -1) for _ in range(3))
    for axis in range(3):
        for step in (-1, 1):
            lowest &= values <= np.roll(padded, step, axis)[inner]
    return np.flatnonzero(lowest)
