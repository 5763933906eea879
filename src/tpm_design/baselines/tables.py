"""designs.csv and evaluations.csv read back as they stand: text cells under headings with units."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tpm_design.errors import UsageError
from tpm_design.runs.folder import DESIGNS, TABLE

KEYS = {DESIGNS: "rank", TABLE: "id"}
"""The column that says which rows belong together."""

STORIES = {DESIGNS: {"id"}, TABLE: {"seconds [s]"}}
"""Columns that tell how a result came about; they are no part of it."""

_UNIT = re.compile(r"(?s).+ \[([^\[\]]+)\]\Z")
_ERROR = re.compile(r"(?s)(.+) error (\[[^\[\]]+\])\Z")
_RANK = re.compile(r"[0-9]{1,18}\Z")

Row = Mapping[str, str]
"""Heading → cell."""


@dataclass(frozen=True)
class ResultTable:
    """``file``: its name. ``headings``: the columns that are results, in order. ``rows``: key → every cell,
    in the order of the keys. Cells under a heading with a unit are empty or finite numbers."""

    file: str
    headings: tuple[str, ...]
    rows: Mapping[int, Row]

    @property
    def key(self) -> str:
        return KEYS[self.file]


def unit_of(heading: str) -> str | None:
    """The unit of a column of numbers, ``f [mm]`` → ``mm``; None for a column of text."""
    match = _UNIT.match(heading)
    return match[1] if match else None


def with_unit(cell: str, heading: str) -> str:
    """A cell for people: ``310.58 mm``; numbers without a dimension and text stand alone."""
    unit = unit_of(heading)
    return f"{cell} {unit}" if cell and unit not in (None, "-") else cell


def metric_of_error(heading: str) -> str | None:
    """The column whose numeric error this one holds, ``f error [mm]`` → ``f [mm]``; None for any other."""
    match = _ERROR.match(heading)
    return f"{match[1]} {match[2]}" if match else None


def read_table(path: Path) -> ResultTable:
    """One of the two tables. Raises UsageError with the line for everything that is not one."""
    return parse_table(path.read_text(encoding="utf-8-sig", errors="replace"), path)


def parse_table(text: str, path: Path) -> ResultTable:
    """As ``read_table``, of the text of the file ``path``."""
    key = KEYS[path.name]
    rows: dict[int, Row] = {}
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        headings = next(reader, [])
        for name in (key, "status"):
            if headings.count(name) != 1:
                raise _damaged(f"there is no column {name!r}", path, 1)
        twice = next((name for name in headings if headings.count(name) > 1), None)
        if twice is not None:
            raise _damaged(f"the column {twice!r} is there twice", path, 1)
        for cells in reader:
            line = reader.line_num
            if len(cells) != len(headings):
                raise _damaged(f"{len(cells)} cells under {len(headings)} headings", path, line)
            row = dict(zip(headings, cells, strict=True))
            for heading, cell in row.items():
                if unit_of(heading) is not None and not _is_finite(cell):
                    raise _damaged(f"{cell!r} under {heading!r} is not a number", path, line)
            if not _RANK.match(row[key]):
                raise _damaged(f"{row[key]!r} under {key!r} is not a whole number", path, line)
            if int(row[key]) in rows:
                raise _damaged(f"{key} {row[key]} is there twice", path, line)
            rows[int(row[key])] = row
    except csv.Error as error:
        raise _damaged(str(error), path, reader.line_num) from None
    stories = STORIES[path.name] | {key}
    return ResultTable(
        path.name, tuple(name for name in headings if name not in stories), dict(sorted(rows.items()))
    )


def _is_finite(cell: str) -> bool:
    try:
        return not cell or math.isfinite(float(cell))
    except ValueError:
        return False


def _damaged(what: str, path: Path, line: int) -> UsageError:
    return UsageError(
        f"This table cannot be compared: {what}.",
        where=f"{path}:{line}",
        remedy="Restore the file from a copy, or run the study again.",
    )
