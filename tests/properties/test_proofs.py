"""Verdicts: what is proved holds for every machine within tolerance, and what is refuted is broken."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from tpm_design.certificates.verdict import Verdict, verdict
from tpm_design.mechanisms.uru import KIND, build
from tpm_design.metrics import METRICS
from tpm_design.problem import Goal, Problem
from tpm_design.workspace.indices import DETERMINANT, REACH, SERIAL, Index, index_values
from tpm_design.workspace.regions import Box, Points, Shape, Sphere

PARAMETERS = {
    "db": (0.21, 0.19, 0.2),
    "dp": (0.06, 0.05, 0.06),
    "f": (0.26, 0.24, 0.25),
    "r": (0.21, 0.2, 0.22),
    "k": (1.0, 1.5, 1.2),
}
CENTRE = (0.16, 0.155, 0.15)
TOLERANCE = {"db": 1e-3, "dp": 5e-4, "f": 1e-3, "r2": 2e-3, "k": 1e-3}
BALL = Sphere(0.02)


def settled(
    region: Shape | None,
    constraints: Mapping[str, Mapping[str, float]],
    tolerance: Mapping[str, float],
    parameters: Mapping[str, tuple[float, ...]] | None = None,
    **options: str,
) -> Verdict:
    """The verdict on constraints (metric → bounds, SI) of one machine in the mode "+++ +++"."""
    goals = []
    for name, bounds in constraints.items():
        metric = METRICS[name]
        given = {option.name: options.get(option.name, option.default) for option in metric.options}
        goals.append(Goal(metric, name, given, minimum=bounds.get("min"), maximum=bounds.get("max")))
    problem = Problem(
        kind=KIND,
        fixed={},
        variables=(),
        modes={"+": {"octant": "+++", "elbows": "+++"}},
        limits={},
        region=region,
        objectives=(),
        constraints=tuple(goals),
        record=(),
    )
    return verdict(problem, design_of(parameters or PARAMETERS), tolerance, boxes=20_000)


def design_of(parameters: Mapping[str, tuple[float, ...]]) -> dict[str, Any]:
    limbs = {f"{name}{i + 1}": v for name, values in parameters.items() for i, v in enumerate(values)}
    centre = dict(zip(("center_x", "center_y", "center_z"), CENTRE, strict=True))
    return {**limbs, **centre, "mode": "+"}


def test_a_thousand_machines_within_tolerance_break_nothing() -> None:
    found = settled(BALL, {"coverage": {"min": 1.0}, "boundary_distance": {"min": 0.005}}, TOLERANCE)
    assert found.outcome == "proved"
    random = np.random.default_rng(3)
    poses = np.array(CENTRE) + 0.02 * on_ball(200, random)
    signs = found.context.mode.signs
    for _ in range(1000):
        corner = random.random() < 0.5
        parameters = {}
        for name, values in PARAMETERS.items():
            bounds = [TOLERANCE.get(name, TOLERANCE.get(f"{name}{limb + 1}", 0.0)) for limb in range(3)]
            share = random.choice([-1.0, 1.0], 3) if corner else random.uniform(-1.0, 1.0, 3)
            parameters[name] = tuple(np.array(values) + share * bounds * (1.0 - 1e-9))
        geometry = build(parameters, {}).geometry
        for settlement in found.settlements:
            index = settlement.demand.index(KIND)
            margins = np.asarray(index_values(geometry, signs, index, poses))
            assert margins.min() >= settlement.level * (1.0 - 1e-9)


def on_ball(count: int, random: np.random.Generator) -> Any:
    """Points (N, 3) of the unit ball, most of them on its surface."""
    points = random.normal(size=(count, 3))
    return points / np.maximum(1.0, np.linalg.norm(points, axis=1))[:, None]


def test_the_slack_holds_for_every_margin() -> None:
    """Four margins carry one bound: the least of them is what is left."""
    found = settled(BALL, {"singularity_margin_min": {"min": 0.05}}, {})
    requirement = found.requirements[0]
    assert requirement.outcome == "proved" and requirement.slack is not None
    random = np.random.default_rng(4)
    poses = np.array(CENTRE) + 0.02 * on_ball(2000, random)
    geometry, signs = found.context.mechanism.geometry, found.context.mode.signs
    indices = [Index(SERIAL), *(Index(DETERMINANT, part=part) for part in range(3))]
    least = min(np.abs(np.asarray(index_values(geometry, signs, i, poses))).min() for i in indices)
    assert 0.0 < requirement.slack <= least - 0.05


@pytest.mark.parametrize("excess", [1e-6, -1e-3])
def test_a_millionth_too_much_is_not_proved(excess: float) -> None:
    """A ball is nearer to the shells of the legs by its radius than its centre is."""
    margins = []
    for limb, (base, platform, f, r) in enumerate(
        zip(*(PARAMETERS[name] for name in ("db", "dp", "f", "r")), strict=True)
    ):
        joint = [value + (platform - base if axis == limb else 0.0) for axis, value in enumerate(CENTRE)]
        margins += [f + r - math.hypot(*joint), math.hypot(*joint) - abs(f - r)]
    bound = (min(margins) - 0.02) * (1.0 + excess)
    outcome = settled(BALL, {"boundary_distance": {"min": bound}}, {}).outcome
    assert outcome != "proved" if excess > 0.0 else outcome == "proved"


def test_a_breaking_pose_is_in_the_region_and_breaks() -> None:
    found = settled(BALL, {"boundary_distance": {"min": 0.2}}, TOLERANCE)
    breaking = found.requirements[0].breaking
    assert found.outcome == "refuted" and breaking is not None and breaking.pose is not None
    assert math.dist(breaking.pose, CENTRE) <= 0.02 * (1.0 + 1e-12)
    geometry = build(breaking.parameters, {}).geometry
    reach = index_values(geometry, found.context.mode.signs, Index(REACH), np.array([breaking.pose]))
    assert float(reach[0]) < 0.2


def test_a_share_of_the_region_is_not_refuted_by_a_pose() -> None:
    """A corner beyond a coordinate plane leaves a coverage of 0.5 open."""
    region = Box((0.4, 0.04, 0.04))
    whole = settled(region, {"coverage": {"min": 1.0}}, {})
    share = settled(region, {"coverage": {"min": 0.5}}, {})
    assert (whole.outcome, share.outcome) == ("refuted", "undecided")


def test_separate_poses_are_not_proved_to_lie_in_one_aspect() -> None:
    pair = Points(((0.0, 0.0, 0.0), (0.01, 0.0, 0.0)))
    assert settled(pair, {"coverage": {"min": 1.0}}, {}).outcome == "undecided"
    assert settled(Points(((0.0, 0.0, 0.0),)), {"coverage": {"min": 1.0}}, {}).outcome == "proved"


@pytest.mark.parametrize(
    ("name", "bound"),
    [
        ("velocity_max", {"max": -10.0}),
        ("velocity_min", {"min": -10.0}),
        ("transmission_min", {"min": -0.9}),
        ("actuation_singularity_distance", {"min": -0.01}),
        ("coverage", {"min": 1.1}),
    ],
)
def test_bounds_that_no_statement_says_are_left_open(name: str, bound: dict[str, float]) -> None:
    """Statements square their bounds: −10 is not 10."""
    assert settled(BALL, {name: bound}, {}).outcome == "undecided"


@pytest.mark.parametrize("side", ["min", "max"])
def test_a_sum_that_is_met_to_rounding_is_not_refuted(side: str) -> None:
    """Six links of 0.2 m are 1.2000000000000002 m in floats."""
    links = PARAMETERS | {"f": (0.2, 0.2, 0.2), "r": (0.2, 0.2, 0.2)}
    for bound in (1.2, 1.2000000000000002):
        assert settled(None, {"total_link_length": {side: bound}}, {}, links).outcome == "undecided"
    far = {"min": (1.1, 1.3), "max": (1.3, 1.1)}[side]
    outcomes = [settled(None, {"total_link_length": {side: b}}, {}, links).outcome for b in far]
    assert outcomes == ["proved", "refuted"]
