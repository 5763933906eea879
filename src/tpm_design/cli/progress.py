"""Progress of a search or a sweep: a bar on a terminal, otherwise a line now and then, on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from tpm_design.problem import Problem
from tpm_design.runs.entry import Entry
from tpm_design.runs.front import extended
from tpm_design.runs.ranking import minimised, scaled_objectives
from tpm_design.runs.tables import goal_unit
from tpm_design.units import Units

SECONDS_BETWEEN_LINES = 10.0


@contextmanager
def search_progress(
    problem: Problem, units: Units, budget: int, *, quiet: bool
) -> Iterator[Callable[[Entry], None]]:
    """A function to be called with each evaluation."""
    with _progress("Searching", budget, _Best(problem, units).update, quiet=quiet) as watch:
        yield watch


@contextmanager
def sweep_progress(count: int, *, quiet: bool) -> Iterator[Callable[[Entry], None]]:
    """A function to be called with each evaluation of a sweep of so many points."""
    failed = 0

    def update(entry: Entry) -> str:
        nonlocal failed
        failed += entry.evaluation.status == "failed"
        return f"{failed} failed"

    with _progress("Evaluating", count, update, quiet=quiet) as watch:
        yield watch


@contextmanager
def _progress(
    verb: str, count: int, update: Callable[[Entry], str], *, quiet: bool
) -> Iterator[Callable[[Entry], None]]:
    """``update`` gives the words that follow the number of evaluations."""
    if quiet:
        yield lambda entry: None
    elif sys.stderr.isatty():
        with _bar(count, update) as watch:
            yield watch
    else:
        yield _lines(verb, count, update)


class _Best:
    """The best objective so far, or the size of the front, as text."""

    def __init__(self, problem: Problem, units: Units) -> None:
        self._problem, self._units = problem, units
        self._goal = problem.objectives[0]
        self._front = np.empty((0, len(problem.objectives)))
        self._feasible = float("inf")
        self._violation = float("inf")
        self._round = 1

    def update(self, entry: Entry) -> str:
        if entry.round > self._round:
            # earlier designs were judged by fewer samples
            self._round, self._feasible, self._violation = entry.round, float("inf"), float("inf")
        if entry.evaluation.status == "feasible":
            self._feasible = min(self._feasible, minimised(self._problem, entry.evaluation))
            if len(self._problem.objectives) > 1:
                values = np.array(scaled_objectives(self._problem, entry.evaluation))
                self._front = extended(self._front, values)
        if entry.evaluation.status != "aborted":
            self._violation = min(self._violation, entry.evaluation.violation)
        before = f"round {self._round}: " if self._round > 1 else ""
        if len(self._front):
            return f"front of {len(self._front)}"
        if self._feasible < float("inf"):
            sign = 1.0 if self._goal.sense == "minimize" else -1.0
            value = sign * self._feasible * self._goal.metric.scale
            written = self._units.written(value, goal_unit(self._problem, self._goal))
            return f"{before}best {self._goal.label} {written}"
        return f"{before}none feasible yet, least violation {self._violation:.3g}"


@contextmanager
def _bar(count: int, update: Callable[[Entry], str]) -> Iterator[Callable[[Entry], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    with Progress(
        TextColumn("evaluations"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
        console=Console(stderr=True),
        transient=True,
    ) as progress:
        task = progress.add_task("compiling the equations on first use", total=count)
        yield lambda entry: progress.update(task, advance=1, description=update(entry))


def _lines(verb: str, count: int, update: Callable[[Entry], str]) -> Callable[[Entry], None]:
    print(f"{verb}; the equations are compiled on first use.", file=sys.stderr, flush=True)
    last, done = time.monotonic(), 0

    def watch(entry: Entry) -> None:
        nonlocal last, done
        done += 1
        text = update(entry)
        if time.monotonic() - last >= SECONDS_BETWEEN_LINES:
            last = time.monotonic()
            print(f"{done} of {count} evaluations, {text}", file=sys.stderr, flush=True)

    return watch
