"""What the commands do. Each returns its exit code, None for 0."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from tpm_design.cli.comparison import comparison_text, worst_code, write_comparison
from tpm_design.cli.evaluators import check_dask, evaluators
from tpm_design.cli.front import front_data, front_text
from tpm_design.cli.guard import INTERRUPTED, NOT_PROVED, NOTHING_FEASIBLE
from tpm_design.cli.progress import search_progress
from tpm_design.cli.results import design_rows, evaluation_data, limit_text, result_text
from tpm_design.cli.text import table
from tpm_design.design_space import with_changes
from tpm_design.errors import UsageError, unwritable_file
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.mechanisms import mechanism_kind
from tpm_design.problem import Design
from tpm_design.report.local_optima import other_optima_text
from tpm_design.report.words import gap_text, pose_text, pose_unit_names
from tpm_design.runs.executors import SWITCH_INTERVAL, Executor
from tpm_design.runs.folder import STUDY, newest_run, read_run
from tpm_design.runs.optimality import gap_of
from tpm_design.runs.ranking import best_entry
from tpm_design.study import (
    Study,
    choose_design,
    dump_yaml,
    load_comparison,
    load_study,
    study_schema,
    template,
)
from tpm_design.study.actions import Run, check_search, optimize_study, pose_values
from tpm_design.study.resuming import LATEST, check_resumable, run_to_resume

RESULTS = Path("results")


def init_study(name: str, mechanism: str) -> int | None:
    text = template(name, mechanism_kind(mechanism))
    path = Path(f"{name}.yaml")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UsageError(
            "This file exists already.", where=str(path), remedy="Choose another name, or remove it."
        ) from None
    except OSError as error:
        raise unwritable_file(error, path) from None
    print(f"Wrote {path}. Next: tpm-design optimize {path}")
    return None


def validate_study(path: Path, *, resolved: bool, allow_code: bool, quiet: bool) -> int | None:
    comparison = load_comparison(path, allow_code=allow_code)
    if comparison is not None:
        for study in comparison.studies.values():
            check_search(study)
        if resolved:
            print("---\n".join(dump_yaml(study.resolved()) for study in comparison.studies.values()), end="")
        elif not quiet:
            print(f"{path} is valid: {', '.join(comparison.studies)}, asked the same.")
        return None
    study = load_study(path, allow_code=allow_code)
    if study.problem.variables:
        check_search(study)
    if resolved:
        print(dump_yaml(study.resolved()), end="")
    elif not quiet:
        problem = study.problem
        print(
            f"{path} is valid: {problem.kind.title}; free quantities: {len(problem.variables)}, "
            f"objectives: {len(problem.objectives)}, constraints: {len(problem.constraints)}."
        )
    return None


def print_schema() -> int | None:
    print(json.dumps(study_schema(), indent=2, ensure_ascii=False))
    return None


def open_study(path: Path, *, allow_code: bool) -> tuple[Study, Design | None]:
    """A study from its file, or from a run folder with the best design of the run, finished or not."""
    if not path.is_dir():
        return load_study(path, allow_code=allow_code), None
    run = read_run(path)
    study = load_study(path / STUDY, allow_code=allow_code)
    best = run.best or best_entry(study.problem, run.entries)
    if best is None:
        raise UsageError(
            "Nothing was evaluated in this run.", where=str(path), remedy="Evaluate its study.yaml instead."
        )
    return study, best.evaluation.design


def chosen_design(
    path: Path, settings: Sequence[str], *, allow_code: bool
) -> tuple[Study, Design, tuple[str, ...]]:
    """A study and one design of it: the run's best where ``path`` is a run, changed by ``--set``; and a line
    for each quantity that was assumed."""
    study, stored = open_study(path, allow_code=allow_code)
    given = _settings(settings)
    design, assumptions = choose_design(study, given)
    if stored is None:
        return study, design, assumptions
    return study, with_changes(study.problem, stored, {name: design[name] for name in given}), ()


def evaluate_one(
    path: Path, settings: Sequence[str], at: str | None, *, allow_code: bool, as_json: bool, quiet: bool
) -> int | None:
    study, design, assumptions = chosen_design(path, settings, allow_code=allow_code)
    pose = None if at is None else _pose(study, at)
    if pose is not None:
        return _print_pose(study, design, pose, as_json=as_json)
    result = evaluate(study.problem, design)
    if as_json:
        data = {"study": study.name, "assumed": list(assumptions)}
        print(json.dumps({**data, **evaluation_data(study.problem, study.units, result)}, ensure_ascii=False))
        return None
    if assumptions and not quiet:
        print("Assumed: " + "; ".join(assumptions) + ".\n")
    print(result_text(study.problem, study.units, result))
    if result.status != "failed":
        print(f"\nThis design is {result.status}; violation {result.violation:.4g}.")
    return None


def _settings(texts: Sequence[str]) -> dict[str, str]:
    settings: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip():
            raise UsageError(f"{text!r} sets nothing.", where="--set", remedy="Write --set name=value.")
        if name.strip() in settings:
            raise UsageError(f"{name.strip()} is set twice.", where="--set", remedy="Set it once.")
        settings[name.strip()] = value
    return settings


def _pose(study: Study, text: str) -> tuple[float, float, float]:
    kind = study.problem.kind
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise UsageError(
            f"{text!r} is not a pose.",
            where="--at",
            remedy=f"Write --at {','.join(kind.pose)} in {pose_unit_names(kind, study.units)}.",
        )
    x, y, z = (study.units.to_si(value, unit) for value, unit in zip(numbers, kind.pose_units, strict=True))
    return x, y, z


def _print_pose(
    study: Study, design: Design, pose: tuple[float, float, float], *, as_json: bool
) -> int | None:
    units, kind = study.units, study.problem.kind
    values = pose_values(study, design, pose)
    rates = [f"{unit}/{kind.actuator_unit}" for unit in kind.pose_units]

    def converted(array: Any, unit: str) -> Any:
        if isinstance(array, list):
            return [converted(item, unit) for item in array]
        return None if array is None else units.from_si(array, unit)

    def by_row(rows: Sequence[Any], si_units: Sequence[str]) -> dict[str, Any]:
        """Values with the unit of each row, one unit where all have it."""
        names = [units.name(unit) for unit in si_units]
        return {
            "value": [converted(row, unit) for row, unit in zip(rows, si_units, strict=True)],
            "unit": names[0] if len(set(names)) == 1 else names,
        }

    data = {
        "pose": by_row(pose, kind.pose_units),
        "actuators": {
            drive: {"value": converted(q, kind.actuator_unit), "unit": units.name(kind.actuator_unit)}
            for drive, q in values["actuators"].items()
        },
        "jacobian": {drive: by_row(matrix, rates) for drive, matrix in values["jacobian"].items()},
        "margins": {
            name: {
                "value": converted(value, "m" if name == "reach" else "-"),
                "unit": units.name("m" if name == "reach" else "-"),
            }
            for name, value in values["margins"].items()
        },
    }
    if as_json:
        print(json.dumps(data, ensure_ascii=False))
        return None
    print(table(["design", "value"], [row[:2] for row in design_rows(study.problem, units, design)]))
    rows = []
    for drive, entry in data["actuators"].items():
        rows.append([f"{drive} coordinates [{entry['unit']}]", _row_text(entry["value"])])
    for drive, entry in data["jacobian"].items():
        for axis, unit, row in zip(kind.pose, rates, entry["value"], strict=True):
            rows.append([f"Jacobian of the {drive}s, {axis} [{units.name(unit)}]", _row_text(row)])
    for name, entry in data["margins"].items():
        rows.append([f"margin: {name} [{entry['unit']}]", _row_text([entry["value"]])])
    print("\n" + table([f"at {pose_text(kind, pose, units)}", "value"], rows))
    if values["actuators"][kind.drives[0]][0] is None:
        print("\nThis pose is not reachable in the working mode.")
    return None


def _row_text(values: Sequence[float | None]) -> str:
    return "  ".join("–" if value is None else f"{value:.8g}" for value in values)


def optimize_one(
    path: Path,
    seed: int | None,
    budget: int | None,
    workers: int | None,
    dask: str | None,
    resume: str | None,
    output: Path,
    *,
    allow_code: bool,
    as_json: bool,
    quiet: bool,
) -> int | None:
    threads = worker_threads(workers)
    comparison = load_comparison(path, allow_code=allow_code)
    if comparison is None:
        study = load_study(path, allow_code=allow_code).searched_with(seed=seed, budget=budget)
        folder = None if resume is None else run_to_resume(study, resume, output)
        _check_search(study, folder)
        check_dask(dask, workers, [study])
        with evaluators(dask, threads) as executor:
            run = _searched(study, executor, threads, output, folder, quiet=quiet or as_json)
        print(json.dumps(_run_data(study, run), ensure_ascii=False) if as_json else _run_text(study, run))
        return _ending(run)
    studies = {
        label: study.searched_with(seed=seed, budget=budget) for label, study in comparison.studies.items()
    }
    folders = _runs_to_resume(studies, resume, output)
    for label, study in studies.items():
        _check_search(study, folders.get(label))
    check_dask(dask, workers, studies.values())
    runs = {}
    with evaluators(dask, threads) as executor:
        for label, study in studies.items():
            if not (quiet or as_json):
                print(f"{label}: {study.problem.kind.title}", file=sys.stderr)
            folder = folders.get(label)
            runs[label] = _searched(study, executor, threads, output, folder, quiet=quiet or as_json)
            if runs[label].result.ending == "interrupted":
                break
    if as_json:
        data = {label: _run_data(studies[label], run) for label, run in runs.items()}
        print(json.dumps({"comparison": comparison.name, "architectures": data}, ensure_ascii=False))
    else:
        print(comparison_text(studies, runs))
    table_file = write_comparison(output, comparison.name, studies, runs)
    if not as_json:
        print(f"Table: {table_file}")
        if any(run.result.ending == "interrupted" for run in runs.values()):
            print(f"Next: the same command with --resume {LATEST}")
    return worst_code([_ending(run) for run in runs.values()])


def _runs_to_resume(studies: Mapping[str, Study], resume: str | None, output: Path) -> dict[str, Path]:
    """The runs of a comparison that go on, by architecture; those that had not begun are left out."""
    if resume is None:
        return {}
    if resume != LATEST:
        raise UsageError(
            "A comparison has a run for each architecture.",
            where=f"--resume {resume}",
            remedy=f"Write --resume {LATEST}: the newest of each, or a new one.",
        )
    folders = {}
    for label, study in studies.items():
        with suppress(UsageError):
            folders[label] = run_to_resume(study, resume, output)
    return folders


def _check_search(study: Study, resume: Path | None) -> None:
    """Refuse what cannot work before anything is started."""
    check_search(study)
    if resume is not None:
        check_resumable(study, resume)


def _searched(
    study: Study, executor: Executor, proof_workers: int, output: Path, resume: Path | None, *, quiet: bool
) -> Run:
    with search_progress(study.problem, study.units, study.optimizer.budget, quiet=quiet) as watch:
        return optimize_study(
            study,
            executor=executor,
            proof_workers=proof_workers,
            output=output,
            watch=watch,
            resume=resume,
        )


def _run_data(study: Study, run: Run) -> dict[str, Any]:
    from tpm_design.cli.certify import verdict_data

    data: dict[str, Any] = {"study": study.name, "run": str(run.folder), "status": run.status}
    if run.best is not None:
        data["best"] = evaluation_data(study.problem, study.units, run.best)
    if len(study.problem.objectives) > 1:
        data["front"] = front_data(study.problem, study.units, run.result.front)
    if run.result.bound is not None and run.result.bound.reachable:
        least = study.units.from_si(run.result.bound.least, "m")
        data["bound"] = {"value": least, "unit": study.units.name("m"), "gap": gap_of(run.result)}
    if run.verdict is not None:
        data["verdict"] = verdict_data(study, run.verdict)
    return data


def _run_text(study: Study, run: Run) -> str:
    from tpm_design.cli.certify import verdict_text

    parts = []
    if run.result.front:
        parts += [front_text(study.problem, study.units, run.result.front), "The knee:"]
    if run.best is not None and run.result.best is not None:
        parts += [
            result_text(study.problem, study.units, run.best),
            limit_text(study.problem, run.result.best),
        ]
    if run.verdict is not None:
        parts.append(verdict_text(study, run.verdict))
    allow = " --allow-code" if study.plug_in else ""
    after = [f"Run: {run.folder}"]
    if run.result.ending == "interrupted" and run.folder is not None:
        after.append(f"Next: tpm-design optimize {run.folder / STUDY} --resume {run.folder}{allow}")
    else:
        after.append(f"Next: tpm-design report {run.folder}{allow}")
    others = other_optima_text(study.problem, study.units, run.result.optima)
    more = [] if others is None else [others]
    lines = [run.status, *_gap_lines(study, run), *more, *run.result.remarks, *after]
    return "\n\n".join([*parts, "\n".join(lines)])


def _gap_lines(study: Study, run: Run) -> list[str]:
    bound = run.result.bound
    if bound is None or not bound.reachable:
        return []
    return [gap_text(bound.goal, study.units.written(bound.least, "m"), gap_of(run.result))]


def _ending(run: Run) -> int | None:
    if run.result.ending == "interrupted":
        return INTERRUPTED
    if run.verdict is not None and run.verdict.outcome != "proved":
        return NOT_PROVED
    feasible = run.best is not None and run.best.status == "feasible"
    return None if feasible else NOTHING_FEASIBLE


def worker_threads(workers: int | None) -> int:
    """How many threads evaluate, one per processor if None; prepares the interpreter for them. Raises
    UsageError."""
    if workers is not None and workers < 1:
        raise UsageError(
            f"{workers} workers cannot work.", where="--workers", remedy="Choose a whole number from 1."
        )
    sys.setswitchinterval(SWITCH_INTERVAL)
    return workers or usable_processors()


def usable_processors() -> int:
    """Processors this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else (os.cpu_count() or 1)


def report_runs(runs: Sequence[Path], *, allow_code: bool, quiet: bool) -> int | None:
    from tpm_design.report import write_report

    for folder in runs or [newest_run(RESULTS)]:
        for path in write_report(folder, allow_code=allow_code):
            if not quiet:
                print(path)
    return None
