"""Evaluations on a Dask cluster: what handing them out costs, and whether the driver keeps up with many."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from subprocess import DEVNULL, Popen

import psutil

from row import Row
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.result import Evaluation
from tpm_design.problem import Problem
from tpm_design.runs.dask_workers import dask_workers
from tpm_design.runs.entry import Entry
from tpm_design.runs.executors import SWITCH_INTERVAL, Executor, Threads
from tpm_design.runs.folder import RunWriter
from tpm_design.study import load_study
from tpm_design.worker_threads import in_order
from workers import slow_points

STUDY = Path(__file__).resolve().parents[1] / "studies" / "01-uru-cube.yaml"
COUNT, WORKERS, ROUNDS, TARGET = 1000, 2, 5, 1.05
PROCESSES, THREADS, MANY, MANY_SECONDS = 4, 50, 20_000, 0.05


def asleep(problem: Problem, item: Evaluation) -> Evaluation:
    """An evaluation of ``item.seconds`` that needs no processor."""
    time.sleep(item.seconds)
    return item


def busy(problem: Problem, item: Evaluation) -> Evaluation:
    """A true evaluation."""
    return evaluate(problem, item.design)


def wall(executor: Executor, task: object, problem: Problem, items: list[Evaluation]) -> float:
    """Seconds for all items."""
    began = time.perf_counter()
    for _ in in_order(executor.as_they_end(task, problem, items)):  # type: ignore[arg-type]
        pass
    return time.perf_counter() - began


def overhead(problem: Problem, items: list[Evaluation]) -> list[Row]:
    """A Dask batch against threads, both with the same number of workers, by turns."""
    rows = []
    with closing(Threads(WORKERS)) as threads, dask_workers("local", WORKERS) as cluster:
        for name, task in (("that sleep", asleep), ("of study 01", busy)):
            chosen = [replace(item, seconds=0.01) for item in items] if task is asleep else items
            calls = [partial(wall, executor, task, problem, chosen) for executor in (cluster, threads)]
            for call in calls:
                call()
            times = [[call() for call in calls] for _ in range(ROUNDS)]
            ours, peer = (min(column) for column in zip(*times, strict=True))
            each = 1e3 * sum(item.seconds for item in chosen) / len(chosen)
            rows.append(
                Row(
                    f"{len(chosen)} evaluations of {each:.1f} ms {name}",
                    f"{ours:.2f} s on {WORKERS} Dask workers",
                    f"{peer:.2f} s on {WORKERS} threads",
                    f"{ours / peer:.3f} × the time",
                    f"≤ {TARGET:g}",
                    ours / peer <= TARGET,
                )
            )
        single = [items[0]]
        waits = [wall(cluster, asleep, problem, [replace(single[0], seconds=0.0)]) for _ in range(100)]
        rows.append(
            Row(
                "one evaluation by itself",
                f"{1e3 * median(waits):.1f} ms there and back",
                "-",
                "-",
                "-",
                None,
            )
        )
    return rows


@contextmanager
def many_threads(folder: Path) -> Iterator[tuple[str, psutil.Process]]:
    """A scheduler and processes with many threads; the address and the scheduler."""
    file = folder / "scheduler.json"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    base = [sys.executable, "-m"]
    where = ["--scheduler-file", str(file), "--no-dashboard"]
    with ExitStack() as stack:

        def begun(*words: str) -> psutil.Process:
            running = Popen([*base, *words, *where], env=environment, stdout=DEVNULL, stderr=DEVNULL)
            stack.callback(running.wait)
            stack.callback(running.kill)
            return psutil.Process(running.pid)

        scheduler = begun("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0")
        for _ in range(PROCESSES):
            begun("distributed.cli.dask_worker", "--nthreads", str(THREADS), "--no-nanny")
        from distributed import Client

        with Client(scheduler_file=str(file), set_as_default=False) as client:
            client.wait_for_workers(PROCESSES)
            address = client.scheduler.address
        yield address, scheduler


def many_workers(problem: Problem, example: Evaluation) -> list[Row]:
    """Tasks for 200 workers: throughput against the ideal, what the driver does for each, rows included."""
    workers = PROCESSES * THREADS
    study = load_study(STUDY)
    items = [
        replace(example, seconds=MANY_SECONDS, design=dict(example.design) | {"f": 0.2 + 1e-6 * k})
        for k in range(MANY)
    ]
    with (
        tempfile.TemporaryDirectory() as name,
        many_threads(Path(name)) as (address, scheduler),
        dask_workers(address, 1) as cluster,
        closing(RunWriter(Path(name), problem, study.units, "")) as writer,
    ):
        wall(cluster, asleep, problem, items[: 4 * workers])

        def carried_out(record: Callable[[Entry], None]) -> list[float]:
            """Seconds of the scheduler's and the driver's processors, and of the clock."""
            before = sum(scheduler.cpu_times()[:2]), time.process_time(), time.perf_counter()
            for number, found in enumerate(in_order(cluster.as_they_end(asleep, problem, items))):
                record(Entry(number, found))
            after = sum(scheduler.cpu_times()[:2]), time.process_time(), time.perf_counter()
            return [b - a for a, b in zip(before, after, strict=True)]

        measured = [(carried_out(lambda entry: None), carried_out(writer.record)) for _ in range(3)]
    # other work on the machine only ever adds
    plain, written = (
        [min(column) for column in zip(*runs, strict=True)] for runs in zip(*measured, strict=True)
    )
    ideal = MANY * MANY_SECONDS / workers
    name = f"{MANY} evaluations of {1e3 * MANY_SECONDS:.0f} ms that sleep, {workers} threads"
    found = [
        Row(
            f"{name}{more}",
            f"{MANY / seconds:.0f} evaluations a second",
            f"{MANY / ideal:.0f} if they cost nothing",
            f"{ideal / seconds:.2f} of it",
            "≥ 0.8",
            ideal / seconds >= 0.8,
        )
        for more, (_, _, seconds) in (("", plain), (", rows written", written))
    ]
    shares = (
        ("the driver's processor time for one", plain[1]),
        ("the driver's, rows written", written[1]),
        ("the scheduler's", plain[0]),
    )
    return found + [
        Row(
            what,
            f"{1e6 * share / MANY:.0f} µs",
            f"{1e6 * ideal / MANY:.0f} µs between two",
            f"{share / ideal:.2f} of it",
            "< 1",
            share < ideal,
        )
        for what, share in shares
    ]


def rows() -> list[Row]:
    sys.setswitchinterval(SWITCH_INTERVAL)
    problem, points = slow_points()
    if not points:
        return [Row("Dask workers", "-", "-", "no design takes 10 ms", f"{TARGET:g}", None)]
    found = [evaluate(problem, point.design) for point in points]
    items = [found[k % len(found)] for k in range(COUNT)]
    return overhead(problem, items) + many_workers(problem, found[0])
