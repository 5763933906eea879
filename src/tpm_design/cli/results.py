"""How designs and their metrics are shown: as text with units and errors, or as data for --json."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tpm_design.cli.text import table
from tpm_design.evaluation.result import Evaluation
from tpm_design.problem import Design, Goal, Problem
from tpm_design.report.readings import at_end, limiting, nearest_constraint
from tpm_design.report.words import asked, range_text
from tpm_design.runs.entry import Entry
from tpm_design.runs.tables import goal_unit, parameter_columns
from tpm_design.units import Units

NO_VALUE = "–"
SAME_SLACK = 1e-9
"""Rounding between a slack and the distance of its value to the bound, as a share of the metric's scale."""


def design_rows(problem: Problem, units: Units, chosen: Design) -> list[list[str]]:
    """Quantity, value with unit, and the range it was searched in."""
    rows = []
    for column in parameter_columns(problem, units):
        value = chosen[column.name]
        text = value if isinstance(value, str) else units.written(value, column.unit)
        rows.append([column.name, text, range_text(problem, column.name, units)])
    return rows


def metric_rows(problem: Problem, units: Units, evaluation: Evaluation) -> list[list[str]]:
    """Metric, value with unit, numeric error, what was asked, slack."""
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    return [_metric_row(problem, units, evaluation, goal) for goal in goals]


def _metric_row(problem: Problem, units: Units, evaluation: Evaluation, goal: Goal) -> list[str]:
    unit = goal_unit(problem, goal)
    value = evaluation.metrics.get(goal.label, math.nan)
    error = evaluation.errors.get(goal.label, math.nan)
    notes = [
        f"{name}: {text}".removeprefix(f"{goal.label}_")
        for name, text in evaluation.notes.items()
        if name.startswith(f"{goal.label}_")
    ]
    if limited_by_sample(goal, evaluation):
        notes.insert(0, "in worst sample")
    return [
        goal.label,
        units.written(value, unit) if math.isfinite(value) else NO_VALUE,
        f"± {error_text(units, error, unit)}" if math.isfinite(value) else NO_VALUE,
        asked(goal, units, unit),
        _slack_text(problem, units, evaluation, goal, unit),
        "; ".join(notes),
    ]


def limited_by_sample(goal: Goal, evaluation: Evaluation) -> bool:
    """Whether a machine or pose that had to be met besides leaves a constraint less than its value does."""
    slack, value = evaluation.slacks.get(goal.label, math.nan), evaluation.metrics.get(goal.label, math.nan)
    ends = [value - goal.minimum] if goal.minimum is not None else []
    ends += [goal.maximum - value] if goal.maximum is not None else []
    if not slack >= 0.0 or not ends:
        return False
    own = min(ends) - evaluation.errors.get(goal.label, math.nan)
    return slack < own - SAME_SLACK * goal.metric.scale


def error_text(units: Units, error: float, unit: str) -> str:
    """A numeric error in the study's units, two digits; exact values say so."""
    return "0" if error == 0.0 else units.written(error, unit, digits=2)


def _slack_text(problem: Problem, units: Units, evaluation: Evaluation, goal: Goal, unit: str) -> str:
    if goal.label not in evaluation.slacks:
        return ""
    slack = evaluation.slacks[goal.label]
    word = "met" if slack >= 0.0 else "MISSED"
    return f"{word} by {units.written(abs(slack), unit, digits=3)}"


def result_text(problem: Problem, units: Units, evaluation: Evaluation) -> str:
    """A design and all its metrics as two tables."""
    design = table(["design", "value", "searched in"], design_rows(problem, units, evaluation.design))
    if evaluation.status == "failed":
        return f"{design}\n\nThis design cannot be evaluated: {evaluation.reason}"
    rows = metric_rows(problem, units, evaluation)
    metrics = table(["metric", "value", "numeric error", "asked", "constraint", "note"], rows)
    reasons = f"\n{evaluation.reason}" if "undefined" in evaluation.reason or NO_VALUE in metrics else ""
    return f"{design}\n\n{metrics}{reasons}"


def limit_text(problem: Problem, entry: Entry) -> str:
    """What limits a design: constraints at their bound and ranges at their end, else the nearest bound."""
    missed = [label for label, slack in entry.evaluation.slacks.items() if slack < 0.0]
    if missed:
        return f"Misses {', '.join(missed)}."
    labels = [goal.label for goal in limiting(problem, entry)]
    ends = [variable.name for variable in at_end(problem, entry.evaluation)]
    parts = []
    if labels:
        parts.append("constraints at their bound: " + ", ".join(labels))
    if ends:
        parts.append("ranges at their end: " + ", ".join(ends))
    if parts:
        return f"Limited by {'; '.join(parts)}."
    nearest = nearest_constraint(problem, entry)
    if nearest is None:
        return "No constraint limits the design."
    return f"Nothing binds; the nearest constraint is {nearest.goal.label}."


def evaluation_data(problem: Problem, units: Units, evaluation: Evaluation) -> dict[str, Any]:
    """One evaluation for --json, in the study's units, units beside every number."""
    design: dict[str, dict[str, Any]] = {}
    for column in parameter_columns(problem, units):
        value = evaluation.design[column.name]
        if isinstance(value, str):
            design[column.name] = {"value": value}
        else:
            design[column.name] = {
                "value": units.from_si(value, column.unit),
                "unit": units.name(column.unit),
            }
    goals: Sequence[Goal] = (*problem.objectives, *problem.constraints, *problem.record)
    metrics = {}
    for goal in goals:
        unit = goal_unit(problem, goal)
        value = evaluation.metrics.get(goal.label, math.nan)
        metrics[goal.label] = {
            "value": units.from_si(value, unit) if math.isfinite(value) else None,
            "error": units.from_si(evaluation.errors[goal.label], unit) if math.isfinite(value) else None,
            "unit": units.name(unit),
        }
        if goal.label in evaluation.slacks:
            slack = evaluation.slacks[goal.label]
            metrics[goal.label] |= {"slack": units.from_si(slack, unit), "met": slack >= 0.0}
    return {
        "status": evaluation.status,
        "reason": evaluation.reason,
        "violation": evaluation.violation if math.isfinite(evaluation.violation) else None,
        "design": design,
        "metrics": metrics,
        "notes": dict(evaluation.notes),
    }
