"""The run folder: what a run leaves behind, written so that nothing is lost when it is cut short."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, TextIO

from tpm_design.errors import UsageError
from tpm_design.problem import Evaluation, Problem
from tpm_design.runs.search import Entry
from tpm_design.runs.tables import EvaluationTable, csv_line, designs_table
from tpm_design.units import Units

STUDY, TABLE, LOG, DESIGNS, SUMMARY = (
    "study.yaml",
    "evaluations.csv",
    "evaluations.jsonl",
    "designs.csv",
    "run.json",
)
LIBRARIES = ("tpm-design", "numpy", "scipy", "numba", "nlopt", "pandas")


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
            raise UsageError(
                f"The run folder cannot be made: {error.strerror}.",
                where=str(parent),
                remedy="Choose another folder with --output.",
            ) from None
        return folder
    raise UsageError("Too many runs began in this second.", where=str(parent), remedy="Try again.")


class RunWriter:
    """Writes a run as it happens. ``record`` flushes one evaluation to both logs."""

    def __init__(self, folder: Path, problem: Problem, units: Units, study_text: str) -> None:
        self.folder = folder
        self._problem, self._units = problem, units
        self._rows = EvaluationTable(problem, units)
        (folder / STUDY).write_text(study_text, encoding="utf-8")
        self._table: TextIO = (folder / TABLE).open("w", encoding="utf-8", newline="")
        self._log: TextIO = (folder / LOG).open("w", encoding="utf-8")
        self._table.write(csv_line(self._rows.headings()))
        self._table.flush()

    def record(self, entry: Entry) -> None:
        """Append one evaluation and hand it to the operating system."""
        self._log.write(_log_line(entry))
        self._table.write(csv_line(self._rows.row(entry)))
        self._log.flush()
        self._table.flush()

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
        self._table.close()
        self._log.close()
        ordered = sorted(entries, key=lambda entry: entry.number)
        text = csv_line(self._rows.headings()) + "".join(csv_line(self._rows.row(e)) for e in ordered)
        _replace(self.folder / TABLE, text)
        _replace(self.folder / LOG, "".join(map(_log_line, ordered)))
        _replace(self.folder / DESIGNS, designs_table(self._problem, self._units, result, ranked=ranked))
        _replace(self.folder / SUMMARY, json.dumps(summary, indent=2, ensure_ascii=False) + "\n")


def _replace(path: Path, text: str) -> None:
    """Write a whole file at once, so that a crash leaves the old one or the new one."""
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)


def _log_line(entry: Entry) -> str:
    return json.dumps(entry_to_json(entry), ensure_ascii=False) + "\n"


def entry_to_json(entry: Entry) -> dict[str, Any]:
    """An evaluation with exact floats; a violation without a number becomes null."""
    data = asdict(entry.evaluation)
    data["violation"] = data["violation"] if math.isfinite(data["violation"]) else None
    data["metrics"] = {k: v if math.isfinite(v) else None for k, v in data["metrics"].items()}
    data["errors"] = {k: v if math.isfinite(v) else None for k, v in data["errors"].items()}
    return {"id": entry.number, "round": entry.round, **data}


def entry_from_json(data: Mapping[str, Any]) -> Entry:
    """The inverse of ``entry_to_json``."""
    fields = {key: value for key, value in data.items() if key not in ("id", "round")}
    fields["violation"] = math.inf if fields["violation"] is None else fields["violation"]
    for key in ("metrics", "errors"):
        fields[key] = {k: math.nan if v is None else v for k, v in fields[key].items()}
    fields["pieces"] = {label: tuple(values) for label, values in fields["pieces"].items()}
    return Entry(int(data["id"]), Evaluation(**fields), int(data.get("round", 1)))


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


def read_run(folder: Path) -> StoredRun:
    """A run from its folder. A last log line that was cut short is ignored. Raises UsageError."""
    if not (folder / STUDY).is_file() or not (folder / LOG).is_file():
        raise UsageError(
            "This is not a run folder.",
            where=str(folder),
            remedy=f"A run has {STUDY} and {LOG}; `optimize` writes one under results/.",
        )
    entries = []
    lines = (folder / LOG).read_text(encoding="utf-8", errors="replace").split("\n")
    for number, line in enumerate(lines, start=1):
        if not line:
            continue
        try:
            entries.append(entry_from_json(json.loads(line)))
        except (ValueError, KeyError, TypeError):
            if number == len(lines):
                break
            raise UsageError(
                "This line of the log is damaged.",
                where=f"{folder / LOG}:{number}",
                remedy="Restore the run from a copy, or run the study again.",
            ) from None
    return StoredRun(folder, tuple(sorted(entries, key=lambda e: e.number)), _read_summary(folder))


def _read_summary(folder: Path) -> Mapping[str, Any]:
    path = folder / SUMMARY
    if not path.is_file():
        return {}
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        raise UsageError("This file is damaged.", where=str(path), remedy="Run the study again.") from None
    return data if isinstance(data, dict) else {}


def newest_run(results: Path) -> Path:
    """The run folder begun last under ``results``. Raises UsageError where there is none."""
    found = [path.parent for path in results.glob(f"*/*/{LOG}")]
    if not found:
        raise UsageError(
            "There is no run here.", where=str(results), remedy="Run `tpm-design optimize STUDY` first."
        )
    return max(found, key=lambda folder: folder.name)


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


def text_hash(text: str) -> str:
    """SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()
