"""Evaluations: slacks on the unfavourable side of the error, reasons, not NaN, finer looks that agree."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.goals import slack_pieces
from tpm_design.evaluation.result import Evaluation
from tpm_design.mechanisms.uru import KIND
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import Measurement
from tpm_design.problem import Accuracy, Goal, Problem
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Shape, Sphere

MODES = {"+++ +++": {"octant": "+++", "elbows": "+++"}, "+++ +-+": {"octant": "+++", "elbows": "+-+"}}
SHAPES: tuple[Shape, ...] = (
    Box((0.15, 0.2, 0.1)),
    Sphere(0.1),
    Cylinder(0.08, 0.2),
    Ellipsoid((0.1, 0.05, 0.08)),
)
finite = st.floats(-10.0, 10.0)
errors = st.floats(0.0, 1.0)


def goal(name: str, *, label: str | None = None, options: dict[str, Any] | None = None, **rest: Any) -> Goal:
    return Goal(METRICS[name], label or name, options or {}, **rest)


def problem(shape: Shape, *constraints: Goal, **rest: Any) -> Problem:
    given_parts: dict[str, Any] = {"objectives": (), "record": (), **rest}
    return Problem(
        kind=KIND,
        fixed={},
        variables=(),
        modes=MODES,
        limits={},
        region=shape,
        constraints=constraints,
        **given_parts,
    )


def design(
    centre: float | tuple[float, float, float] = 0.35, **change: float | str
) -> dict[str, float | str]:
    x, y, z = (centre,) * 3 if isinstance(centre, float) else centre
    parameters: dict[str, float | str] = {"db": 0.1, "dp": 0.06, "f": 0.5, "r": 0.5, "k": 1.0}
    return {**parameters, "mode": "+++ +++", "center_x": x, "center_y": y, "center_z": z, **change}


@settings(max_examples=60, deadline=None, derandomize=True)
@given(finite, errors, finite, finite)
def test_slack_is_on_the_unfavourable_side(value: float, error: float, low: float, high: float) -> None:
    measurement = Measurement(value, error)
    below = slack_pieces(goal("conditioning_min", minimum=low), measurement)
    above = slack_pieces(goal("conditioning_min", maximum=high), measurement)
    between = slack_pieces(goal("conditioning_min", minimum=low, maximum=high), measurement)
    assert below == (value - error - low,)
    assert above == (high - value - error,)
    assert between == (min(*below, *above),)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(finite, min_size=1, max_size=8), errors, finite, st.floats(-1.0, 0.0))
def test_pieces_have_the_slack_of_the_value_as_their_least(
    pieces: list[float], error: float, low: float, depth: float
) -> None:
    """Depth guides where the constraint fails, and never turns a slack's sign."""
    whole = Measurement(min(pieces), error, depth=depth)
    parts = Measurement(min(pieces), error, depth=depth, pieces=tuple(pieces))
    bounded = goal("conditioning_min", minimum=low)
    slack = min(slack_pieces(bounded, whole))
    assert min(slack_pieces(bounded, parts)) == slack
    plain = min(pieces) - error - low
    assert slack == (plain if plain >= 0.0 else plain + depth)
    assert (slack >= 0.0) == (plain >= 0.0)


def test_the_full_score_is_judged_by_its_margin() -> None:
    full = Measurement(1.0, 0.0, full_slacks=(0.02, 0.5))
    missed = Measurement(0.9, 0.01, full_slacks=(-0.3, 0.1))
    assert slack_pieces(goal("coverage", minimum=1.0), full) == (0.02, 0.5)
    assert slack_pieces(goal("coverage", minimum=1.0), missed) == (-0.3, 0.1)
    assert slack_pieces(goal("coverage", minimum=0.8), missed) == (pytest.approx(0.09),)


places = st.tuples(*(st.floats(0.05, 0.9),) * 3)
lengths = st.floats(0.2, 0.8)


def everything() -> tuple[Goal, ...]:
    """Every metric bounded by what it is at best, so that slacks of both signs occur."""
    goals = []
    for metric in METRICS.values():
        if metric.refusal(KIND, {}) is not None:
            continue
        options = {"threshold": 0.3} if metric.name == "conditioning_share" else {}
        bound = {"minimum": 0.1} if metric.better == "maximize" else {"maximum": 1.0}
        goals.append(goal(metric.name, options=options, **bound))
    return tuple(goals)


def bound_is_met(result: Evaluation, asked: Goal) -> bool:
    """By the reported value, on the unfavourable side of its error."""
    value, error = result.metrics[asked.label], result.errors[asked.label]
    low = -math.inf if asked.minimum is None else asked.minimum
    high = math.inf if asked.maximum is None else asked.maximum
    return value - error >= low and value + error <= high


def check(result: Evaluation, asked: Problem) -> None:
    for constraint in asked.constraints:
        slack = result.slacks[constraint.label]
        assert math.isfinite(slack)
        assert slack == min(result.pieces[constraint.label])
        assert (constraint.label in result.reason) == (slack < 0.0)
        assert (slack >= 0.0) == bound_is_met(result, constraint)
    shortfall = sum(max(0.0, -result.slacks[c.label]) / c.metric.scale for c in asked.constraints)
    assert result.violation == pytest.approx(shortfall)
    assert (result.status == "feasible") == (result.violation == 0.0)
    for label, value in result.metrics.items():
        assert math.isfinite(value) or f"{label}: " in result.reason
        assert result.errors[label] >= 0.0


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.sampled_from(SHAPES), places, lengths, lengths, st.sampled_from(sorted(MODES)))
def test_every_metric_of_any_design_is_a_number_or_a_reason(
    shape: Shape, centre: tuple[float, float, float], f: float, r: float, mode: str
) -> None:
    asked = problem(shape, *everything())
    check(evaluate(asked, design(centre, f=f, r=r, mode=mode)), asked)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.sampled_from(SHAPES), places, lengths, lengths)
def test_evaluating_twice_gives_the_same(
    shape: Shape, centre: tuple[float, float, float], f: float, r: float
) -> None:
    asked = problem(shape, *everything())
    one, two = (replace(evaluate(asked, design(centre, f=f, r=r)), seconds=0.0) for _ in range(2))
    assert str(one) == str(two)


def test_an_undefined_objective_makes_a_design_infeasible_for_a_reason() -> None:
    objective = goal("robot_size", sense="minimize")
    result = evaluate(problem(SHAPES[0], objectives=(objective,)), design(3.0))
    assert result.status == "infeasible"
    assert result.violation == 1.0
    assert result.reason == "robot_size: the region is not reachable"
    # recorded figures do not decide
    result = evaluate(problem(SHAPES[0], record=(objective,)), design(3.0))
    assert (result.status, result.violation) == ("feasible", 0.0)


def test_an_impossible_design_fails_with_its_reason() -> None:
    result = evaluate(problem(SHAPES[0], goal("coverage", minimum=1.0)), design(f=-0.5))
    assert result.status == "failed"
    assert "not positive" in result.reason
    assert result.violation == math.inf
    assert not result.metrics


def test_violation_adds_shortfalls_over_their_scales() -> None:
    links = goal("total_link_length", maximum=2.0)
    size = goal("robot_size", maximum=0.5)
    result = evaluate(problem(Sphere(0.1), links, size), design())
    assert result.metrics["total_link_length"] == pytest.approx(3.0)
    missing = result.metrics["robot_size"] + result.errors["robot_size"] - 0.5
    assert result.violation == pytest.approx(1.0 / 0.1 + missing / 0.1)
    assert result.status == "infeasible"
    assert "total_link_length missed" in result.reason


MINIMA = (
    "conditioning_min",
    "singularity_margin_min",
    "boundary_distance",
    "velocity_min",
    "velocity_max",
    "transmission_min",
    "position_sensitivity",
    "actuator_range",
    "robot_size",
)
DISTANCES = tuple(f"{name}_singularity_distance" for name in KIND.determinants)


def covered_designs(shape: Shape, count: int, seed: int) -> list[dict[str, float | str]]:
    """Random designs that cover the region."""
    random = np.random.default_rng(seed)
    asked = problem(shape, record=(goal("coverage"),))
    found: list[dict[str, float | str]] = []
    while len(found) < count:
        f, r = random.uniform(0.35, 0.6, 2)
        x, y, z = random.uniform(0.15, 0.45, 3)
        k = float(random.choice([0.5, 1.0, 2.0]))
        some = design((x, y, z), f=f, r=r, db=random.uniform(0.0, 0.3), k=k)
        if evaluate(asked, some).metrics["coverage"] == 1.0:
            found.append(some)
    return found


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__.lower())
def test_ten_times_the_samples_tell_the_same(shape: Shape) -> None:
    """What an optimum was judged by holds on a finer look, within the errors of both."""
    rough = problem(shape, record=tuple(goal(name) for name in (*MINIMA, "coverage")))
    fine = replace(rough, accuracy=Accuracy(region_samples=91))
    for some in covered_designs(shape, 2, 5):
        one, two = evaluate(rough, some), evaluate(fine, some)
        assert two.metrics["coverage"] == 1.0
        for name in MINIMA:
            allowed = one.errors[name] + two.errors[name] + 1e-9
            assert two.metrics[name] == pytest.approx(one.metrics[name], abs=allowed), name


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__.lower())
def test_finer_searches_find_no_nearer_loci(shape: Shape) -> None:
    """But for thin pieces: none of these hides more than 2 mm."""
    rough = problem(shape, record=tuple(goal(name) for name in DISTANCES))
    fine = replace(rough, accuracy=Accuracy(region_samples=27))
    for some in covered_designs(shape, 6, 6):
        one, two = evaluate(rough, some), evaluate(fine, some)
        for name in DISTANCES:
            if one.notes[f"{name}_locus"] != "none":
                lost = one.metrics[name] - two.metrics[name]
                assert lost <= one.errors[name] + two.errors[name] + 2e-3, name
            else:
                assert two.notes[f"{name}_locus"] == "none"


@settings(max_examples=30, deadline=None, derandomize=True)
@given(places, lengths, st.floats(0.3, 3.0))
def test_metrics_scale_with_the_machine(centre: tuple[float, float, float], f: float, factor: float) -> None:
    """Lengths by λ, volumes by λ³, figures without a length not at all."""
    names = {
        "total_link_length": 1.0,
        "robot_size": 1.0,
        "boundary_distance": 1.0,
        "singularity_free_volume": 3.0,
        "conditioning_min": 0.0,
        "singularity_margin_min": 0.0,
        "velocity_max": 1.0,
        "actuator_range": 0.0,
        "position_sensitivity": 0.0,
        "workspace_ratio": 0.0,
    }
    goals = tuple(goal(name) for name in names)
    small = design(centre, f=f)
    lengths_of = ("db", "dp", "f", "r", "center_x", "center_y", "center_z")
    large = {**small, **{name: factor * float(small[name]) for name in lengths_of}}
    one = evaluate(problem(Sphere(0.1), record=goals), small)
    two = evaluate(problem(Sphere(0.1 * factor), record=goals), large)
    assume(one.metrics["boundary_distance"] > 1e-3)
    for name, power in names.items():
        if math.isnan(one.metrics[name]):
            assert math.isnan(two.metrics[name])
        else:
            expected = one.metrics[name] * factor**power
            assert two.metrics[name] == pytest.approx(expected, rel=1e-6, abs=1e-9), name


def test_a_pole_of_a_determinant_hides_no_other_shortfall() -> None:
    """det W of a 3-URU is unbounded on lines that this cube is about."""
    asked = problem(Box((0.07, 0.07, 0.07)), goal("coverage", minimum=1.0))
    design = {"db": 0.1, "dp": 0.06, "f": 0.10178, "r": 0.13423, "k": 1.0, "mode": "+++ +++"}
    found = evaluate(asked, {**design, "center_x": 0.0, "center_y": 0.01591, "center_z": 0.0})
    assert found.status == "infeasible"
    assert 1.0 < found.violation < 20.0
