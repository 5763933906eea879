"""Folders that hold results to compare: whole runs, and baselines, of which only what is compared is kept."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tpm_design.errors import UsageError
from tpm_design.runs.folder import DESIGNS, LOG, STUDY, SUMMARY, TABLE, UNFINISHED, read_summary
from tpm_design.study.document import read_document
from tpm_design.study.plain import flow_yaml

LONGEST_VALUE = 60
MOST_DIFFERENCES = 4

NOT_ENDED = {"interrupted", UNFINISHED}
"""Endings in run.json of runs that have no result yet."""

NOT_ASKED = {"optimizer", "mechanism.sha256"}
"""Parts of a study that say how it is answered: by which search, with which version of its own mechanism."""


@dataclass(frozen=True)
class Result:
    """A folder with the result of a finished run. ``study``: as it stands in study.yaml, nothing of which is
    executed; ``summary``: run.json."""

    folder: Path
    study: Mapping[str, Any]
    summary: Mapping[str, Any]

    @property
    def name(self) -> str:
        return str(self.study.get("name", ""))

    @property
    def is_sweep(self) -> bool:
        return "sweep" in self.summary

    @property
    def file(self) -> str:
        """The table that holds the result: every evaluation of a sweep, the designs of a search."""
        return TABLE if self.is_sweep else DESIGNS


def read_result(folder: Path) -> Result:
    """The result in a run folder or a baseline. Raises UsageError where there is none or the run is not
    finished, StudyError for its study."""
    if not (folder / STUDY).is_file():
        raise UsageError(
            "There is no result here.",
            where=str(folder),
            remedy=f"A run or a baseline holds {STUDY}, {SUMMARY} and {DESIGNS} or {TABLE}.",
        )
    summary = read_summary(folder)
    if not summary or summary.get("ending") in NOT_ENDED:
        raise UsageError(
            "This run did not come to its end.",
            where=str(folder / SUMMARY),
            remedy="Name one that did; this file says how each ended.",
        )
    result = Result(folder, read_document(folder / STUDY).data, summary)
    if not (folder / result.file).is_file():
        raise UsageError(
            f"There is no {result.file} here.",
            where=str(folder),
            remedy="Restore the folder from a copy, or run the study again.",
        )
    return result


def check_same_kind(baseline: Result, run: Result) -> None:
    """Raises UsageError where one is a sweep and the other is not."""
    if baseline.is_sweep != run.is_sweep:
        raise UsageError(
            "Only one of these is a sweep.",
            where=f"{baseline.folder} and {run.folder}",
            remedy="Compare a search with a search, and a sweep with a sweep.",
        )


def check_same_question(baseline: Result, run: Result) -> None:
    """Raises UsageError where the two studies ask something else."""
    ignored = NOT_ASKED if run.is_sweep else NOT_ASKED | {"sweep"}
    found = [text for place, text in differences(baseline.study, run.study) if not _below(place, ignored)]
    if found:
        more = f"; and {len(found) - MOST_DIFFERENCES} more" if len(found) > MOST_DIFFERENCES else ""
        raise UsageError(
            f"The studies ask something else: {'; '.join(found[:MOST_DIFFERENCES])}{more}.",
            where=f"{baseline.folder} and {run.folder}",
            remedy="Compare runs of one study, or make this run the baseline with --update-baseline.",
        )


def remarks_on(baseline: Result, run: Result) -> tuple[str, ...]:
    """What may explain deviations, one line each: another search, shard, version or machine."""
    lines = []
    for title, before, now in (
        ("Searched otherwise", *(_only(result.study, "optimizer") for result in (baseline, run))),
        ("Another part", *(_only(result.summary.get("sweep"), "shard") for result in (baseline, run))),
        ("Other versions", *(_only(result.summary, "versions") for result in (baseline, run))),
        ("Another machine", *(_only(result.summary, "machine") for result in (baseline, run))),
    ):
        found = [text for _, text in differences(before, now)]
        if found:
            lines.append(f"{title}: {'; '.join(found)}.")
    return tuple(lines)


def _only(data: Any, key: str) -> dict[str, Any]:
    return {key: data.get(key) if isinstance(data, Mapping) else None}


def differences(before: Any, now: Any, place: str = "") -> Iterator[tuple[str, str]]:
    """Places at which two pieces of plain data differ, ``region.size``, and a line on each."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in dict.fromkeys((*before, *now)):
            below = f"{place}.{key}" if place else str(key)
            yield from differences(before.get(key), now.get(key), below)
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for number, (old, new) in enumerate(zip(before, now, strict=True), start=1):
            yield from differences(old, new, f"{place}.{number}")
    elif before != now:
        yield place, f"{place} {_short(before)} → {_short(now)}"


def _short(value: Any) -> str:
    text = "(none)" if value is None else flow_yaml(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 1]}…"


def _below(place: str, places: set[str]) -> bool:
    return any(place == one or place.startswith(f"{one}.") for one in places)


def is_new(baseline: Path) -> bool:
    """Whether there is nothing yet where a baseline is to be."""
    return not baseline.exists() or (baseline.is_dir() and not any(baseline.iterdir()))


def check_replaceable(baseline: Path) -> None:
    """Raises UsageError where the folder is a whole run: its files belong together."""
    if (baseline / LOG).is_file():
        raise UsageError(
            f"This is a whole run, with {LOG}, and is not overwritten.",
            where=str(baseline),
            remedy=f"Name a folder that holds {STUDY}, {SUMMARY} and the table alone, or a new one.",
        )


def write_baseline(baseline: Path, run: Result) -> tuple[Path, ...]:
    """Copy what is compared of a run; the files written."""
    baseline.mkdir(parents=True, exist_ok=True)
    written = []
    for name in (STUDY, run.file, SUMMARY):
        part = baseline / f"{name}.part"
        shutil.copyfile(run.folder / name, part)
        os.replace(part, baseline / name)
        written.append(baseline / name)
    return tuple(written)
