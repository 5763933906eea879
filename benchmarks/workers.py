"""Batch methods on one, two and four threads: what each further processor gives."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from row import Row
from tpm_design.metrics import metric
from tpm_design.problem import Goal, Problem
from tpm_design.runs.executors import Executor, Threads
from tpm_design.runs.folder import RunWriter
from tpm_design.runs.optimize import SearchPlan, search
from tpm_design.runs.sweeps import Point, sweep
from tpm_design.study import SampleSweep, Study, load_study
from tpm_design.study.sweep_points import sweep_points

STUDY = Path(__file__).resolve().parents[1] / "studies" / "01-uru-cube.yaml"
POINTS, LEAST_MILLISECONDS = 120, 10.0
SAMPLES = 11
"""Along the region, where the study has 9: most designs near its best one take 7 to 10 ms with those."""
BUDGET = 1000
WORKERS, ROUNDS = (1, 2, 4), 3
TARGET = 1.7

Run = Callable[[Executor], int]
"""Work for an executor; gives the number of evaluations."""


def slow_points() -> tuple[Problem, list[Point]]:
    """Designs of study 01, near its best one, that take long enough to evaluate."""
    study = load_study(STUDY)
    held = {"db": 0.186, "k": 1.0, "center_x": 0.156, "center_y": 0.156, "center_z": 0.156}
    variables = tuple(
        replace(variable, initial=held.get(variable.name)) for variable in study.problem.variables
    )
    near = replace(
        study,
        problem=replace(
            study.problem,
            variables=variables,
            accuracy=replace(study.problem.accuracy, region_samples=SAMPLES),
        ),
        sweep=SampleSweep("sobol", 4 * POINTS, 1, ("f", "r")),
    )
    points = sweep_points(near)
    # the first sweep compiles
    for _ in range(2):
        entries = sweep(near.problem, points, executor=Threads(1), record=lambda entry: None).entries
    slow = [entry for entry in entries if 1e3 * entry.evaluation.seconds >= LEAST_MILLISECONDS]
    return near.problem, [points[entry.number] for entry in slow[:POINTS]]


def swept(problem: Problem, points: Sequence[Point], executor: Executor) -> int:
    """The sweep without its files."""
    found = sweep(problem, points, executor=executor, record=lambda entry: None)
    return len(found.entries) + found.repeated


def searched(study: Study, plan: SearchPlan, executor: Executor) -> int:
    """The search as the command runs it, its log included."""
    problem = study.problem
    with (
        tempfile.TemporaryDirectory() as folder,
        closing(RunWriter(Path(folder), problem, study.units, "")) as writer,
    ):
        found = search(problem, plan, executor=executor, record=writer.record)
    return len(found.entries)


@dataclass(frozen=True)
class Timed:
    """``wall`` seconds; ``waited`` of these for a processor that was busy with other programs, on average of
    the threads that evaluate (Linux; else 0)."""

    evaluations: int
    wall: float
    waited: float


def timed(run: Run, workers: int) -> Timed:
    """One run on so many threads."""
    with closing(Threads(workers)) as executor:
        before = _queued()
        began = time.perf_counter()
        evaluations = run(executor)
        wall = time.perf_counter() - began
        after = _queued()
    own = threading.main_thread().native_id
    waits = [after[thread] - before.get(thread, 0.0) for thread in after if (thread == own) == (workers == 1)]
    return Timed(evaluations, wall, sum(waits) / max(1, len(waits)))


def _queued() -> dict[int | None, float]:
    """Seconds that each thread of this process was ready to run and did not."""
    found = {}
    for thread in threading.enumerate():
        times = Path(f"/proc/self/task/{thread.native_id}/schedstat")
        if times.is_file():
            found[thread.native_id] = 1e-9 * int(times.read_text().split()[1])
    return found


def compared(name: str, run: Run) -> list[Row]:
    """One row for each number of threads but one."""
    results: dict[int, list[Timed]] = {workers: [] for workers in WORKERS}
    for _ in range(ROUNDS):
        for workers, found in results.items():
            found.append(timed(run, workers))
    # other work on the machine only ever adds
    wall = {workers: min(one.wall for one in found) for workers, found in results.items()}
    alone = {workers: min(one.wall - one.waited for one in found) for workers, found in results.items()}
    count = results[1][0].evaluations
    each = 1e3 * alone[1] / count
    return [
        Row(
            f"{name}, {count} evaluations of {each:.1f} ms",
            f"{wall[workers]:.2f} s on {workers} threads",
            f"{wall[1]:.2f} s on 1",
            f"{wall[1] / wall[workers]:.2f} × the throughput, {alone[1] / alone[workers]:.2f} × but for "
            "waits for a processor",
            f"≥ {TARGET:g}" if workers == 2 else "-",
            alone[1] / alone[workers] >= TARGET if workers == 2 else None,
        )
        for workers in WORKERS[1:]
    ]


def rows() -> list[Row]:
    problem, points = slow_points()
    study = replace(load_study(STUDY), certification=None)
    runs: list[tuple[str, Run]] = []
    if points:
        runs.append(("sweep of study 01 near its optimum", partial(swept, problem, points)))
    plans = {"scipy.differential_evolution": study, "multistart": study}
    if find_spec("pymoo") is not None:
        second = Goal(metric("conditioning_min"), "evenness", sense="maximize")
        goals = (*study.problem.objectives, second)
        plans["pymoo.nsga2"] = replace(study, problem=replace(study.problem, objectives=goals))
    for method, asked in plans.items():
        plan = SearchPlan(method, BUDGET, 1, None)
        runs.append((f"{method}, study 01", partial(searched, asked, plan)))
    return [row for name, run in runs for row in compared(name, run)]
