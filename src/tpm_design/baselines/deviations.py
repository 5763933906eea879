"""Two tables of results, cell by cell: everything that deviates by more than is allowed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from tpm_design.baselines.tables import ResultTable, Row, metric_of_error, unit_of, with_unit

Allowance = Callable[[Row, str], float]
"""Baseline's row, heading of a column of numbers → how far the run's number may be from the baseline's, in
the column's unit."""

NOTHING = "–"


@dataclass(frozen=True)
class Tolerance:
    """``relative``: share of the baseline's number. ``absolute``: in each column's own unit. Their sum is
    allowed."""

    relative: float = 1e-6
    absolute: float = 0.0

    def allowed(self, row: Row, heading: str) -> float:
        """An ``Allowance``. A numeric error is an uncertainty of its metric, measured by the metric's own
        number: 4e-12 or 3e-12 of 0.3 is no difference."""
        metric = metric_of_error(heading)
        base = heading if metric is None or metric not in row else metric
        return self.absolute + self.relative * abs(float(row[base] or 0.0))


@dataclass(frozen=True)
class Exceedance:
    """One thing outside tolerance. ``row``: as people name it, "" where it is a whole column; ``column``: a
    heading, "" where it is a whole row. ``baseline``, ``run``: values with their unit. ``deviation``,
    ``allowed``: in the column's unit, None where no two numbers were compared; ``relative``: the deviation as
    a share of the baseline's number, None also where that is 0."""

    row: str
    column: str
    baseline: str
    run: str
    deviation: float | None = None
    allowed: float | None = None
    relative: float | None = None


@dataclass(frozen=True)
class Deviations:
    """What comparing two tables found. ``columns``: all of both, in order. ``rows``, ``cells``: how many
    were compared; ``identical``: cells that are the same number or text."""

    file: str
    columns: tuple[str, ...]
    rows: int
    cells: int
    identical: int
    exceedances: tuple[Exceedance, ...]

    @property
    def within(self) -> bool:
        return not self.exceedances


def compare_tables(baseline: ResultTable, run: ResultTable, allowed: Allowance) -> Deviations:
    """Every cell of rows with the same key. Columns and rows of one table alone are exceedances, and so is
    any difference of texts, and a number where the other table has none."""
    columns = tuple(dict.fromkeys((*baseline.headings, *run.headings)))
    found: list[Exceedance] = []
    for column in columns:
        if column not in baseline.headings or column not in run.headings:
            found.append(
                Exceedance(
                    "", column, _presence(column in baseline.headings), _presence(column in run.headings)
                )
            )
    shared = [column for column in columns if column in baseline.headings and column in run.headings]
    rows = cells = identical = 0
    for key in sorted({*baseline.rows, *run.rows}):
        name = f"{baseline.key} {key}"
        if key not in baseline.rows or key not in run.rows:
            found.append(Exceedance(name, "", _presence(key in baseline.rows), _presence(key in run.rows)))
            continue
        before, now = baseline.rows[key], run.rows[key]
        rows += 1
        for column in shared:
            cells += 1
            if _same(before[column], now[column], column):
                identical += 1
            else:
                found += _exceedance(name, column, before, now, allowed)
    return Deviations(baseline.file, columns, rows, cells, identical, tuple(found))


def _presence(there: bool) -> str:
    return "there" if there else NOTHING


def _same(before: str, now: str, column: str) -> bool:
    if unit_of(column) is None or not before or not now:
        return before == now
    return float(before) == float(now)


def _exceedance(name: str, column: str, before: Row, now: Row, allowed: Allowance) -> list[Exceedance]:
    old, new = (with_unit(row[column], column) or NOTHING for row in (before, now))
    if unit_of(column) is None or not before[column] or not now[column]:
        return [Exceedance(name, column, old, new)]
    reference, most = float(before[column]), allowed(before, column)
    deviation = abs(float(now[column]) - reference)
    if deviation <= most:
        return []
    relative = deviation / abs(reference) if reference else math.inf
    share = relative if math.isfinite(relative) else None
    return [Exceedance(name, column, old, new, deviation, most, share)]
