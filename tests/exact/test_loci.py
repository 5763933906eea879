"""Distances to singularity loci against closed forms, constrained optimisation and dense grids."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from designs import SHAPES, reachable_context, shape_of
from numba import njit
from scipy.optimize import minimize

from tpm_design.mechanisms import mechanism
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import Measurement
from tpm_design.metrics.context import Context
from tpm_design.workspace.region_geometry import PlacedRegion, place, signed_distance
from tpm_design.workspace.regions import Points, Shape

BALL = {"db": 0.1, "dp": 0.1, "f": 0.8, "r": 0.8, "k": 0.5}  # reaches the ball of radius 1.6


@njit
def _distances(region, points):  # type: ignore[no-untyped-def]
    out = np.empty(len(points))
    for n in range(len(points)):
        out[n] = signed_distance(region, points[n, 0], points[n, 1], points[n, 2])
    return out


def distances(region: PlacedRegion, points: np.ndarray) -> np.ndarray:
    return _distances(region, np.ascontiguousarray(points))


def measured(context: Context, name: str) -> Measurement:
    return METRICS[f"{name}_singularity_distance"].compute(context, {})


def ball_context(
    shape: Shape, centre: tuple[float, float, float], octant: str = "+++", **change: float
) -> Context:
    built = mechanism("uru", **(BALL | change))
    return Context(built, built.mode_of({"octant": octant, "elbows": "+++"}), place(shape, centre), 1e-3, 9)


def crossings(context: Context, part: int, grid: np.ndarray) -> np.ndarray:
    """Poses where a determinant changes sign between grid neighbours (I, J, K, 3) of the workspace."""
    built, mode = context.mechanism, context.mode
    shape = grid.shape[:3]
    reach = built.margins(grid.reshape(-1, 3), mode)["reach"].reshape(shape)
    values = built.determinants(grid.reshape(-1, 3), mode)[part].reshape(shape)
    found = [np.empty((0, 3))]
    for axis in range(3):
        a, b = (slice(None),) * axis + (slice(0, -1),), (slice(None),) * axis + (slice(1, None),)
        changed = ((values[a] > 0.0) != (values[b] > 0.0)) & (reach[a] >= 0.0) & (reach[b] >= 0.0)
        share = (values[a][changed] / (values[a][changed] - values[b][changed]))[:, None]
        found.append(grid[a][changed] + share * (grid[b][changed] - grid[a][changed]))
    return np.vstack(found)


def octant_grid(context: Context, count: int) -> np.ndarray:
    """Crowded towards the coordinate planes, which are included but for the axes."""
    line = context.mechanism.reach_radius() * np.linspace(1e-4, 1.0, count) ** 1.5
    signs = context.mode.signs.octant
    return np.stack(np.meshgrid(*(sign * line for sign in signs), indexing="ij"), axis=-1)


def optimised_distance(context: Context, part: int) -> float:
    """Sequential quadratic programming from the eight nearest sign changes of a grid that lie apart."""
    built, mode, region = context.mechanism, context.mode, context.placed
    starts = crossings(context, part, octant_grid(context, 44))
    order = np.argsort(distances(region, starts)) if len(starts) else []
    chosen: list[np.ndarray] = []
    for n in order:
        if len(chosen) < 8 and all(np.linalg.norm(starts[n] - other) > 0.06 for other in chosen):
            chosen.append(starts[n])

    def distance(q: np.ndarray) -> float:
        return float(distances(region, q[None])[0])

    def determinant(q: np.ndarray) -> float:
        return float(built.determinants(q[None], mode)[part][0])

    def reach(q: np.ndarray) -> float:
        return float(built.margins(q[None], mode)["reach"][0])

    best = np.inf
    for start in chosen:
        q = minimize(
            lambda q: 10.0 * max(0.0, distance(q)) ** 2,
            start,
            method="SLSQP",
            constraints=[{"type": "eq", "fun": determinant}, {"type": "ineq", "fun": reach}],
            options={"maxiter": 100, "ftol": 1e-14},
        ).x
        if np.isfinite(q).all() and abs(determinant(q)) < 1e-8 and reach(q) >= -1e-9:
            best = min(best, distance(q))
    return best


@pytest.mark.parametrize("octant", ["+++", "-+-", "--+"])
@pytest.mark.parametrize("name", SHAPES)
def test_rotation_locus_in_closed_form(name: str, octant: str) -> None:
    """The coordinate planes, all of whose feet are within reach: the region's least coordinate."""
    random = np.random.default_rng(1)
    signs = np.array([1.0 if sign == "+" else -1.0 for sign in octant])
    for _ in range(4):
        shape = shape_of(name, random.uniform(0.03, 0.12))
        centre = random.uniform(0.2, 0.6, 3)
        x, y, z = signs * centre
        context = ball_context(shape, (x, y, z), octant)
        found = measured(context, "rotation")
        assert found.value == pytest.approx((centre - context.placed.half).min(), abs=found.error + 1e-9)
        assert found.error < 1e-5
        assert found.notes["locus"] == "rotation"


def test_rotation_locus_of_points() -> None:
    offsets = ((0.0, 0.0, 0.0), (0.1, -0.2, 0.05), (-0.1, 0.1, 0.2))
    context = ball_context(Points(offsets), (0.5, 0.45, 0.4))
    assert measured(context, "rotation").value == pytest.approx(0.25, abs=1e-6)


@pytest.mark.parametrize("name", SHAPES)
def test_a_plane_that_cuts_the_region(name: str) -> None:
    """Any octant allowed: minus the deepest distance of the plane x = 0 below the surface."""
    for across in (0.09, 0.02, -0.05):
        context = ball_context(shape_of(name, 0.1), (across, 0.4, 0.5), "any")
        plane = np.stack(np.meshgrid([0.0], np.linspace(0.2, 0.6, 201), np.linspace(0.3, 0.7, 201)), axis=-1)
        deepest = distances(context.placed, plane.reshape(-1, 3)).min()
        found = measured(context, "rotation")
        assert deepest < 0.0
        assert found.value == pytest.approx(deepest, abs=1e-4)


@pytest.mark.parametrize("name", SHAPES)
def test_distances_against_constrained_optimisation(name: str) -> None:
    """Never farther than a multistart search finds, and never nearer than a pose of the locus."""
    random = np.random.default_rng(31)
    compared = 0
    for _ in range(3):
        context = reachable_context(random, name, octant=str(random.choice(["+++", "+-+", "---"])))
        for part in (0, 1):
            found = context.locus_distance(part)
            if found.pose is not None:
                pose = np.array([found.pose])
                assert distances(context.placed, pose)[0] == pytest.approx(found.value, abs=1e-9)
                assert abs(context.mechanism.determinants(pose, context.mode)[part][0]) < 1e-8
                assert context.mechanism.margins(pose, context.mode)["reach"][0] >= -2e-9
            if found.value > 0.0:
                other = optimised_distance(context, part)
                assert found.value <= other + found.error + 1e-6
                compared += np.isfinite(other)
    assert compared >= 3


@pytest.mark.parametrize(("name", "seed"), list(itertools.product(SHAPES, range(3))))
def test_penetration_depth(name: str, seed: int) -> None:
    """A locus that cuts the region: a 90³ grid of the region's box bounds the depth."""
    random = np.random.default_rng(100 + seed)
    while True:
        context = reachable_context(random, name)
        cut = [part for part in (0, 1) if context.sides[part].margin < -0.03]
        if cut:
            break
    part = cut[0]
    found = context.locus_distance(part)
    low, high = (np.array(context.placed.centre) + s * np.array(context.placed.half) for s in (-1.0, 1.0))
    lines = [np.linspace(a, b, 90) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    deepest = distances(context.placed, crossings(context, part, grid)).min()
    cell = float((high - low).max()) / 89
    assert found.value <= deepest + 1e-3 * cell + found.error
    assert found.value >= deepest - cell


def test_unreachable_regions_tell_the_shortfall() -> None:
    """A ball of radius s beyond the reach R about the origin."""
    context = ball_context(shape_of("sphere", 0.1), (0.9, 0.9, 0.9))
    shortfall = 0.9 * np.sqrt(3.0) + 0.1 - 1.6
    for name in ("translation", "actuation", "rotation"):
        found = measured(context, name)
        assert found.value == pytest.approx(-shortfall, abs=1e-9)
        assert found.notes["locus"] == "out of reach"


def test_no_locus_gives_the_cap() -> None:
    """k = 1, elbows as the octant: det W keeps its sign throughout."""
    context = ball_context(shape_of("sphere", 0.15), (0.5, 0.45, 0.6), k=1.0)
    found = measured(context, "actuation")
    assert found.notes["locus"] == "none"
    assert found.value == METRICS["robot_size"].compute(context, {"over": "region"}).value
    assert not len(crossings(context, 1, octant_grid(context, 80)))


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("part", [0, 1])
def test_distances_change_no_faster_than_the_region_moves(name: str, part: int) -> None:
    """Through contact and into the region: a distance to a fixed set is 1-Lipschitz in a translation."""
    random = np.random.default_rng(41 + part)
    passed = 0
    while passed < 2:
        context = reachable_context(random, name)
        start = context.locus_distance(part)
        if not 0.0 < start.value < 0.15 or start.pose is None:
            continue
        way = np.array(start.pose) - context.placed.centre
        shape = shape_of(name, context.placed.half[0])
        values = []
        for t in np.linspace(0.0, 1.0, 41):
            x, y, z = np.array(context.placed.centre) + t * way
            moved = Context(context.mechanism, context.mode, place(shape, (x, y, z)), 1e-3, 9)
            if not moved.reachable:
                break
            values.append(moved.locus_distance(part))
        if len(values) < 3 or values[-1].value > 0.0:
            continue
        passed += 1
        step = float(np.linalg.norm(way)) / 40
        for before, after in itertools.pairwise(values):
            assert abs(after.value - before.value) <= step + before.error + after.error
        assert values[0].value > 0.0 > values[-1].value
