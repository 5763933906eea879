"""`sweep` and `merge`."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tpm_design.cli.commands import worker_threads
from tpm_design.cli.evaluators import check_dask, evaluators
from tpm_design.cli.guard import INTERNAL, INTERRUPTED, POINTS_FAILED, complain
from tpm_design.cli.progress import sweep_progress
from tpm_design.cli.results import NO_VALUE, evaluation_data
from tpm_design.cli.text import table
from tpm_design.errors import UsageError
from tpm_design.problem import Goal
from tpm_design.runs.entry import Entry
from tpm_design.runs.folder import STUDY, TABLE
from tpm_design.runs.sweeps import WHOLE, Shard, failures
from tpm_design.runs.tables import goal_unit
from tpm_design.study import Study, load_study
from tpm_design.study.resuming import check_resumable, run_to_resume
from tpm_design.study.sweep_points import held_values, sweep_points
from tpm_design.study.sweeping import SweepRun, merge_runs, sweep_study

MOST_REASONS = 5


def sweep_one(
    path: Path,
    shard: str,
    workers: int | None,
    dask: str | None,
    resume: str | None,
    output: Path,
    *,
    allow_code: bool,
    as_json: bool,
    quiet: bool,
) -> int | None:
    part, threads = _shard(shard), worker_threads(workers)
    study = load_study(path, allow_code=allow_code)
    folder = None if resume is None else run_to_resume(study, resume, output, part)
    if folder is not None:
        check_resumable(study, folder, part)
    check_dask(dask, workers, [study])
    held, count = held_values(study), len(sweep_points(study, part))
    if held and not (quiet or as_json):
        print("Held: " + "; ".join(held) + ".\n")
    with (
        evaluators(dask, threads) as executor,
        sweep_progress(count, quiet=quiet or as_json) as watch,
    ):
        run = sweep_study(
            study,
            shard=part,
            executor=executor,
            output=output,
            watch=watch,
            resume=folder,
        )
    return _told(study, run, part, as_json=as_json)


def merge_shards(runs: Sequence[Path], output: Path, *, allow_code: bool, as_json: bool) -> int | None:
    study, run = merge_runs(runs, output=output, allow_code=allow_code)
    return _told(study, run, WHOLE, as_json=as_json)


def _shard(text: str) -> Shard:
    numbers = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
    if numbers is None:
        raise UsageError(f"{text!r} is no shard.", where="--shard", remedy="Write i/n, such as 1/4.")
    return Shard(int(numbers[1]), int(numbers[2]))


def _told(study: Study, run: SweepRun, shard: Shard, *, as_json: bool) -> int | None:
    """Print how a sweep ended; its exit code."""
    result = run.result
    print(json.dumps(_data(study, run), ensure_ascii=False) if as_json else _text(study, run, shard))
    if result.ending == "interrupted":
        return INTERRUPTED
    if result.faults:
        # the guard knows whose bug it is and what to send
        raise result.faults[min(result.faults)]
    if result.disagreements:
        complain(
            "This is a bug, of the program or of the mechanism's own file: an evaluation depends on more "
            f"than its design.\n  Please report it with the study and {run.folder}."
        )
        return INTERNAL
    return POINTS_FAILED if failures(result.entries) else None


def _data(study: Study, run: SweepRun) -> dict[str, Any]:
    found = [entry.evaluation.status for entry in run.result.entries]
    data: dict[str, Any] = {"study": study.name, "run": str(run.folder), "status": run.status}
    data |= {status: found.count(status) for status in ("feasible", "infeasible", "failed")}
    data["reasons"] = [
        {"reason": failure.reason, "points": failure.count, "first": failure.first}
        for failure in failures(run.result.entries)
    ]
    data["disagreements"] = list(run.result.disagreements)
    if run.best is not None:
        best = evaluation_data(study.problem, study.units, run.best.evaluation)
        data["best"] = {"id": run.best.number, **best}
    return data


def _text(study: Study, run: SweepRun, shard: Shard) -> str:
    entries = run.result.entries
    problem = study.problem
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    rows = [_metric_row(study, entries, goal) for goal in goals]
    parts = [table(["metric", "least", "at point", "greatest", "at point", "without value"], rows)]
    parts += _failure_lines(entries)
    allow = " --allow-code" if study.plug_in else ""
    lines = [run.status, f"Run: {run.folder}", f"Next: tpm-design {_following(run, shard)}{allow}"]
    if run.best is not None and run.best.evaluation.status == "feasible":
        reached = [f"{goal.label} {_reached(study, run.best, goal)}" for goal in problem.objectives]
        lines.insert(1, f"Best feasible design: {', '.join([f'point {run.best.number}', *reached])}.")
    elif run.best is not None and run.best.evaluation.status == "infeasible":
        missed = [label for label, slack in run.best.evaluation.slacks.items() if slack < 0.0]
        lines.insert(
            1,
            f"No point is feasible; the closest, point {run.best.number}, misses {', '.join(missed)}. "
            "What is held may lie badly: choose it in the study, or sweep it too.",
        )
    return "\n\n".join([*parts, "\n".join(lines)])


def _reached(study: Study, entry: Entry, goal: Goal) -> str:
    return study.units.written(entry.evaluation.metrics[goal.label], goal_unit(study.problem, goal))


def _following(run: SweepRun, shard: Shard) -> str:
    """What to do next."""
    if run.result.ending != "interrupted" or run.folder is None:
        return f"report {run.folder}"
    part = "" if shard == WHOLE else f" --shard {shard}"
    return f"sweep {run.folder / STUDY} --resume {run.folder}{part}"


def _metric_row(study: Study, entries: Sequence[Entry], goal: Goal) -> list[str]:
    unit = goal_unit(study.problem, goal)
    values = [(entry.evaluation.metrics.get(goal.label, math.nan), entry.number) for entry in entries]
    finite = [pair for pair in values if math.isfinite(pair[0])]
    missing = str(len(values) - len(finite))
    if not finite:
        return [goal.label, NO_VALUE, "", NO_VALUE, "", missing]
    least, greatest = min(finite), max(finite, key=lambda pair: (pair[0], -pair[1]))
    return [
        goal.label,
        study.units.written(least[0], unit),
        str(least[1]),
        study.units.written(greatest[0], unit),
        str(greatest[1]),
        missing,
    ]


def _failure_lines(entries: Sequence[Entry]) -> list[str]:
    found = failures(entries)
    if not found:
        return []
    lines = [f"{sum(failure.count for failure in found)} of {len(entries)} points failed:"]
    for failure in found[:MOST_REASONS]:
        points = f"point {failure.first}" if failure.count == 1 else f"{failure.count} points"
        first = "" if failure.count == 1 else f", the first of them {failure.first}"
        lines.append(f"  {points}{first}: {failure.reason}")
    if len(found) > MOST_REASONS:
        lines.append(f"  {len(found) - MOST_REASONS} more reasons in {TABLE}")
    return ["\n".join(lines)]
