"""A sweep on two threads against one and against two processes: what a second processor gives."""

from __future__ import annotations

import multiprocessing
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from row import Row
from tpm_design.problem import Problem
from tpm_design.runs.executors import SWITCH_INTERVAL
from tpm_design.runs.sweeps import Point, sweep
from tpm_design.study import SampleSweep, load_study
from tpm_design.study.sweep_points import sweep_points

STUDY = Path(__file__).resolve().parents[1] / "studies" / "01-uru-cube.yaml"
POINTS, LEAST_MILLISECONDS = 120, 10.0
TARGET = 1.7
ROUNDS = 9


def slow_points() -> tuple[Problem, list[Point]]:
    """Designs of study 01, near its best one, that take long enough to evaluate."""
    study = load_study(STUDY)
    held = {"db": 0.186, "k": 1.0, "center_x": 0.156, "center_y": 0.156, "center_z": 0.156}
    variables = tuple(
        replace(variable, initial=held.get(variable.name)) for variable in study.problem.variables
    )
    near = replace(
        study,
        problem=replace(study.problem, variables=variables),
        sweep=SampleSweep("sobol", 4 * POINTS, 1, ("f", "r")),
    )
    points = sweep_points(near)
    # the first sweep compiles
    for _ in range(2):
        entries = sweep(near.problem, points, workers=1, record=lambda entry: None).entries
    slow = [entry for entry in entries if 1e3 * entry.evaluation.seconds >= LEAST_MILLISECONDS]
    return near.problem, [points[entry.number] for entry in slow[:POINTS]]


def swept(problem: Problem, points: Sequence[Point], workers: int) -> None:
    """The sweep without its files."""
    sweep(problem, points, workers=workers, record=lambda entry: None)


def in_processes(problem: Problem, parts: Sequence[Sequence[Point]]) -> None:
    """Each part in a process of its own, kernels already loaded."""
    # a fork shares the problem, which holds functions
    fork = multiprocessing.get_context("fork")
    running = [fork.Process(target=swept, args=(problem, part, 1)) for part in parts]
    for process in running:
        process.start()
    for process in running:
        process.join()


def rows() -> list[Row]:
    sys.setswitchinterval(SWITCH_INTERVAL)
    problem, points = slow_points()
    if not points:
        return [Row("sweep of study 01", "-", "-", "no design takes 10 ms", f"{TARGET:g}", None)]

    halves = (points[::2], points[1::2])
    calls: list[Callable[[], object]] = [
        lambda: swept(problem, points, 2),
        lambda: swept(problem, points, 1),
        lambda: in_processes(problem, halves),
    ]
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(ROUNDS):
        for found, call in zip(times, calls, strict=True):
            began = time.perf_counter()
            call()
            found.append(time.perf_counter() - began)
    # other work on the machine only ever adds
    threads, one, processes = map(min, times)
    name = f"sweep of study 01, {len(points)} designs of {1e3 * one / len(points):.0f} ms"
    return [
        Row(
            name,
            f"{threads:.2f} s on 2 threads",
            f"{one:.2f} s on 1",
            f"{one / threads:.2f} × the throughput",
            f"≥ {TARGET:g}",
            one / threads >= TARGET,
        ),
        Row(
            "two processes, half of it each",
            f"{threads:.2f} s on 2 threads",
            f"{processes:.2f} s",
            f"{processes / threads:.2f} × the throughput",
            "-",
            None,
        ),
    ]
