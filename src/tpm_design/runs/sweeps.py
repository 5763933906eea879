"""A sweep: every point of a plan evaluated, some of them twice."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Literal

from tpm_design.errors import UsageError
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.result import Evaluation
from tpm_design.problem import Design, Problem
from tpm_design.runs.entry import Entry
from tpm_design.runs.executors import Executor
from tpm_design.runs.folder import entry_to_json
from tpm_design.runs.shipping import portable

REPEATED_EVERY = 19
"""Points 0, 19, 38, … are evaluated a second time. A prime, so that shards share them evenly."""

LONGEST_REASON = 300


@dataclass(frozen=True)
class Point:
    """One design of a plan, numbered from 0 in the order of the whole plan."""

    number: int
    design: Design


@dataclass(frozen=True)
class Shard:
    """Every ``count``-th point of a plan, beginning with the ``index``-th, from 1. Raises UsageError for a
    shard that cannot be."""

    index: int = 1
    count: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.index <= self.count:
            raise UsageError(
                f"There is no shard {self}.",
                where="--shard",
                remedy="Write i/n with i from 1 to n, such as 1/4.",
            )

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"


WHOLE = Shard()


@dataclass(frozen=True)
class SweepResult:
    """``entries``: one for each point that was evaluated, by number. ``repeated``: how many were evaluated
    again, ``disagreements``: numbers of those that then gave another row. ``faults``: number → exception of
    points at which the program, or a user's own formula, broke."""

    entries: tuple[Entry, ...]
    repeated: int
    disagreements: tuple[int, ...]
    ending: Literal["finished", "interrupted"]
    faults: Mapping[int, Exception]


@dataclass(frozen=True)
class Failure:
    """``count`` points that failed for one reason, the first of them number ``first``."""

    reason: str
    count: int
    first: int


def sweep(
    problem: Problem,
    points: Sequence[Point],
    *,
    executor: Executor,
    record: Callable[[Entry], None],
    stored: Sequence[Entry] = (),
) -> SweepResult:
    """Evaluate the points, then some of them again in reverse order: an evaluation depends on its design
    alone, so that a row which differs, if only in its last bit, shows a hidden state.

    ``record`` gets each evaluation as it ends, in any order. Whatever happens at a point becomes a row with
    status "failed" and the reason. Ctrl-C ends the sweep as "interrupted" with everything evaluated so far.

    ``stored``: the log of an earlier sweep of these points, which is not evaluated again, but for points that
    failed: whether they showed a bug is not in it. ``executor``: who evaluates.
    """
    entries = {entry.number: entry for entry in stored}
    faults: dict[int, Exception] = {}
    repeated = 0
    disagreements: list[int] = []
    ending: Literal["finished", "interrupted"] = "finished"
    kept = {number for number, entry in entries.items() if entry.evaluation.status != "failed"}
    left = [point for point in points if point.number not in kept]
    again = [point for point in reversed(points) if point.number % REPEATED_EVERY == 0]
    try:
        with closing(executor.as_they_end(_evaluate, problem, left)) as forward:
            for _, (entry, fault) in forward:
                if fault is not None:
                    faults[entry.number] = fault
                if entry.number not in entries:
                    entries[entry.number] = entry
                    record(entry)
        with closing(executor.as_they_end(_evaluate, problem, again)) as backward:
            for _, (entry, _) in backward:
                repeated += 1
                if not same_row(entry, entries[entry.number]):
                    disagreements.append(entry.number)
    except KeyboardInterrupt:
        ending = "interrupted"
    ordered = tuple(entries[number] for number in sorted(entries))
    return SweepResult(ordered, repeated, tuple(sorted(disagreements)), ending, faults)


def same_row(one: Entry, other: Entry) -> bool:
    """Whether two evaluations are equal to the last bit, their times aside."""
    return _timeless(one) == _timeless(other)


def failures(entries: Iterable[Entry]) -> tuple[Failure, ...]:
    """The failed points by their reasons, in the order in which these first occur."""
    numbers: dict[str, list[int]] = {}
    for entry in entries:
        if entry.evaluation.status == "failed":
            numbers.setdefault(entry.evaluation.reason, []).append(entry.number)
    return tuple(Failure(reason, len(found), found[0]) for reason, found in numbers.items())


def _timeless(entry: Entry) -> str:
    return json.dumps(entry_to_json(entry) | {"seconds": 0.0})


def _evaluate(problem: Problem, point: Point) -> tuple[Entry, Exception | None]:
    """A point's entry, and what went wrong beyond what an evaluation can put in words."""
    began = time.perf_counter()
    try:
        return Entry(point.number, evaluate(problem, point.design)), None
    except Exception as error:
        words = " ".join(f"{type(error).__name__}: {error}".split())
        reason = words if len(words) <= LONGEST_REASON else f"{words[: LONGEST_REASON - 1]}…"
        seconds = time.perf_counter() - began
        failed = Evaluation(dict(point.design), {}, {}, {}, {}, {}, math.inf, "failed", reason, seconds)
        return Entry(point.number, failed), portable(error)
