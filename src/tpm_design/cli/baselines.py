"""`compare` and `reproduce`: what deviates, and the exit code that tells continuous integration."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tpm_design.baselines.deviations import Deviations, Tolerance, compare_tables
from tpm_design.baselines.folders import (
    Result,
    check_replaceable,
    check_same_kind,
    check_same_question,
    is_new,
    read_result,
    remarks_on,
    write_baseline,
)
from tpm_design.baselines.junit import junit_xml
from tpm_design.baselines.reproduction import SAME_TO, reproduce
from tpm_design.baselines.tables import read_table
from tpm_design.baselines.verdicts import with_verdicts
from tpm_design.baselines.words import (
    HEADINGS,
    comparison_markdown,
    counts_text,
    exceedance_cells,
    outcome_text,
    tolerance_text,
)
from tpm_design.cli.guard import OUTSIDE_TOLERANCE
from tpm_design.cli.text import table
from tpm_design.errors import UsageError, unwritable_file


def compare_runs(
    baseline_folder: Path,
    run_folder: Path,
    tolerance: Tolerance,
    junit: Path | None,
    markdown: Path | None,
    *,
    update: bool,
    as_json: bool,
    quiet: bool,
) -> int | None:
    for option, value in (("--rtol", tolerance.relative), ("--atol", tolerance.absolute)):
        if not (math.isfinite(value) and value >= 0.0):
            raise UsageError(f"{value} is no tolerance.", where=option, remedy="Choose a number from 0.")
    run = read_result(run_folder)
    if baseline_folder.exists() and baseline_folder.samefile(run_folder):
        raise UsageError(
            "A run is always equal to itself.", where=str(run_folder), remedy="Name two different folders."
        )
    if update:
        check_replaceable(baseline_folder)
        if is_new(baseline_folder):
            return _new_baseline(baseline_folder, run, as_json=as_json)
    baseline = read_result(baseline_folder)
    check_same_kind(baseline, run)
    if update and baseline.name != run.name:
        raise UsageError(
            f"The baseline is of the study {baseline.name!r}, the run of {run.name!r}.",
            where=str(baseline_folder),
            remedy="Name the folder of this study's baseline, or a new one.",
        )
    if not update:
        check_same_question(baseline, run)
    before, now = (read_table(result.folder / result.file) for result in (baseline, run))
    if not before.rows and not now.rows:
        raise UsageError(
            "There is nothing to compare: both tables are empty.", where=str(run_folder / run.file)
        )
    found = compare_tables(before, now, tolerance.allowed)
    found = with_verdicts(found, baseline.summary, run.summary)
    remarks = remarks_on(baseline, run)
    if junit is not None:
        _write(junit, junit_xml(found, run.name, remarks, datetime.now(UTC)))
    if markdown is not None:
        _write(markdown, comparison_markdown(found, run.name, tolerance, remarks, update))
    written = write_baseline(baseline_folder, run) if update else ()
    if as_json:
        data = {
            "baseline": str(baseline_folder),
            "run": str(run_folder),
            "study": run.name,
            "rtol": tolerance.relative,
            "atol": tolerance.absolute,
            **_data(found),
            "remarks": list(remarks),
            "written": [str(path) for path in written],
        }
        print(json.dumps(data, ensure_ascii=False))
    else:
        allowed = f"Allowed: {tolerance_text(tolerance)}."
        _show(found, f"{run.name}: {outcome_text(found)}", [allowed, *remarks], quiet=quiet)
        _show_written(written, run)
    return None if found.within or update else OUTSIDE_TOLERANCE


def _new_baseline(folder: Path, run: Result, *, as_json: bool) -> int | None:
    read_table(run.folder / run.file)
    written = write_baseline(folder, run)
    if as_json:
        data = {"baseline": str(folder), "run": str(run.folder), "written": [str(path) for path in written]}
        print(json.dumps(data, ensure_ascii=False))
    else:
        _show_written(written, run)
    return None


def reproduce_run(folder: Path, *, allow_code: bool, as_json: bool, quiet: bool) -> int | None:
    found = reproduce(folder, allow_code=allow_code)
    if as_json:
        print(json.dumps({"run": str(folder), **_data(found)}, ensure_ascii=False))
    else:
        allowed = f"Allowed: the larger of {SAME_TO:g} of the stored value and its numeric error."
        outcome = "reproduced" if found.within else f"not reproduced, {outcome_text(found)}"
        _show(found, f"{folder}: {outcome}", [allowed], quiet=quiet)
    return None if found.within else OUTSIDE_TOLERANCE


def _data(found: Deviations) -> dict[str, Any]:
    exceedances = [asdict(exceedance) for exceedance in found.exceedances]
    for data in exceedances:
        if data["deviation"] is not None and not math.isfinite(data["deviation"]):
            data["deviation"] = None
    return {
        "within": found.within,
        "file": found.file,
        "rows": found.rows,
        "columns": list(found.columns),
        "values": found.cells,
        "identical": found.identical,
        "exceedances": exceedances,
    }


def _show(found: Deviations, outcome: str, remarks: Sequence[str], *, quiet: bool) -> None:
    if found.exceedances:
        print(table(HEADINGS, [exceedance_cells(exceedance) for exceedance in found.exceedances]))
        print()
    if found.exceedances or not quiet:
        print("\n".join([f"{outcome} ({counts_text(found)}).", *remarks]))


def _show_written(paths: Sequence[Path], run: Result) -> None:
    if paths:
        print(f"Baseline written from {run.folder}:")
        print("\n".join(str(path) for path in paths))


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise unwritable_file(error, path) from None
