"""How a front is shown: a table for people, or data for --json."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tpm_design.cli.results import evaluation_data
from tpm_design.cli.text import table
from tpm_design.problem import Problem
from tpm_design.runs.entry import Entry
from tpm_design.runs.front import spread
from tpm_design.runs.marks import front_marks
from tpm_design.runs.ranking import scaled_objectives
from tpm_design.runs.tables import free_columns, goal_unit
from tpm_design.units import Units

MOST_ROWS = 15
"""Longer fronts are shown thinned out, marked designs always; designs.csv holds them whole."""


def front_text(problem: Problem, units: Units, front: Sequence[Entry]) -> str:
    """Objectives and free quantities along the front, best first by the first objective."""
    marks = front_marks(problem, front)
    shown = _shown(problem, front, marks)
    columns = free_columns(problem, units)
    rows = []
    for place, (entry, mark) in enumerate(zip(front, marks, strict=True)):
        if place not in shown:
            continue
        row = [str(place + 1), mark]
        for goal in problem.objectives:
            row.append(units.written(entry.evaluation.metrics[goal.label], goal_unit(problem, goal)))
        for column in columns:
            value = entry.evaluation.design[column.name]
            row.append(value if isinstance(value, str) else units.written(value, column.unit))
        rows.append(row)
    headings = ["rank", "mark", *(goal.label for goal in problem.objectives), *(c.name for c in columns)]
    thinned = len(rows) < len(front)
    told = f"\n{len(rows)} of {len(front)} designs, spread over the front; designs.csv holds all."
    return table(headings, rows) + (told if thinned else "")


def _shown(problem: Problem, front: Sequence[Entry], marks: Sequence[str]) -> Sequence[int]:
    """Which designs are printed: long fronts crowd where a search converged, and every n-th of them would
    say the same again."""
    if len(front) <= MOST_ROWS:
        return range(len(front))
    values = np.array([scaled_objectives(problem, entry.evaluation) for entry in front])
    return spread(values, [place for place, mark in enumerate(marks) if mark], MOST_ROWS)


def front_data(problem: Problem, units: Units, front: Sequence[Entry]) -> list[dict[str, Any]]:
    """Every design of a front, in order."""
    marks = front_marks(problem, front)
    return [
        {"id": entry.number, "mark": mark, **evaluation_data(problem, units, entry.evaluation)}
        for entry, mark in zip(front, marks, strict=True)
    ]
