"""A sweep from plan to run folder, whole or in shards that are merged."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tpm_design.digests import text_sha256
from tpm_design.errors import UsageError
from tpm_design.runs.entry import Entry
from tpm_design.runs.executors import Executor
from tpm_design.runs.folder import (
    STUDY,
    SUMMARY,
    RunWriter,
    StoredRun,
    create_run_folder,
    provenance,
    read_run,
)
from tpm_design.runs.lock import sole_writer
from tpm_design.runs.ranking import best_entry
from tpm_design.runs.sweeps import WHOLE, Point, Shard, SweepResult, sweep
from tpm_design.study.plain import dump_yaml
from tpm_design.study.resolve import load_study
from tpm_design.study.resuming import check_resumable
from tpm_design.study.study import Study
from tpm_design.study.sweep_points import plan_of_sweep, plan_size, sweep_points

MOST_NUMBERS = 10


@dataclass(frozen=True)
class SweepRun:
    """A sweep that ended. ``best``: the best feasible entry by the first objective, else the one of least
    violation; None for a shard without points. ``folder``: None if not written."""

    result: SweepResult
    best: Entry | None
    status: str
    folder: Path | None


def sweep_study(
    study: Study,
    *,
    shard: Shard,
    executor: Executor,
    output: Path | None,
    watch: Callable[[Entry], None] = lambda entry: None,
    resume: Path | None = None,
) -> SweepRun:
    """Evaluate the study's plan, or one shard of it; with ``output`` the run is written below it as it
    happens. ``watch`` sees each evaluation. ``resume``: a run folder to go on in instead of a new one.
    ``executor``: who evaluates. Raises UsageError before anything runs,
    RunStoppedError where the run cannot be written."""
    points = sweep_points(study, shard)
    if resume is not None:
        check_resumable(study, resume, shard)
    folder = resume
    if folder is None and output is not None:
        folder = create_run_folder(output, study.name, study.study_hash)
    began = time.perf_counter()

    def swept(record: Callable[[Entry], None], stored: Sequence[Entry]) -> SweepResult:
        for entry in stored:
            watch(entry)
        return sweep(study.problem, points, executor=executor, record=record, stored=stored)

    if folder is None:
        return _ended(study, swept(watch, ()), shard, None)
    with sole_writer(folder):
        stored: tuple[Entry, ...] = ()
        if resume is not None:
            # only now can nobody else write to it
            check_resumable(study, folder, shard)
            stored = _of_these(points, read_run(folder).entries)
        with closing(_writer(study, folder, shard, stored)) as writer:

            def record(entry: Entry) -> None:
                writer.record(entry)
                watch(entry)

            run = _ended(study, swept(record, stored), shard, folder)
            told = {} if resume is None else {"resumed_after": len(stored)}
            _finish(
                writer,
                study,
                run,
                shard,
                told,
                workers=executor.workers,
                seconds=time.perf_counter() - began,
                merged=(),
            )
    return run


def _of_these(points: Sequence[Point], entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """The entries that belong to one of the points, each once."""
    designs = {point.number: _text(point.design) for point in points}
    found = {e.number: e for e in entries if designs.get(e.number) == _text(e.evaluation.design)}
    return tuple(found.values())


def merge_runs(folders: Sequence[Path], *, output: Path, allow_code: bool) -> tuple[Study, SweepRun]:
    """Join the shards of one sweep into a run that is the same, times aside, as if it had not been cut up.
    Gives the study too.

    Raises UsageError where a folder is no sweep that ended, the sweeps differ in study or version, a point
    is missing or is there twice, or a row belongs to another design than the plan's; StudyError and
    PlugInError for a study that cannot be used.
    """
    runs = [read_run(folder) for folder in folders]
    if not runs:
        raise UsageError("There is nothing to merge.", remedy="Give the run folders of all shards.")
    study = load_study(folders[0] / STUDY, allow_code=allow_code)
    plan = plan_of_sweep(study)
    for run in runs:
        _check_like_first(run, runs[0], study.study_hash)
    numbers = Counter(entry.number for run in runs for entry in run.entries)
    double = sorted(number for number, count in numbers.items() if count > 1)
    if double:
        holders = [str(run.folder) for run in runs if any(e.number == double[0] for e in run.entries)]
        raise UsageError(
            f"{_named(double)} there more than once, {double[0]} in {' and '.join(holders)}.",
            remedy="Give every shard once.",
        )
    missing = [number for number in range(plan_size(plan)) if number not in numbers]
    if missing:
        raise UsageError(
            f"{_named(missing)} in none of these runs: the plan has {plan_size(plan)}.",
            remedy="Give all shards; one that was interrupted must be run again.",
        )
    entries = sorted((entry for run in runs for entry in run.entries), key=lambda entry: entry.number)
    _check_designs(study, entries, runs)
    sweeps = [run.summary["sweep"] for run in runs]
    result = SweepResult(
        tuple(entries),
        sum(one["repeated"] for one in sweeps),
        tuple(sorted(number for one in sweeps for number in one["disagreements"])),
        "finished",
        {},
    )
    folder = create_run_folder(output, study.name, study.study_hash)
    with closing(_writer(study, folder, WHOLE, ())) as writer:
        merged = _ended(study, result, WHOLE, folder)
        _finish(
            writer,
            study,
            merged,
            WHOLE,
            {},
            workers=sum(int(run.summary["workers"]) for run in runs),
            seconds=sum(float(run.summary["seconds"]) for run in runs),
            merged=[run.folder.resolve().name for run in runs],
        )
    return study, merged


def _writer(study: Study, folder: Path, shard: Shard, stored: Sequence[Entry]) -> RunWriter:
    if study.plug_in is not None:
        study.plug_in.write_beside(folder / STUDY)
    told = {"sweep": {"points": plan_size(plan_of_sweep(study)), "shard": str(shard)}}
    return RunWriter(folder, study.problem, study.units, dump_yaml(study.resolved()), stored, told)


def _ended(study: Study, result: SweepResult, shard: Shard, folder: Path | None) -> SweepRun:
    best = best_entry(study.problem, result.entries)
    status = status_of_sweep(result, shard, plan_size(plan_of_sweep(study)))
    return SweepRun(result, best, status, folder)


def _finish(
    writer: RunWriter,
    study: Study,
    run: SweepRun,
    shard: Shard,
    told: Mapping[str, Any],
    *,
    workers: int,
    seconds: float,
    merged: Sequence[str],
) -> None:
    """Write what belongs to a run that ended; ``told``: more for run.json."""
    summary = _summary(study, run, shard) | {
        "workers": workers,
        "merged": list(merged),
        "study_hash": study.study_hash,
        "study_file_hash": text_sha256(dump_yaml(study.resolved())),
        **provenance(),
        **told,
        "seconds": round(seconds, 3),
    }
    writer.finish(run.result.entries, run.result.entries, summary, ranked=False)


def _summary(study: Study, run: SweepRun, shard: Shard) -> dict[str, Any]:
    result, best = run.result, run.best
    return {
        "status": run.status,
        "ending": result.ending,
        "best_id": None if best is None else best.number,
        "feasible": best is not None and best.evaluation.status == "feasible",
        "evaluations": len(result.entries),
        "failed": sum(entry.evaluation.status == "failed" for entry in result.entries),
        "sweep": {
            "points": plan_size(plan_of_sweep(study)),
            "shard": str(shard),
            "repeated": result.repeated,
            "disagreements": list(result.disagreements),
        },
    }


def status_of_sweep(result: SweepResult, shard: Shard, size: int) -> str:
    """How the sweep ended, in one or more sentences."""
    found = Counter(entry.evaluation.status for entry in result.entries)
    part = f" (shard {shard})" if shard.count > 1 else ""
    words = (
        f"{len(result.entries)} of {size} points{part} evaluated: {found['feasible']} feasible, "
        f"{found['infeasible']} infeasible, {found['failed']} failed."
    )
    if result.ending == "interrupted":
        words = f"The sweep was interrupted. {words}"
    if result.disagreements:
        words += (
            f" {_named(result.disagreements)} different when evaluated again: what is computed depends on "
            "more than the design."
        )
    elif result.repeated and result.ending == "finished":
        words += f" {result.repeated} evaluated again in reverse order: the same to the last bit."
    return words


def _named(numbers: Sequence[int]) -> str:
    """``Point 7 is``, ``Points 0, 3 and 6 are``, ``Points 0, 1, … (27 in all) are``."""
    if len(numbers) == 1:
        return f"Point {numbers[0]} is"
    if len(numbers) > MOST_NUMBERS:
        return f"Points {', '.join(map(str, numbers[:MOST_NUMBERS]))}, … ({len(numbers)} in all) are"
    return f"Points {', '.join(map(str, numbers[:-1]))} and {numbers[-1]} are"


def _check_like_first(run: StoredRun, first: StoredRun, study_hash: str) -> None:
    """Whether a run is a sweep that ended, of this study and by the same version as the first one."""
    summary: Mapping[str, Any] = run.summary
    where = str(run.folder)
    if not summary:
        raise UsageError(
            f"This run was cut short: it has no {SUMMARY}.", where=where, remedy="Run this shard again."
        )
    if not isinstance(summary.get("sweep"), dict):
        raise UsageError("This run is no sweep.", where=where, remedy="Give runs of `tpm-design sweep`.")
    if summary.get("study_hash") != study_hash:
        raise UsageError(
            "This run is of another study, or of another plan.",
            where=where,
            remedy=f"Give shards of one sweep; {first.folder} is the first.",
        )
    version, expected = (_version(one) for one in (run, first))
    if version != expected:
        raise UsageError(
            f"This run is by version {version}, {first.folder} by version {expected}.",
            where=where,
            remedy="Run all shards with one version.",
        )


def _version(run: StoredRun) -> str:
    versions = run.summary.get("versions")
    return str(versions.get("tpm-design")) if isinstance(versions, dict) else "unknown"


def _check_designs(study: Study, entries: Sequence[Entry], runs: Sequence[StoredRun]) -> None:
    """Whether each row belongs to the plan's point of its number."""
    points = sweep_points(study)
    for entry in entries:
        if entry.number >= len(points) or _text(points[entry.number].design) != _text(
            entry.evaluation.design
        ):
            holder = next(run for run in runs if entry in run.entries)
            raise UsageError(
                f"Row {entry.number} is not the plan's point {entry.number}.",
                where=str(holder.folder),
                remedy="Restore the run from a copy, or run this shard again.",
            )


def _text(design: Mapping[str, float | str]) -> str:
    return json.dumps(design, sort_keys=True)
