"""The table at the end of a comparison of architectures."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from tpm_design.cli.guard import INTERRUPTED, NOT_PROVED, NOTHING_FEASIBLE
from tpm_design.cli.results import NO_VALUE, error_text
from tpm_design.cli.text import table
from tpm_design.errors import unwritable
from tpm_design.problem import Goal
from tpm_design.report.words import asked, gap_percent
from tpm_design.runs.optimality import gap_of
from tpm_design.runs.tables import csv_line, goal_unit, metric_columns, number, parameter_unit
from tpm_design.study import Study
from tpm_design.study.actions import Run

# the first of them that applies is the command's exit code
GRAVEST_FIRST = (INTERRUPTED, NOT_PROVED, NOTHING_FEASIBLE)


def worst_code(codes: Sequence[int | None]) -> int | None:
    """The exit code of several searches."""
    return next((code for code in GRAVEST_FIRST if code in codes), None)


def _labels(studies: Mapping[str, Study]) -> dict[str, Goal]:
    """Every goal of any study by its label, in order."""
    goals: dict[str, Goal] = {}
    for study in studies.values():
        problem = study.problem
        for goal in (*problem.objectives, *problem.constraints, *problem.record):
            goals.setdefault(goal.label, goal)
    return goals


def comparison_text(studies: Mapping[str, Study], runs: Mapping[str, Run]) -> str:
    """One column for each architecture: its dimensions, then every metric with its numeric error."""
    rows = [["", *(studies[label].problem.kind.title for label in runs)]]
    names = list(
        dict.fromkeys(name for label in runs for name in studies[label].problem.kind.parameter_names())
    )
    names += list(dict.fromkeys(n for label in runs for n in studies[label].problem.kind.centre_names))
    for name in names:
        cells = [_quantity(studies[label], run, name) for label, run in runs.items()]
        if any(cells):
            rows.append([name, *cells])
    for label, goal in _labels(studies).items():
        first = next(iter(studies.values()))
        wanted = asked(goal, first.units, goal_unit(first.problem, goal))
        title = label if wanted in ("", "recorded") else f"{label} ({wanted})"
        rows.append([title, *(_metric(studies[key], run, label) for key, run in runs.items())])
    gaps = [gap_of(run.result) for run in runs.values()]
    if any(gap is not None for gap in gaps):
        shown = [NO_VALUE if gap is None else f"at most {gap_percent(gap)} %" for gap in gaps]
        rows.append(["above the optimum", *shown])
    rows.append(["design", *(_standing(run) for run in runs.values())])
    folders = "\n".join(f"{label}: {run.folder}" for label, run in runs.items())
    return f"{table(['', *runs], rows)}\n\n{folders}"


def _quantity(study: Study, run: Run, name: str) -> str:
    if run.best is None or name not in run.best.design:
        return ""
    value = run.best.design[name]
    unit = parameter_unit(study.problem.kind, name)
    return value if isinstance(value, str) else study.units.written(value, unit)


def _metric(study: Study, run: Run, label: str) -> str:
    column = next((c for c in metric_columns(study.problem, study.units) if c.name == label), None)
    value = math.nan if run.best is None else run.best.metrics.get(label, math.nan)
    if column is None or run.best is None or not math.isfinite(value):
        return NO_VALUE
    error = error_text(study.units, run.best.errors.get(label, 0.0), column.unit)
    return f"{study.units.written(value, column.unit)} ± {error}"


def _standing(run: Run) -> str:
    feasible = run.best.status if run.best is not None else "none"
    return feasible if run.verdict is None else f"{feasible}, {run.verdict.outcome}"


def _cells(study: Study, run: Run) -> dict[str, str]:
    """Heading with unit → value of every metric."""
    columns = metric_columns(study.problem, study.units)
    values = [math.nan] * len(columns)
    if run.best is not None:
        values = [run.best.metrics.get(column.name, math.nan) for column in columns]
    return {
        column.heading: number(study.units.from_si(value, column.unit)) if math.isfinite(value) else ""
        for column, value in zip(columns, values, strict=True)
    }


def write_comparison(output: Path, name: str, studies: Mapping[str, Study], runs: Mapping[str, Run]) -> Path:
    """``<output>/<name>.csv``: a row for each architecture, values in the study's units. Raises UsageError
    where it cannot be written."""
    own = {label: _cells(studies[label], run) for label, run in runs.items()}
    headings = list(dict.fromkeys(heading for cells in own.values() for heading in cells))
    lines = [csv_line(["architecture", "mechanism", "status", "verdict", *headings, "run"])]
    for label, run in runs.items():
        status = "" if run.best is None else run.best.status
        verdict = "" if run.verdict is None else run.verdict.outcome
        folder = "" if run.folder is None else os.path.relpath(run.folder, output)
        cells = [own[label].get(heading, "") for heading in headings]
        lines.append(csv_line([label, studies[label].problem.kind.name, status, verdict, *cells, folder]))
    path = output / f"{name}.csv"
    try:
        path.write_text("".join(lines), encoding="utf-8")
    except OSError as error:
        raise unwritable("The table cannot be written", error, path) from None
    return path
