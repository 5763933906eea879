"""The front of a run in words: its marked designs by every objective."""

from __future__ import annotations

from tpm_design.report.escape import table, text
from tpm_design.report.reported import Reported
from tpm_design.runs.folder import DESIGNS
from tpm_design.runs.marks import front_marks
from tpm_design.runs.tables import goal_unit


def front_lines(reported: Reported) -> list[str]:
    """A section on the knee and the extremes; empty where there is no front."""
    if not reported.front:
        return []
    problem, units = reported.problem, reported.study.units
    rows = []
    marks = front_marks(problem, reported.front)
    for place, (entry, mark) in enumerate(zip(reported.front, marks, strict=True), start=1):
        if mark:
            values = (entry.evaluation.metrics[goal.label] for goal in problem.objectives)
            written = [
                text(units.written(value, goal_unit(problem, goal)))
                for value, goal in zip(values, problem.objectives, strict=True)
            ]
            rows.append([text(mark), str(place), str(entry.number), *written])
    headings = ["", "rank", "number", *(text(goal.label) for goal in problem.objectives)]
    return [
        f"## Front ({len(reported.front)} designs)",
        "",
        f"None of them is bettered by another in every objective; [{DESIGNS}]({DESIGNS}) holds all.",
        "",
        *table(headings, rows),
    ]
