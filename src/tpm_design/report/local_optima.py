"""The other local optima of a search, in words: what else would do nearly as well."""

from __future__ import annotations

from collections.abc import Sequence

from tpm_design.problem import Problem
from tpm_design.report.escape import code_cell, table, text
from tpm_design.report.reported import Reported
from tpm_design.runs.entry import Entry
from tpm_design.runs.folder import DESIGNS
from tpm_design.runs.tables import free_columns, goal_unit
from tpm_design.units import Units


def other_optima_text(problem: Problem, units: Units, optima: Sequence[Entry]) -> str | None:
    """One sentence on the ``optima``, best first, beyond the first; None where there is no other or the
    study has not one objective."""
    others = optima[1:]
    if not others or len(problem.objectives) != 1:
        return None
    (goal,) = problem.objectives
    nearest, farthest = (
        units.written(entry.evaluation.metrics[goal.label], goal_unit(problem, goal))
        for entry in (others[0], others[-1])
    )
    if len(others) == 1:
        return f"Another local optimum is in {DESIGNS}: {goal.label} {nearest}."
    reach = f"{nearest}" if nearest == farthest else f"{nearest} … {farthest}"
    return f"{len(others)} other local optima are in {DESIGNS}: {goal.label} {reach}."


def optima_lines(reported: Reported) -> list[str]:
    """A section with a row for every local optimum; empty where the search noted no other than its best."""
    problem, units = reported.problem, reported.study.units
    numbers = reported.run.summary.get("optima_ids")
    if not isinstance(numbers, list) or len(numbers) < 2 or len(problem.objectives) != 1:
        return []
    entries = {entry.number: entry for entry in reported.run.entries}
    (goal,) = problem.objectives
    columns = free_columns(problem, units)
    rows = []
    for place, number in enumerate(numbers, start=1):
        evaluation = entries[number].evaluation
        row = [str(place), str(number)]
        row.append(text(units.written(evaluation.metrics[goal.label], goal_unit(problem, goal))))
        for column in columns:
            value = evaluation.design[column.name]
            row.append(
                code_cell(value) if isinstance(value, str) else text(units.written(value, column.unit))
            )
        rows.append(row)
    headings = ["rank", "number", text(goal.label), *(code_cell(column.name) for column in columns)]
    return [
        f"## Local optima ({len(rows)})",
        "",
        f"Where local searches ended; [{DESIGNS}]({DESIGNS}) has every metric of them.",
        "",
        *table(headings, rows),
    ]
