"""From where a mechanism is drawn: the direction that hides least, in orthographic projection, z upward."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tpm_design.report.marks import Length, Mark
from tpm_design.report.skeleton import FloatArray, Skeleton, unit

QUADRANTS = (0, 90, 180, 270)
# not along an axis
AZIMUTHS = tuple(range(20, 71, 5))
ELEVATIONS = (16, 20, 25, 30, 35)
# shares of the machine's size
ENOUGH_APART, SAME = 0.09, 0.02
OPEN_ANGLE = 0.5


@dataclass(frozen=True)
class Viewpoint:
    """Rows of the projection: to the right and up on the page, and towards the viewer."""

    page: FloatArray
    toward: FloatArray

    def seen(self, points: FloatArray) -> FloatArray:
        """Points (…, 3) on the page (…, 2), in metres."""
        return np.asarray(points @ self.page.T)


def viewpoint(azimuth: float, elevation: float) -> Viewpoint:
    """From ``azimuth`` (rad, from x towards y) and ``elevation`` above the plane z = 0."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    return Viewpoint(np.array([(-sa, ca, 0.0), (-ca * se, -sa * se, ce)]), np.array([ca * ce, sa * ce, se]))


def best_viewpoint(body: Skeleton, drawn: Sequence[Mark]) -> Viewpoint:
    """The one of a lattice from which joints stand apart, few lines cross, lines of limb 1 are long, faces
    are open, and limb 1 is not behind."""
    sight = _Sight(body, drawn)
    views = [
        viewpoint(np.radians(quadrant + azimuth), np.radians(elevation))
        for quadrant, azimuth, elevation in itertools.product(QUADRANTS, AZIMUTHS, ELEVATIONS)
    ]
    return max(views, key=lambda view: round(sight.legibility(view), 6))


class _Sight:
    """What is to be seen of a machine: ``points``, all that is named; ``lines``, links and rails of all limbs
    (lines, ends, 3); ``pairs``, lines of different limbs; ``chain``, rail and links of limb 1; ``first``, its
    links and lengths; ``normals`` of base, platform and the parallelogram of limb 1."""

    def __init__(self, body: Skeleton, found: Sequence[Mark]) -> None:
        self.body = body
        self.points = _apart(
            np.vstack([np.zeros((1, 3)), body.platform[None], body.bases, body.limbs.reshape(-1, 3)]),
            SAME * body.size,
        )
        lines = [(limb, line) for limb in range(len(body.limbs)) for line in body.lines(limb)]
        self.lines = np.array([line for _, line in lines])
        places = itertools.combinations(range(len(lines)), 2)
        self.pairs = np.array([pair for pair in places if lines[pair[0]][0] != lines[pair[1]][0]])
        self.chain = np.array(body.lines(0))
        lengths = [(mark.start, mark.end) for mark in found if isinstance(mark, Length)]
        self.first = np.array([*itertools.pairwise(body.limbs[0]), *lengths])
        self.normals = [
            normal
            for corners in (body.bases, body.limbs[:, -1])
            if (normal := unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))) is not None
        ]
        rods = body.rods(0)
        if rods is not None and (normal := unit(np.cross(rods[1] - rods[0], body.hinges[0]))) is not None:
            self.normals.append(normal)

    def legibility(self, view: Viewpoint) -> float:
        """The higher, the better."""
        body, size = self.body, self.body.size
        seen = view.seen(self.points) / size
        apart = np.linalg.norm(seen[:, None] - seen[None, :], axis=-1)[np.triu_indices(len(seen), 1)]
        lines = view.seen(self.lines) / size
        off_lines = _clearances(seen, lines)
        off_lines = off_lines[off_lines > 1e-9]
        first = view.seen(self.first)
        shown = np.linalg.norm(first[:, 1] - first[:, 0], axis=1)
        shares = shown / np.linalg.norm(self.first[:, 1] - self.first[:, 0], axis=1)
        in_front = float((body.limbs[0].mean(axis=0) - body.limbs.mean(axis=(0, 1))) @ view.toward) / size
        faces = [abs(float(normal @ view.toward)) for normal in self.normals]
        return (
            -6.0 * _lack(apart, ENOUGH_APART)
            - 6.0 * _lack(off_lines, 0.5 * ENOUGH_APART)
            - 0.15 * _crossings(lines[self.pairs])
            - 0.8 * _lack(_sines(view.seen(self.chain)), OPEN_ANGLE)
            + 0.4 * float(shares.mean())
            + 0.4 * min(0.6, float(shares.min()))
            + 0.5 * min(0.4, *faces, 0.4)
            + 0.4 * in_front
            + 0.1 * float(view.toward[0])
            + 0.05 * float(view.toward[1])
        )


def _apart(points: FloatArray, distance: float) -> FloatArray:
    """The points, each place once."""
    kept: list[FloatArray] = []
    for point in points:
        if all(np.linalg.norm(point - other) > distance for other in kept):
            kept.append(point)
    return np.array(kept)


def _lack(distances: FloatArray, enough: float) -> float:
    """How far distances are from enough, on average and at worst."""
    lacking = np.maximum(0.0, 1.0 - distances / enough)
    return float(lacking.mean() + 0.08 * lacking.max()) if distances.size else 0.0


def _sines(lines: FloatArray) -> FloatArray:
    """Sines of the angles between one line after the other (lines, ends, 2)."""
    along = lines[:, 1] - lines[:, 0]
    along = along / np.maximum(np.linalg.norm(along, axis=1), 1e-30)[:, None]
    return np.asarray(np.abs(along[:-1, 0] * along[1:, 1] - along[:-1, 1] * along[1:, 0]))


def _crossings(pairs: FloatArray) -> int:
    """How many pairs of lines (pairs, 2, ends, 2) cross."""
    a, b, c, d = pairs[:, 0, 0], pairs[:, 0, 1], pairs[:, 1, 0], pairs[:, 1, 1]
    crossed = (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)
    return int(crossed.sum())


def _side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """On which side of the lines from a to b the points c are."""
    along, aside = b - a, c - a
    return np.asarray(along[:, 0] * aside[:, 1] - along[:, 1] * aside[:, 0])


def _clearances(points: FloatArray, lines: FloatArray) -> FloatArray:
    """Distance of every point from every line (points × lines), on the page."""
    start, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    square = np.maximum(np.einsum("lk,lk->l", along, along), 1e-30)
    share = np.einsum("plk,lk->pl", points[:, None] - start, along) / square
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.asarray(np.linalg.norm(points[:, None] - nearest, axis=-1))
