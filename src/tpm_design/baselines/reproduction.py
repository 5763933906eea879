"""The designs a run ended with, evaluated again by the present program and compared with what was stored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tpm_design.baselines.deviations import Deviations, compare_tables
from tpm_design.baselines.folders import read_result
from tpm_design.baselines.tables import ResultTable, Row, metric_of_error, parse_table, read_table
from tpm_design.errors import UsageError
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.problem import Design, Problem, Sample
from tpm_design.runs.entry import Entry
from tpm_design.runs.folder import DESIGNS, LOG, STUDY, SUMMARY, read_run
from tpm_design.runs.tables import designs_table, metric_columns, parameter_columns
from tpm_design.study import Study, load_study
from tpm_design.units import Units

SAME_TO = 1e-9
"""Share of a stored number to which it must come back at least: rounding differs between processors."""


@dataclass(frozen=True)
class Repeated:
    """What a number may deviate by when it is computed again: the larger of ``SAME_TO`` of it and its stored
    numeric error.

    A value claims no more than its error says; where rounding on another processor turns a search over
    the region to another candidate, it may move within it. The violation may move with the constraints that
    it adds up.
    """

    problem: Problem
    units: Units

    def allowed(self, row: Row, heading: str) -> float:
        """An ``Allowance``."""
        metric = metric_of_error(heading)
        base = heading if metric is None or metric not in row else metric
        relative = SAME_TO * abs(float(row[base] or 0.0))
        if base == "violation [-]":
            return relative + self._violation(row)
        return max(relative, self._error(row, base))

    def _error(self, row: Row, heading: str) -> float:
        """The stored numeric error of a metric; 0 for anything else."""
        for column in metric_columns(self.problem, self.units):
            if column.heading == heading:
                cell = row.get(self.units.heading(f"{column.name} error", column.unit), "")
                return float(cell or 0.0)
        return 0.0

    def _violation(self, row: Row) -> float:
        """Value and error of every constraint may move, each by what is allowed."""
        columns = {column.name: column for column in metric_columns(self.problem, self.units)}
        total = 0.0
        for goal in self.problem.constraints:
            column = columns[goal.label]
            if row.get(column.heading):
                allowed = self.allowed(row, column.heading)
                total += 2.0 * self.units.to_si(allowed, column.unit) / goal.metric.scale
        return total


def reproduce(folder: Path, *, allow_code: bool) -> Deviations:
    """Every design in designs.csv, evaluated again as its study asks, with the samples of its round.

    Designs are taken from the log, with exact numbers, where the folder has one, else from designs.csv.
    Raises UsageError, StudyError or PlugInError.
    """
    result = read_result(folder)
    if result.is_sweep:
        raise UsageError(
            "This is a sweep, not a search with a result to reproduce.",
            where=str(folder),
            remedy="Sweep again and use `compare`.",
        )
    stored = read_table(folder / DESIGNS)
    if not stored.rows:
        raise UsageError("It holds no design.", where=str(folder / DESIGNS), remedy="Run the study again.")
    study = load_study(folder / STUDY, allow_code=allow_code)
    designs = _exact_designs(folder, stored) if (folder / LOG).is_file() else _written_designs(study, stored)
    rounds = result.summary.get("rounds", [])
    again = [
        Entry(number, evaluate(_judged(study.problem, rounds, number), design)) for number, design in designs
    ]
    text = designs_table(study.problem, study.units, again)
    repeated = parse_table(text, folder / DESIGNS)
    return compare_tables(stored, repeated, Repeated(study.problem, study.units).allowed)


def _exact_designs(folder: Path, stored: ResultTable) -> list[tuple[int, Design]]:
    """Number and design of every row, from the log."""
    entries = {entry.number: entry for entry in read_run(folder).entries}
    designs = []
    for rank, row in stored.rows.items():
        number = _number(folder, rank, row)
        if number not in entries:
            raise UsageError(
                f"The design of rank {rank} is evaluation {number}, which is not in the log.",
                where=str(folder / LOG),
                remedy="Restore the run from a copy, or run the study again.",
            )
        designs.append((number, entries[number].evaluation.design))
    return designs


def _written_designs(study: Study, stored: ResultTable) -> list[tuple[int, Design]]:
    """Number and design of every row, from the table's decimals."""
    folder = study.path.parent
    designs: list[tuple[int, Design]] = []
    columns = parameter_columns(study.problem, study.units)
    for rank, row in stored.rows.items():
        design: dict[str, float | str] = {}
        for column in columns:
            cell = row.get(column.heading, "")
            if not cell or (column.name == "mode" and cell not in study.problem.modes):
                raise UsageError(
                    f"The design of rank {rank} has no {column.heading} that the study knows.",
                    where=str(folder / DESIGNS),
                    remedy="Restore the folder from a copy, or run the study again.",
                )
            design[column.name] = cell if column.unit == "" else study.units.to_si(float(cell), column.unit)
        designs.append((_number(folder, rank, row), design))
    return designs


def _number(folder: Path, rank: int, row: Row) -> int:
    try:
        return int(row.get("id", ""))
    except ValueError:
        raise UsageError(
            f"The design of rank {rank} has no id.",
            where=str(folder / DESIGNS),
            remedy="Restore the file from a copy, or run the study again.",
        ) from None


def _judged(problem: Problem, rounds: list[Mapping[str, Any]], number: int) -> Problem:
    """The problem of the round in which an evaluation was made, by run.json."""
    first = 0
    try:
        for one in rounds:
            first += int(one["evaluations"])
            if number < first:
                return replace(problem, samples=tuple(_sample(data) for data in one["samples"]))
    except (KeyError, TypeError, ValueError):
        raise UsageError(
            f"The rounds in {SUMMARY} cannot be read.", remedy="Restore the run from a copy."
        ) from None
    return problem


def _sample(data: Mapping[str, Any]) -> Sample:
    pose = None if data["pose"] is None else (*map(float, data["pose"]),)
    offsets = {name: tuple(map(float, values)) for name, values in data["offsets"].items()}
    return Sample(str(data["label"]), offsets, pose, float(data["margin"]))  # type: ignore[arg-type]
