"""Parts of the report of a sweep: its plan, what every metric came to, and why points failed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tpm_design.problem import Goal
from tpm_design.report.escape import code, code_cell, table, text
from tpm_design.report.reported import Reported
from tpm_design.runs.sweeps import failures
from tpm_design.runs.tables import goal_unit, parameter_columns
from tpm_design.study import GridSweep, ListSweep
from tpm_design.study.sweep_points import held_values, plan_of_sweep, plan_size, swept_names

MOST_REASONS = 20
NONE = "–"

FloatArray = NDArray[np.float64]


def sweep_lines(reported: Reported) -> list[str]:
    """The sections of a sweep."""
    return [*_plan(reported), "", *_ranges(reported), *_failures(reported)]


def metric_values(reported: Reported, goal: Goal) -> FloatArray:
    """A metric at every entry (N,), in the study's units; NaN where it has no value."""
    unit = goal_unit(reported.problem, goal)
    values = [entry.evaluation.metrics.get(goal.label, math.nan) for entry in reported.run.entries]
    return np.array(values, dtype=np.float64) * reported.study.units.from_si(1.0, unit)


def _plan(reported: Reported) -> list[str]:
    plan, entries = plan_of_sweep(reported.study), reported.run.entries
    if isinstance(plan, GridSweep):
        how = f"a grid of {' × '.join(str(len(values)) for _, values in plan.axes)}"
    elif isinstance(plan, ListSweep):
        how = "a list"
    else:
        how = f"{plan.method.replace('_', ' ').capitalize()} points, seed {plan.seed},"
    counts = [entry.evaluation.status for entry in entries]
    lines = [
        "## Sweep",
        "",
        f"{len(entries)} of the plan's {plan_size(plan)} designs are in the log: {counts.count('feasible')} "
        f"feasible, {counts.count('infeasible')} infeasible, {counts.count('failed')} failed. The plan is "
        f"{how} over {', '.join(code(name) for name in swept_names(plan))}.",
    ]
    held = held_values(reported.study)
    return [*lines, "", f"Held: {text('; '.join(held))}."] if held else lines


def _ranges(reported: Reported) -> list[str]:
    problem, units = reported.problem, reported.study.units
    rows = []
    for goal in (*problem.objectives, *problem.constraints, *problem.record):
        values = metric_values(reported, goal)
        name = units.name(goal_unit(problem, goal))
        cells = [NONE] * 4
        if np.isfinite(values).any():
            least, greatest = int(np.nanargmin(values)), int(np.nanargmax(values))
            cells = [
                cell
                for place in (least, greatest)
                for cell in (f"{values[place]:.6g}", str(reported.run.entries[place].number))
            ]
        missing = str(int(np.count_nonzero(~np.isfinite(values))))
        rows.append([code_cell(goal.label), NONE if name == "-" else name, *cells, missing])
    headings = ["metric", "unit", "least", "at point", "greatest", "at point", "without value"]
    return table(headings, rows)


def _failures(reported: Reported) -> list[str]:
    found = failures(reported.run.entries)
    if not found:
        return []
    rows = [
        [str(failure.count), str(failure.first), text(failure.reason)] for failure in found[:MOST_REASONS]
    ]
    lines = ["", "Points that failed:", "", *table(["points", "the first", "reason"], rows)]
    more = len(found) - MOST_REASONS
    return [*lines, "", f"{more} more reasons are in the table of evaluations."] if more > 0 else lines


def is_logarithmic(reported: Reported, name: str) -> bool:
    """Whether a quantity is searched by its logarithm, and has one at every entry."""
    return any(v.name == name and v.scale == "log" for v in reported.problem.variables) and all(
        float(entry.evaluation.design[name]) > 0.0 for entry in reported.run.entries
    )


def parameter_values(reported: Reported, name: str) -> tuple[str, list[float] | list[str]]:
    """The heading of a swept quantity, with its unit, and its value at every entry, in the study's units."""
    units = reported.study.units
    column = next(c for c in parameter_columns(reported.problem, units) if c.name == name)
    given = [entry.evaluation.design[name] for entry in reported.run.entries]
    if not column.unit:
        return column.heading, [str(value) for value in given]
    return column.heading, [units.from_si(float(value), column.unit) for value in given]
