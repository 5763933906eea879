"""CSV tables of evaluations: one row each, headings with units."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

from tpm_design.evaluation.result import Evaluation
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.problem import Goal, Problem
from tpm_design.runs.entry import Entry
from tpm_design.runs.marks import front_marks
from tpm_design.units import Units, si_unit, unit_for


@dataclass(frozen=True)
class Column:
    """``name`` of a quantity, its SI unit ("" for text), and its heading."""

    name: str
    unit: str
    heading: str


def parameter_columns(problem: Problem, units: Units) -> list[Column]:
    """Every design quantity, fixed ones included, in the order of the mechanism."""
    free = {variable.name: si_unit(variable.dimension) for variable in problem.variables}
    order = [*problem.kind.parameter_names(), *problem.kind.centre_names, "mode"]
    columns = []
    for name in order:
        if name in free or name in problem.fixed or name in problem.ties:
            unit = "" if name == "mode" else free.get(name) or parameter_unit(problem.kind, name)
            columns.append(Column(name, unit, name if not unit else units.heading(name, unit)))
    return columns


def free_columns(problem: Problem, units: Units) -> list[Column]:
    """Those of ``parameter_columns`` that are searched."""
    free = {variable.name for variable in problem.variables}
    return [column for column in parameter_columns(problem, units) if column.name in free]


def parameter_unit(kind: MechanismKind, name: str) -> str:
    """SI unit of a parameter, or of a coordinate of the region's centre."""
    parameter = kind.parameter(name)
    return si_unit(parameter.dimension if parameter else "length")


def goal_unit(problem: Problem, goal: Goal) -> str:
    """SI unit of a goal's metric for this mechanism."""
    return unit_for(goal.metric.unit, problem.kind.actuator_unit)


def metric_columns(problem: Problem, units: Units) -> list[Column]:
    """Every objective, constraint and recorded metric."""
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    return [
        Column(goal.label, goal_unit(problem, goal), units.heading(goal.label, goal_unit(problem, goal)))
        for goal in goals
    ]


def note_columns(problem: Problem) -> list[str]:
    """Extra text columns that metrics declare, such as which locus was nearest."""
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    return [f"{goal.label}_{note}" for goal in goals for note in goal.metric.notes]


class EvaluationTable:
    """Rows of ``evaluations.csv``."""

    def __init__(self, problem: Problem, units: Units) -> None:
        self._parameters = parameter_columns(problem, units)
        self._metrics = metric_columns(problem, units)
        self._notes = note_columns(problem)
        self._units = units

    def headings(self) -> list[str]:
        return [
            "id",
            "round",
            "status",
            "reason",
            *(column.heading for column in self._parameters),
            *(column.heading for column in self._metrics),
            *self._notes,
            "violation [-]",
            "seconds [s]",
        ]

    def row(self, entry: Entry) -> list[str]:
        """One evaluation; what has no value is left empty."""
        evaluation = entry.evaluation
        return [
            str(entry.number),
            str(entry.round),
            evaluation.status,
            evaluation.reason,
            *design_cells(evaluation, self._parameters, self._units),
            *metric_cells(evaluation, self._metrics, self._units),
            *(evaluation.notes.get(name, "") for name in self._notes),
            number(evaluation.violation),
            f"{evaluation.seconds:.6f}",
        ]


def design_cells(evaluation: Evaluation, columns: Sequence[Column], units: Units) -> list[str]:
    cells = []
    for column in columns:
        value = evaluation.design[column.name]
        cells.append(value if isinstance(value, str) else number(units.from_si(value, column.unit)))
    return cells


def metric_cells(evaluation: Evaluation, columns: Sequence[Column], units: Units) -> list[str]:
    values = (evaluation.metrics.get(column.name, math.nan) for column in columns)
    return [
        number(units.from_si(value, column.unit)) if math.isfinite(value) else ""
        for value, column in zip(values, columns, strict=True)
    ]


def designs_table(problem: Problem, units: Units, result: Sequence[Entry], *, ranked: bool = True) -> str:
    """``designs.csv``: one row per entry, each metric followed by its numeric error. ``ranked``: the entries
    are optima, best first, and a first column counts them; where they are a front of several objectives, a
    second one marks its knee and extremes. No times, paths or run ids, so that equal searches give equal
    files."""
    parameters, metrics = parameter_columns(problem, units), metric_columns(problem, units)
    notes = note_columns(problem)
    headings = ["id", "status", *(column.heading for column in parameters)]
    for column in metrics:
        headings += [column.heading, units.heading(f"{column.name} error", column.unit)]
    rows = [[*headings, *notes, "violation [-]"]]
    for entry in result:
        evaluation = entry.evaluation
        row = [str(entry.number), evaluation.status]
        row += design_cells(evaluation, parameters, units)
        for column, cell in zip(metrics, metric_cells(evaluation, metrics, units), strict=True):
            error = evaluation.errors.get(column.name, math.nan)
            row += [cell, number(units.from_si(error, column.unit)) if cell else ""]
        row += [evaluation.notes.get(name, "") for name in notes]
        rows.append([*row, number(evaluation.violation)])
    if ranked and len(problem.objectives) > 1:
        marks = ["mark", *front_marks(problem, result)]
        rows = [[mark, *row] for mark, row in zip(marks, rows, strict=True)]
    if ranked:
        rows = [["rank" if place == 0 else str(place), *row] for place, row in enumerate(rows)]
    return "".join(csv_line(row) for row in rows)


def number(value: float) -> str:
    """The shortest decimal that reads back as the same number; empty where there is none."""
    return repr(float(value)) if math.isfinite(value) else ""


def csv_line(cells: Sequence[str]) -> str:
    """One line of CSV."""
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerow(cells)
    return out.getvalue()
