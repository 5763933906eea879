"""The run folder: what a run leaves behind, written so that nothing is lost when it is cut short."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic_core import from_json, to_json

from tpm_design.errors import UsageError, unwritable
from tpm_design.evaluation.result import Cutoff, Evaluation
from tpm_design.problem import Problem
from tpm_design.runs.durable import AppendedLines, replace_file
from tpm_design.runs.entry import Entry
from tpm_design.runs.tables import EvaluationTable, csv_line, designs_table
from tpm_design.units import Units

STUDY, TABLE, LOG, DESIGNS, SUMMARY = (
    "study.yaml",
    "evaluations.csv",
    "evaluations.jsonl",
    "designs.csv",
    "run.json",
)
UNFINISHED = "unfinished"
"""``ending`` in run.json from the start of a run until it is over."""

LIBRARIES = ("tpm-design", "numpy", "scipy", "numba", "nlopt", "pymoo", "pandas")


def create_run_folder(results: Path, study_name: str, study_hash: str) -> Path:
    """A new folder ``results/<study>/<UTC time>-<6 hex>``. Raises UsageError where it cannot be written."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    parent = results / study_name
    for attempt in range(1000):
        suffix = f"-{attempt + 1}" if attempt else ""
        folder = parent / f"{stamp}-{study_hash[:6]}{suffix}"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise unwritable(
                "The run folder cannot be made", error, parent, "Choose another folder with --output."
            ) from None
        return folder
    raise UsageError("Too many runs began in this second.", where=str(parent), remedy="Try again.")


class RunWriter:
    """Writes a run as it happens. ``record`` hands one evaluation to both logs.

    ``stored``: what the log of a run that goes on holds already. ``told``: for run.json as long as the run is
    not over. The log is only ever appended to, or replaced as a whole. Everything here raises RunStoppedError
    where a file cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        problem: Problem,
        units: Units,
        study_text: str,
        stored: Sequence[Entry] = (),
        told: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self.folder = folder
        self._problem, self._units = problem, units
        self._rows = EvaluationTable(problem, units)
        status = "The run is not over, or was cut short; --resume goes on."
        unfinished = {"status": status, "ending": UNFINISHED, **told, **provenance()}
        replace_file(folder / STUDY, study_text)
        replace_file(folder / SUMMARY, _summary_text(unfinished))
        # what was cut short at its end is gone from here on
        self._write_logs(stored)
        self._log, self._table = AppendedLines(folder / LOG), AppendedLines(folder / TABLE)

    def record(self, entry: Entry) -> None:
        """Append one evaluation and hand it to the operating system."""
        self._log.append(_log_line(entry))
        self._table.append(csv_line(self._rows.row(entry)))

    def close(self) -> None:
        """Leave both logs as they are."""
        self._log.close()
        self._table.close()

    def finish(
        self,
        entries: Sequence[Entry],
        result: Sequence[Entry],
        summary: Mapping[str, Any],
        *,
        ranked: bool = True,
    ) -> None:
        """Put both logs in order of ids, complete where a record was interrupted, and write the result,
        ``ranked`` or not as ``designs_table`` takes it."""
        self.close()
        self._write_logs(sorted(entries, key=lambda entry: entry.number))
        replace_file(self.folder / DESIGNS, designs_table(self._problem, self._units, result, ranked=ranked))
        replace_file(self.folder / SUMMARY, _summary_text(summary))

    def _write_logs(self, entries: Sequence[Entry]) -> None:
        text = csv_line(self._rows.headings()) + "".join(csv_line(self._rows.row(e)) for e in entries)
        replace_file(self.folder / LOG, "".join(map(_log_line, entries)))
        replace_file(self.folder / TABLE, text)


def _summary_text(summary: Mapping[str, Any]) -> str:
    return json.dumps(summary, indent=2, ensure_ascii=False) + "\n"


def _log_line(entry: Entry) -> str:
    # floats as exact as by json, in a fifth of its time
    return to_json(entry_to_json(entry), inf_nan_mode="constants").decode() + "\n"


def entry_to_json(entry: Entry) -> dict[str, Any]:
    """An evaluation with exact floats; a violation without a number becomes null."""
    # a copy of everything, as asdict makes it, takes longer than all the rest
    data = dict(vars(entry.evaluation))
    data["violation"] = data["violation"] if math.isfinite(data["violation"]) else None
    data["metrics"] = {k: v if math.isfinite(v) else None for k, v in data["metrics"].items()}
    data["errors"] = {k: v if math.isfinite(v) else None for k, v in data["errors"].items()}
    cutoff = data.pop("cutoff")
    if cutoff is not None:
        data["cutoff"] = asdict(cutoff)
    if data["slopes"] is None:
        del data["slopes"]
    judged_by = {"judged_by": entry.judged_by} if entry.judged_by else {}
    return {"id": entry.number, "round": entry.round, **judged_by, **data}


def entry_from_json(data: Mapping[str, Any]) -> Entry:
    """The inverse of ``entry_to_json``."""
    fields = {key: value for key, value in data.items() if key not in ("id", "round", "judged_by")}
    fields["violation"] = math.inf if fields["violation"] is None else fields["violation"]
    for key in ("metrics", "errors"):
        fields[key] = {k: math.nan if v is None else v for k, v in fields[key].items()}
    fields["cutoff"] = None if fields.get("cutoff") is None else Cutoff(**fields["cutoff"])
    fields["pieces"] = {label: tuple(values) for label, values in fields["pieces"].items()}
    if "slopes" in fields:
        fields["slopes"] = {label: tuple(map(tuple, rows)) for label, rows in fields["slopes"].items()}
    round_number, judged_by = int(data.get("round", 1)), str(data.get("judged_by", ""))
    return Entry(int(data["id"]), Evaluation(**fields), round_number, judged_by)


@dataclass(frozen=True)
class StoredRun:
    """A run read back. ``summary``: the contents of run.json, empty for a run that was cut short."""

    folder: Path
    entries: tuple[Entry, ...]
    summary: Mapping[str, Any]

    @property
    def best(self) -> Entry | None:
        """The entry run.json names as best."""
        number = self.summary.get("best_id")
        return next((entry for entry in self.entries if entry.number == number), None)


def check_is_run(folder: Path) -> None:
    """Raises UsageError where there is no run in ``folder``."""
    if not (folder / STUDY).is_file() or not (folder / LOG).is_file():
        raise UsageError(
            "This is not a run folder.",
            where=str(folder),
            remedy=f"A run has {STUDY} and {LOG}; `optimize` writes one under results/.",
        )


def read_run(folder: Path) -> StoredRun:
    """A run from its folder. A last log line that was cut short is ignored. Raises UsageError."""
    check_is_run(folder)
    entries = []
    lines = (folder / LOG).read_text(encoding="utf-8", errors="replace").split("\n")
    for number, line in enumerate(lines, start=1):
        if not line:
            continue
        try:
            entries.append(entry_from_json(from_json(line)))
        except (ValueError, KeyError, TypeError):
            if number == len(lines):
                break
            raise UsageError(
                "This line of the log is damaged.",
                where=f"{folder / LOG}:{number}",
                remedy="Remove the line and resume the run: its design is evaluated again.",
            ) from None
    summary = read_summary(folder)
    finished = {} if summary.get("ending") == UNFINISHED else summary
    return StoredRun(folder, tuple(sorted(entries, key=lambda e: e.number)), finished)


def written_by(folder: Path) -> str:
    """The version of tpm-design that began a run or resumed it last. Raises UsageError."""
    versions = read_summary(folder).get("versions", {})
    return str(versions.get("tpm-design", "of an unknown version"))


def read_summary(folder: Path) -> Mapping[str, Any]:
    """The contents of run.json, empty where there is none. Raises UsageError where it is damaged."""
    path = folder / SUMMARY
    if not path.is_file():
        return {}
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        raise UsageError("This file is damaged.", where=str(path), remedy="Run the study again.") from None
    return data if isinstance(data, dict) else {}


def newest_run(
    results: Path, study_name: str = "*", *, wanted: Callable[[Path], bool] = lambda folder: True
) -> Path:
    """The run folder begun last under ``results``, of any study or of one, among those ``wanted``. Raises
    UsageError where there is none."""
    found = [path.parent for path in results.glob(f"{study_name}/*/{LOG}")]
    for folder in sorted(found, key=lambda folder: folder.name, reverse=True):
        if wanted(folder):
            return folder
    raise UsageError(
        "There is no run here." if study_name == "*" else f"There is no run of {study_name} here.",
        where=str(results),
        remedy="Run `tpm-design optimize STUDY` or `tpm-design sweep STUDY` first.",
    )


def provenance() -> dict[str, Any]:
    """Versions and machine, for run.json."""
    return {
        "versions": {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}},
        "machine": {
            "system": platform.system(),
            "architecture": platform.machine(),
            "processors": os.cpu_count(),
        },
    }
