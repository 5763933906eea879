"""What every registered metric must do with every mechanism, without naming any."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from tpm_design.evaluation.contexts import design_context
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.result import Evaluation
from tpm_design.evaluation.slopes import Neighbour
from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import UNDEFINED, Metric
from tpm_design.problem import Design, Goal, Problem
from tpm_design.units import Units, unit_for
from tpm_design.workspace.regions import Box, Tilt

FAR = 10.0


def goal_of(metric: Metric, kind: MechanismKind) -> Goal:
    options: dict[str, Any] = {
        option.name: 0.5 * (option.minimum + option.maximum) for option in metric.options if option.required
    }
    if metric.option("distance"):
        options["distance"] = float(good_centre(kind.name)[2])
    if metric.option("drive"):
        options["drive"] = metric.drives(kind)[0]
    return Goal(metric, metric.name, options)


def meaningful(kind: MechanismKind) -> list[Metric]:
    return [metric for metric in METRICS.values() if metric.refusal(kind, limits_of(kind)) is None]


def limits_of(kind: MechanismKind) -> dict[str, Any]:
    """The limits without which metrics are refused."""
    radius = kind.build(kind.example, {}).reach_radius()
    return {limit.name: 0.2 * radius for limit in kind.limits if limit.name == "characteristic_length"}


def problem_of(kind: MechanismKind, *goals: Goal, constraints: tuple[Goal, ...] = ()) -> Problem:
    modes = {"+": {field.name: "+" * field.length for field in kind.mode_fields}}
    edge = 0.06 * kind.build(kind.example, {}).reach_radius()
    region = Box((edge, edge, edge)) if kind.translational else Tilt(0.2, edge)
    return Problem(kind, {}, (), modes, limits_of(kind), region, (), constraints, goals)


@cache
def good_centre(kind_name: str) -> np.ndarray:
    """Coordinates of a pose of the example well within reach and far from singularities, upright where
    platforms tilt, seeded."""
    kind = MECHANISMS[kind_name]
    machine = kind.build(kind.example, {})
    mode = machine.mode_of({field.name: "+" * field.length for field in kind.mode_fields})
    radius = machine.reach_radius()
    poses = np.random.default_rng(3).uniform(-radius, radius, (20000, 3))
    poses[:, [unit != "m" for unit in kind.pose_units]] = 0.0
    margins = machine.margins_at(poses, mode)
    scores = [margins["reach"] / radius, margins["serial"]]
    scores += [np.abs(margins[name]) for name in kind.determinants]
    around = [
        machine.margins_at(poses + 0.05 * radius * step, mode)["reach"] < 0.0
        for step in np.vstack([np.eye(3), -np.eye(3)])
    ]
    worst = np.where(np.any(around, axis=0), -np.inf, np.nan_to_num(np.min(scores, axis=0), nan=-np.inf))
    return np.asarray(poses[worst.argmax()])


def design_at(kind: MechanismKind, factor: float) -> Design:
    centre = zip(kind.pose, factor * good_centre(kind.name), strict=True)
    placed = {f"center_{name}": float(value) for name, value in centre}
    return {**kind.example, **{name: placed[name] for name in kind.centre_names}, "mode": "+"}


@pytest.fixture(params=[pytest.param(kind, id=kind.name) for kind in MECHANISMS.values()])
def kind(request: pytest.FixtureRequest) -> MechanismKind:
    found: MechanismKind = request.param
    return found


@pytest.mark.parametrize("metric", METRICS.values(), ids=lambda metric: metric.name)
def test_every_declaration_is_complete(metric: Metric) -> None:
    assert metric.description
    assert metric.source
    assert metric.scale > 0.0
    for option in metric.options:
        assert option.description
        assert option.kind != "choice" or option.default in option.choices


def test_every_metric_means_something_for_a_mechanism_and_has_a_unit(kind: MechanismKind) -> None:
    for metric in meaningful(kind):
        Units().name(unit_for(metric.unit, kind.actuator_unit))
        assert metric.drives(kind)


@cache
def good_evaluation(kind_name: str) -> Evaluation:
    kind = MECHANISMS[kind_name]
    goals = [goal_of(metric, kind) for metric in meaningful(kind)]
    return evaluate(problem_of(kind, *goals), design_at(kind, 1.0))


def test_every_metric_of_a_good_design_is_a_finite_number_with_an_error(kind: MechanismKind) -> None:
    result = good_evaluation(kind.name)
    assert result.status == "feasible", result.reason
    for metric in meaningful(kind):
        value, error = result.metrics[metric.name], result.errors[metric.name]
        assert math.isfinite(value), metric.name
        assert 0.0 <= error < 0.2 * max(1.0, abs(value)), metric.name


def test_out_of_reach_is_said_or_measured_never_nan_in_silence(kind: MechanismKind) -> None:
    for metric in meaningful(kind):
        goal = goal_of(metric, kind)
        context = design_context(problem_of(kind, goal), design_at(kind, FAR))
        options = {option.name: goal.options.get(option.name, option.default) for option in metric.options}
        measurement = metric.compute(context, options)
        assert math.isfinite(measurement.value) or measurement.notes[UNDEFINED], metric.name
        bounded = Goal(metric, metric.name, goal.options, minimum=-1e9, maximum=1e9)
        result = evaluate(problem_of(kind, constraints=(bounded,)), design_at(kind, FAR))
        assert math.isfinite(result.violation)
        assert (result.violation > 0.0) == (UNDEFINED in measurement.notes), metric.name


WITHOUT_SLOPES = {"all_round_tilt"}
SLOPE_STEP, DIFFERENCE = 1e-7, 2e-5


def changed(design: Design, name: str, by: float) -> Design:
    return {**design, name: float(design[name]) + by}


def near_good(kind: MechanismKind, seed: int) -> Design:
    """A design near the example whose limbs' symmetry does not show: there extremes have kinks."""
    random = np.random.default_rng(seed)
    design = dict(design_at(kind, 1.0))
    for name in kind.example:
        design[name] = float(design[name]) * random.uniform(0.98, 1.02)
    for name in kind.centre_names:
        design[name] = float(design[name]) + 0.02 * random.uniform(-1.0, 1.0)
    return design


def asked_for(kind: MechanismKind) -> Problem:
    """Every metric as an objective, so that its slopes are those of its value; coverage, whose value is
    level, as a constraint."""
    goals = [goal_of(metric, kind) for metric in meaningful(kind)]
    objectives = tuple(
        Goal(goal.metric, goal.label, goal.options, sense=goal.metric.better)
        for goal in goals
        if goal.label != "coverage"
    )
    constraints = tuple(
        Goal(goal.metric, goal.label, goal.options, minimum=1.0) for goal in goals if goal.label == "coverage"
    )
    problem = problem_of(kind, constraints=constraints)
    return replace(problem, objectives=objectives)


def value_of(evaluation: Evaluation, label: str) -> float:
    return evaluation.slacks[label] if label in evaluation.slacks else evaluation.metrics[label]


def slope_of_value(evaluation: Evaluation, label: str) -> tuple[float, ...]:
    """Of the piece that is the value."""
    assert evaluation.slopes is not None
    rows, pieces = evaluation.slopes[label], evaluation.pieces.get(label) or (0.0,)
    greatest = label in METRICS and METRICS[label].better == "minimize"
    return rows[int(np.argmax(pieces) if greatest else np.argmin(pieces))]


def test_slopes_are_derivatives_of_the_metric(kind: MechanismKind) -> None:
    """Where differences to both sides agree, so that there is no kink, the slope agrees with them."""
    problem = asked_for(kind)
    names = [*kind.example, *kind.centre_names]
    checked = {goal.label: 0 for goal in (*problem.objectives, *problem.constraints)}
    for seed in range(5):
        design = near_good(kind, seed)
        around = [Neighbour(changed(design, name, SLOPE_STEP), SLOPE_STEP) for name in names]
        here = evaluate(problem, design, None, around)
        assert here.slopes is not None
        for number, name in enumerate(names):
            below, above = (
                evaluate(problem, changed(design, name, step)) for step in (-DIFFERENCE, DIFFERENCE)
            )
            for label in here.slopes:
                value = value_of(here, label)
                before = (value - value_of(below, label)) / DIFFERENCE
                after = (value_of(above, label) - value) / DIFFERENCE
                size = max(1.0, abs(before), abs(after))
                if abs(after - before) > 0.01 * size:
                    continue
                checked[label] += 1
                slope = slope_of_value(here, label)[number]
                assert slope == pytest.approx(0.5 * (before + after), abs=0.01 * size), (label, name)
    assert {label for label, count in checked.items() if count == 0} <= WITHOUT_SLOPES
