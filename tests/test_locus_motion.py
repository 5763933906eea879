"""Slopes of distances to singularity loci: central differences of the distances, and closed forms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tpm_design.mechanisms import mechanism
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import Measurement
from tpm_design.metrics.context import Context
from tpm_design.metrics.neighbourhood import Neighbourhood
from tpm_design.workspace.loci import LocusDistance
from tpm_design.workspace.locus_motion import LocusMotion, locus_motion
from tpm_design.workspace.region_geometry import place, signed_distance_at
from tpm_design.workspace.region_normals import outward_normals
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Points, Shape, Sphere

STEP = 1e-7
CENTRE = ("x", "y", "z")
Values = dict[str, float]

MACHINES: dict[str, dict[str, Any]] = {
    # the ranges of study 01
    "uru": {
        "mode": {"octant": "+++", "elbows": "+++"},
        "shape": Box((0.2, 0.2, 0.2)),
        "free": {"db": (0.0, 0.4), "f": (0.15, 0.6), "r": (0.15, 0.6)},
        "fixed": {"dp": 0.06, "k": 0.5},
        "centre": ((0.1, 0.5), (0.1, 0.5), (0.1, 0.5)),
    },
    "orthoglide": {
        "mode": {"carriages": "+++"},
        "shape": Box((0.15, 0.15, 0.15)),
        "free": {"L": (0.25, 0.6)},
        "fixed": {},
        "centre": ((-0.2, 0.2), (-0.2, 0.2), (-0.2, 0.2)),
    },
    "delta": {
        "mode": {"elbows": "+++"},
        "shape": Cylinder(0.3, 0.15),
        "free": {"w": (0.1, 0.3), "L": (0.2, 0.6), "l": (0.5, 1.3)},
        "fixed": {"u": 0.045},
        "centre": ((-0.1, 0.1), (-0.1, 0.1), (-1.2, -0.3)),
    },
    # one carriage below: with all of them above no locus is within reach
    "linear_delta": {
        "mode": {"carriages": "++-"},
        "shape": Cylinder(0.03, 0.05),
        "free": {"R": (0.15, 0.25), "l": (0.3, 0.7), "rail": (0.8, 1.6)},
        "fixed": {"r": 0.035},
        "centre": ((-0.2, 0.2), (-0.2, 0.2), (-1.2, -0.2)),
    },
}


def context_of(name: str, values: Values) -> Context:
    machine = MACHINES[name]
    lengths = {key: value for key, value in values.items() if key not in CENTRE}
    built = mechanism(name, **machine["fixed"], **lengths)
    x, y, z = (values[key] for key in CENTRE)
    return Context(built, built.mode_of(machine["mode"]), place(machine["shape"], (x, y, z)), 1e-3, 9)


def reachable_values(name: str, random: np.random.Generator) -> Iterator[Values]:
    machine = MACHINES[name]
    ranges = {**machine["free"], **dict(zip(CENTRE, machine["centre"], strict=True))}
    while True:
        values = {key: float(random.uniform(*ends)) for key, ends in ranges.items()}
        if context_of(name, values).reach.value > 1e-3:
            yield values


def measured(context: Context, locus: str) -> Measurement:
    return METRICS[f"{locus}_singularity_distance"].compute(context, {})


def moved(name: str, values: Values, way: Values, t: float) -> Context:
    return context_of(name, {key: value + t * way[key] for key, value in values.items()})


def near(here: Measurement, neighbour: Context) -> float:
    """What a measurement says of one neighbouring design."""
    assert here.near is not None
    (value,) = here.near(Neighbourhood((neighbour,))).values.tolist()
    return float(value)


def slope_of(name: str, values: Values, way: Values, here: Measurement) -> float:
    return (near(here, moved(name, values, way, STEP)) - here.value) / STEP


def central_slope(name: str, values: Values, way: Values, locus: str) -> float | None:
    """By Richardson extrapolation; None where the distance itself is not found smoothly enough."""

    def difference(h: float) -> float:
        ends = [measured(moved(name, values, way, t), locus).value for t in (h, -h)]
        return (ends[0] - ends[1]) / (2.0 * h)

    whole, half = difference(2e-4), difference(1e-4)
    return (4.0 * half - whole) / 3.0 if abs(whole - half) < 1e-3 else None


@pytest.mark.parametrize("name", MACHINES)
def test_slopes_are_those_of_the_distance(name: str) -> None:
    """Along random directions of all lengths and the centre together."""
    random = np.random.default_rng(7)
    designs = reachable_values(name, random)
    asked, found, deviations, on_bounds = 0, 0, [], 0
    for values in (next(designs) for _ in range(14)):
        own = context_of(name, values)
        kind = own.mechanism.kind
        for part, locus in enumerate(kind.determinants):
            here = measured(own, locus)
            if here.notes["locus"] != locus:
                continue
            asked += 1
            if np.isnan(near(here, own)):
                continue
            found += 1
            assert near(here, own) == here.value
            motion = locus_motion(own.mechanism, own.mode, own.placed, part, own.locus_distance(part))
            assert motion is not None
            drawn = random.normal(size=len(values))
            way = dict(zip(values, drawn / np.linalg.norm(drawn), strict=True))
            expected = central_slope(name, values, way, locus)
            if expected is not None:
                deviations.append(abs(slope_of(name, values, way, here) - expected) / max(1.0, abs(expected)))
                on_bounds += motion.held.size > 1
    assert found >= 0.7 * asked
    assert len(deviations) >= 0.6 * found
    assert len(deviations) >= 10
    assert max(deviations) < 1e-2
    assert np.median(deviations) < 1e-4
    # studies of these two often end where the locus meets a bound of reach
    assert on_bounds >= (4 if name in ("uru", "delta") else 0)


def uru_context(shape: Shape, centre: tuple[float, float, float], **change: float) -> Context:
    """A 3-URU whose workspace is the ball of radius 1.6, any octant."""
    lengths = {"db": 0.1, "dp": 0.1, "f": 0.8, "r": 0.8, "k": 0.5} | change
    built = mechanism("uru", **lengths)
    return Context(built, built.mode_of({"octant": "any", "elbows": "+++"}), place(shape, centre), 1e-3, 9)


SHAPES: dict[str, Shape] = {
    "box": Box((0.2, 0.16, 0.18)),
    "cylinder": Cylinder(0.1, 0.15),
    "sphere": Sphere(0.1),
    "ellipsoid": Ellipsoid((0.1, 0.06, 0.08)),
    "points": Points(((0.0, 0.0, 0.0), (-0.1, 0.05, 0.02))),
}


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("name", SHAPES)
def test_distance_to_coordinate_planes_in_closed_form(name: str, axis: int) -> None:
    """det H vanishes in the coordinate planes: the distance goes with one coordinate of the centre alone."""
    centre = [0.4, 0.45, 0.5]
    centre[axis] = 0.25
    x, y, z = centre
    here = measured(uru_context(SHAPES[name], (x, y, z)), "rotation")
    for n, slope in enumerate(float(n == axis) for n in range(3)):
        at = [c + 1e-6 * (n == k) for k, c in enumerate(centre)]
        following = near(here, uru_context(SHAPES[name], (at[0], at[1], at[2])))
        assert following - here.value == pytest.approx(1e-6 * slope, abs=1e-12)
    for length, value in {"db": 0.1, "f": 0.8, "r": 0.8}.items():
        longer = uru_context(SHAPES[name], (x, y, z), **{length: value + 1e-6})
        assert near(here, longer) == pytest.approx(here.value, abs=1e-12)


def test_depth_of_a_plane_that_cuts_a_box() -> None:
    """min(|x|) − half as long as another pair of faces is not nearer; then the depth is half of that edge."""
    box = Box((0.2, 0.3, 0.3))
    here = measured(uru_context(box, (0.04, 0.5, 0.5)), "rotation")
    assert here.value == pytest.approx(-0.06, abs=1e-6)
    following = near(here, uru_context(box, (0.04 + 1e-6, 0.5, 0.5 + 1e-6)))
    assert following - here.value == pytest.approx(1e-6, abs=1e-12)


def own_motion(context: Context, found: LocusDistance) -> LocusMotion | None:
    return locus_motion(context.mechanism, context.mode, context.placed, 2, found)


def test_no_slope_where_the_point_is_not_the_nearest() -> None:
    context = uru_context(Box((0.2, 0.2, 0.2)), (0.25, 0.5, 0.5))
    nearest = context.locus_distance(2)
    assert nearest.pose is not None
    assert own_motion(context, nearest) is not None
    x, y, z = nearest.pose
    for beside in ((x, y + 0.4, z), (x, y - 0.1, z + 0.3)):
        assert own_motion(context, replace(nearest, pose=beside)) is None
    assert own_motion(context, LocusDistance(np.inf, 0.0, None)) is None


def test_out_of_reach_and_without_a_locus_slopes_are_those_of_what_stands_for_the_distance() -> None:
    beyond = uru_context(Sphere(0.1), (0.9, 0.9, 0.9))
    farther = uru_context(Sphere(0.1), (0.9, 0.9, 0.9 + 1e-7))
    here = measured(beyond, "rotation")
    assert near(here, beyond) == pytest.approx(here.value, abs=1e-12)
    change = farther.reach.value - beyond.reach.value
    assert near(here, farther) - near(here, beyond) == pytest.approx(change, abs=1e-12)
    # k = 1, elbows as the octant: det W keeps its sign throughout
    built = mechanism("uru", db=0.1, dp=0.1, f=0.8, r=0.8, k=1.0)
    mode = built.mode_of({"octant": "+++", "elbows": "+++"})
    larger = mechanism("uru", db=0.1001, dp=0.1, f=0.8, r=0.8, k=1.0)
    none_context = Context(built, mode, place(Sphere(0.15), (0.5, 0.45, 0.6)), 1e-3, 9)
    none = measured(none_context, "actuation")
    assert none.notes["locus"] == "none"
    assert near(none, replace(none_context, mechanism=larger)) > none.value


@pytest.mark.parametrize("shape", [*SHAPES.values(), Ellipsoid((0.06, 0.06, 0.1))], ids=str)
def test_normals_lead_from_the_surface(shape: Shape) -> None:
    """As far back along any of them as the signed distance says lies the surface, at kinks too."""
    region = place(shape, (0.3, -0.2, 0.5))
    random = np.random.default_rng(5)
    half = np.array(region.half)
    around = random.uniform(-2.5, 2.5, (60, 3))
    within = random.uniform(-0.55, 0.55, (60, 3))
    # in the planes and on the lines across the axes, and in the middle
    flat = [np.where(random.random(3) < 0.5, 0.0, p) for p in within]
    for offset in [*around, *within, *flat, np.zeros(3)]:
        pose = np.array(region.centre) + offset * half
        distance = signed_distance_at(region, tuple(pose))
        if distance == 0.0:
            continue
        normals = outward_normals(region, tuple(pose))
        assert normals
        for normal in normals:
            assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
            foot = pose - distance * normal
            assert signed_distance_at(region, tuple(foot)) == pytest.approx(0.0, abs=1e-6)


def test_all_nearest_faces_are_told_at_a_kink() -> None:
    middle = (0.0, 0.0, 0.0)
    assert len(outward_normals(place(Box((0.2, 0.2, 0.2)), middle), middle)) == 6
    flat = outward_normals(place(Ellipsoid((0.1, 0.06, 0.08)), middle), (0.02, 0.0, 0.01))
    assert np.allclose(flat[0] * (1.0, -1.0, 1.0), flat[1], atol=1e-12)
    assert outward_normals(place(Points((middle,)), middle), middle) == []
