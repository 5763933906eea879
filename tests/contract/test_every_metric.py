"""What every registered metric must do, without naming any."""

from __future__ import annotations

import math

import pytest

from tpm_design.mechanisms import MECHANISMS
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import UNDEFINED, Metric
from tpm_design.problem import Goal, Problem, design_context, evaluate
from tpm_design.units import Units, unit_for
from tpm_design.workspace.regions import Box

KIND = next(iter(MECHANISMS.values()))
REGION = Box((0.1, 0.1, 0.1))


def goal_of(metric: Metric) -> Goal:
    required = {
        option.name: 0.5 * (option.minimum + option.maximum) for option in metric.options if option.required
    }
    return Goal(metric, metric.name, required)


def problem_of(*goals: Goal) -> Problem:
    modes = {"+": {field.name: "+" * field.length for field in KIND.mode_fields}}
    return Problem(KIND, {}, (), modes, {}, REGION, (), (), goals)


def design_at(centre: float) -> dict[str, float | str]:
    return {**KIND.example, "center_x": centre, "center_y": centre, "center_z": centre, "mode": "+"}


@pytest.fixture(params=list(METRICS.values()), ids=lambda metric: metric.name)
def metric(request: pytest.FixtureRequest) -> Metric:
    found: Metric = request.param
    return found


def test_every_declaration_is_complete(metric: Metric) -> None:
    assert metric.description
    assert metric.source
    assert metric.scale > 0.0
    Units().name(unit_for(metric.unit, KIND.actuator_unit))
    for option in metric.options:
        assert option.description
        assert option.kind != "choice" or option.default in option.choices


def test_every_metric_of_a_good_design_is_a_finite_number_with_an_error(metric: Metric) -> None:
    result = evaluate(problem_of(goal_of(metric)), design_at(0.15))
    assert result.status == "feasible", result.reason
    assert math.isfinite(result.metrics[metric.name])
    assert 0.0 <= result.errors[metric.name] < 0.2 * max(1.0, abs(result.metrics[metric.name]))


def test_out_of_reach_is_said_or_measured_never_nan_in_silence(metric: Metric) -> None:
    goal = goal_of(metric)
    problem = problem_of(goal)
    context = design_context(problem, design_at(3.0))
    options = {option.name: goal.options.get(option.name, option.default) for option in metric.options}
    measurement = metric.compute(context, options)
    assert math.isfinite(measurement.value) or measurement.notes[UNDEFINED]
    bounded = Goal(metric, metric.name, goal.options, minimum=-1e9, maximum=1e9)
    constrained = Problem(KIND, {}, (), problem.modes, {}, REGION, (), (bounded,), ())
    result = evaluate(constrained, design_at(3.0))
    assert math.isfinite(result.violation)
    assert (result.violation > 0.0) == (UNDEFINED in measurement.notes)
