"""Distances to regions, their lattices and their feelers, against closed forms and dense surfaces."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from tpm_design.workspace.region_geometry import PlacedRegion, nearest, place, signed_distance
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Points, Shape, Sphere
from tpm_design.workspace.sampling import feelers, lattice

CENTRE = (0.3, -0.2, 0.5)
SHAPES: dict[str, Shape] = {
    "box": Box((0.4, 0.2, 0.6)),
    "cylinder": Cylinder(0.25, 0.3),
    "sphere": Sphere(0.2),
    "ellipsoid": Ellipsoid((0.4, 0.25, 0.1)),
    "disc": Ellipsoid((0.3, 0.3, 0.1)),
    "points": Points(((0.1, 0.0, 0.2), (-0.2, 0.1, 0.0), (0.0, 0.3, -0.1))),
}
SOLIDS = [name for name in SHAPES if name != "points"]
coordinates = st.one_of(st.just(0.0), st.floats(-0.8, 0.8))


@njit
def _distances(region, points):  # type: ignore[no-untyped-def]
    out = np.empty(len(points))
    for n in range(len(points)):
        out[n] = signed_distance(region, points[n, 0], points[n, 1], points[n, 2])
    return out


@njit
def _feet(region, points):  # type: ignore[no-untyped-def]
    out = np.empty((len(points), 3))
    for n in range(len(points)):
        out[n] = nearest(region, points[n, 0], points[n, 1], points[n, 2])
    return out


def distances(region: PlacedRegion, points: np.ndarray) -> np.ndarray:
    return _distances(region, np.ascontiguousarray(points, dtype=np.float64))


def feet(region: PlacedRegion, points: np.ndarray) -> np.ndarray:
    return _feet(region, np.ascontiguousarray(points, dtype=np.float64))


def inside(shape: Shape, offsets: np.ndarray) -> np.ndarray:
    """By definition, for offsets (N, 3) from the centre."""
    x, y, z = offsets.T
    if isinstance(shape, Box):
        return (np.abs(offsets) <= 0.5 * np.array(shape.size)).all(axis=1)
    if isinstance(shape, Cylinder):
        return (np.hypot(x, y) <= shape.radius) & (np.abs(z) <= 0.5 * shape.height)
    if isinstance(shape, Sphere):
        return np.linalg.norm(offsets, axis=1) <= shape.radius
    assert isinstance(shape, Ellipsoid)
    return ((offsets / np.array(shape.semi_axes)) ** 2).sum(axis=1) <= 1.0


def surface(shape: Shape, count: int) -> np.ndarray:
    """Points all over the surface, from its parametrisation, about the centre."""
    u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count)))
    if isinstance(shape, Box):
        faces = []
        for axis in range(3):
            for sign in (-1.0, 1.0):
                face = np.empty((u.size, 3))
                face[:, axis], face[:, axis - 1], face[:, axis - 2] = sign, 2 * u - 1, 2 * v - 1
                faces.append(face * 0.5 * np.array(shape.size))
        return np.vstack(faces)
    angle = 2 * math.pi * u
    if isinstance(shape, Cylinder):
        r, h = shape.radius, 0.5 * shape.height
        around = np.column_stack([np.cos(angle), np.sin(angle)])
        wall = np.column_stack([r * around, h * (2 * v - 1)])
        lids = [np.column_stack([r * v[:, None] * around, np.full(u.size, sign * h)]) for sign in (-1, 1)]
        return np.vstack([wall, *lids])
    axes = np.full(3, shape.radius) if isinstance(shape, Sphere) else np.array(shape.semi_axes)  # type: ignore[union-attr]
    rise = np.pi * v
    ball = np.column_stack([np.sin(rise) * np.cos(angle), np.sin(rise) * np.sin(angle), np.cos(rise)])
    return np.asarray(axes * ball)


@pytest.mark.parametrize("name", SOLIDS)
def test_distance_to_a_dense_surface(name: str) -> None:
    """Within what the surface's mesh allows; the sign by the definition of the shape."""
    random = np.random.default_rng(1)
    shape, region = SHAPES[name], place(SHAPES[name], CENTRE)
    offsets = random.uniform(-0.7, 0.7, (300, 3))
    offsets[:60, random.integers(0, 3, 60)] = 0.0  # symmetry planes, where feet are not unique
    offsets[:20] = 0.0
    offsets[:20, 0] = np.linspace(-0.6, 0.6, 20)  # along the longest half axis of the ellipsoid
    mesh = surface(shape, 240)
    expected = np.array([np.linalg.norm(mesh - offset, axis=1).min() for offset in offsets])
    found = distances(region, offsets + CENTRE)
    mesh_size = 2 * math.pi * 0.4 / 240
    assert (np.abs(found) <= expected + 1e-12).all()
    # the mesh point nearest to the foot is within the mesh size of it
    assert (expected**2 <= found**2 + 2 * np.abs(found) * mesh_size + mesh_size**2).all()
    assert np.abs(np.abs(found) - expected).mean() < 5e-4
    np.testing.assert_array_equal(found <= 0.0, inside(shape, offsets))


@settings(max_examples=120, deadline=None, derandomize=True)
@given(st.sampled_from(list(SHAPES)), st.tuples(coordinates, coordinates, coordinates))
def test_the_nearest_point(name: str, offset: tuple[float, float, float]) -> None:
    """It belongs to the region, lies at the distance, and is the pose itself inside."""
    region = place(SHAPES[name], CENTRE)
    pose = np.array([offset]) + CENTRE
    distance, foot = distances(region, pose)[0], feet(region, pose)
    assert distances(region, foot)[0] <= 1e-12
    assert np.linalg.norm(foot - pose) == pytest.approx(max(0.0, distance), abs=1e-12)
    if name == "points":
        closest = min(math.dist(pose[0], point) for point in region.points)
        assert distance == pytest.approx(closest, abs=1e-12)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(
    st.sampled_from(SOLIDS),
    st.tuples(coordinates, coordinates, coordinates),
    st.tuples(coordinates, coordinates, coordinates),
)
def test_signed_distances_of_convex_regions(
    name: str, one: tuple[float, ...], two: tuple[float, ...]
) -> None:
    """A convex region's signed distance is convex and changes no faster than the pose."""
    region = place(SHAPES[name], CENTRE)
    a, b = np.array(one) + CENTRE, np.array(two) + CENTRE
    at_a, at_b, between = distances(region, np.array([a, b, 0.5 * (a + b)]))
    assert abs(at_a - at_b) <= np.linalg.norm(a - b) + 1e-12
    assert between <= 0.5 * (at_a + at_b) + 1e-12


def test_distances_in_closed_form() -> None:
    box, ball = place(Box((0.4, 0.2, 0.6)), CENTRE), place(Sphere(0.2), CENTRE)
    tube, egg = place(Cylinder(0.25, 0.3), CENTRE), place(Ellipsoid((1.0, 0.5, 0.2)), (0.0, 0.0, 0.0))
    assert distances(box, np.array([CENTRE])) == pytest.approx([-0.1])
    assert distances(box, np.array([CENTRE]) + np.array([0.5, 0.5, 0.7])) == pytest.approx(
        [math.hypot(0.3, 0.4, 0.4)]
    )
    assert distances(ball, np.array([CENTRE]) + np.array([0.0, 0.3, 0.4])) == pytest.approx([0.3])
    assert distances(tube, np.array([CENTRE]) + np.array([0.33, 0.44, 0.55])) == pytest.approx(
        [math.hypot(0.3, 0.4)]
    )
    assert distances(egg, np.zeros((1, 3))) == pytest.approx([-0.2])
    # deep on the long axis the nearest surface is off the axis: x = 0.3/(1 − 0.04), z = 0.2 √(1 − x²)
    x = 0.3 / 0.96
    assert distances(egg, np.array([[0.3, 0.0, 0.0]])) == pytest.approx(
        [-math.hypot(x - 0.3, 0.2 * math.sqrt(1.0 - x * x))]
    )


@pytest.mark.parametrize("samples", [2, 5, 9, 14])
@pytest.mark.parametrize("name", SOLIDS)
def test_lattice(name: str, samples: int) -> None:
    """In the region, its extreme poses and its centre included, neighbours never farther than the spacing."""
    shape, region = SHAPES[name], place(SHAPES[name], CENTRE)
    grid = lattice(region, samples)
    poses = grid.reshape(-1, 3)
    depth = distances(region, poses)
    assert depth.max() <= 1e-12
    np.testing.assert_allclose(poses.max(axis=0), np.array(CENTRE) + region.half, atol=1e-12)
    np.testing.assert_allclose(poses.min(axis=0), np.array(CENTRE) - region.half, atol=1e-12)
    assert (np.linalg.norm(poses - CENTRE, axis=1) < 1e-12).any()
    # the lattice's outer shell is the surface
    shell = np.ones(grid.shape[:3], bool)
    shell[1:-1, 1:-1, 1:-1] = False
    assert np.abs(depth[shell.ravel()]).max() < 1e-12
    assert all(count % 2 == 1 for count in grid.shape[:3])
    # every surface point has a lattice pose within a cell's diagonal
    gaps = [np.linalg.norm(poses - CENTRE - point, axis=1).min() for point in surface(shape, 15)]
    assert max(gaps) <= 1.8 * max(region.half) * 2.0 / (max(grid.shape[:3]) - 1)


def test_lattice_of_points_is_the_points() -> None:
    region = place(SHAPES["points"], CENTRE)
    expected = np.array(SHAPES["points"].points) + CENTRE  # type: ignore[union-attr]
    np.testing.assert_allclose(lattice(region, 9).reshape(-1, 3), expected, atol=1e-15)


@pytest.mark.parametrize("name", list(SHAPES))
def test_the_way_along_a_feeler_is_the_distance(name: str) -> None:
    region = place(SHAPES[name], CENTRE)
    bases, normals = feelers(region, 5)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(distances(region, bases), 0.0, atol=1e-12)
    # points: up to half way to the next one
    for way in (0.01, 0.05) if name == "points" else (0.01, 0.1, 1.0):
        np.testing.assert_allclose(distances(region, bases + way * normals), way, atol=1e-12)
        np.testing.assert_allclose(feet(region, bases + way * normals), bases, atol=1e-9)


@pytest.mark.parametrize("name", list(SHAPES))
def test_feelers_leave_no_gap(name: str) -> None:
    """Near every pose outside, a feeler passes at the same distance from the region."""
    random = np.random.default_rng(2)
    region = place(SHAPES[name], CENTRE)
    poses = random.uniform(-0.6, 0.6, (400, 3)) + CENTRE
    reach = distances(region, poses)
    poses, reach = poses[reach > 0.0], reach[reach > 0.0]
    bases, normals = feelers(region, 7)
    gaps = [
        np.linalg.norm(bases + d * normals - pose, axis=1).min() for d, pose in zip(reach, poses, strict=True)
    ]
    # half a cell's diagonal on the surface, and as much of the fan of normals
    cell = 2.0 * max(region.half) / 6 if name != "points" else 0.0
    allowed = 0.8 * cell + 0.5 * reach
    assert len(poses) > 200
    assert (np.array(gaps) <= allowed).all()
