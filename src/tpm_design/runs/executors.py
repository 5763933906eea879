"""Where evaluations are carried out: by this thread, by several, elsewhere; results do not depend on it."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Generator, Sequence
from functools import partial
from typing import Protocol, TypeVar

from tpm_design.problem import Problem
from tpm_design.worker_threads import WorkerThreads

Item = TypeVar("Item")
Result = TypeVar("Result")

SWITCH_INTERVAL = 1e-4
"""Seconds after which a thread lets others have the interpreter. Between short compiled calls of several
threads the usual 5 ms would make them wait for one another."""


class Executor(Protocol):
    """Carries out tasks, several at a time."""

    @property
    def workers(self) -> int:
        """How many at a time, as far as is known."""

    def as_they_end(
        self, task: Callable[[Problem, Item], Result], problem: Problem, items: Sequence[Item]
    ) -> Generator[tuple[int, Result]]:
        """The place of each item in ``items`` and what ``task(problem, item)`` gave, in any order.

        Raises what a task raised, and RunStoppedError where no more can be carried out. Once it is closed,
        items that were not begun are dropped.
        """

    def from_queue(
        self, task: Callable[[Problem, Item], Result], problem: Problem, queue: deque[Item]
    ) -> Generator[tuple[int, Result]]:
        """As ``as_they_end``, of items that are taken from the left of a queue; others may be added to it
        between results, as long as one is not ended."""

    def close(self) -> None:
        """No more tasks; again harmless."""


class Threads:
    """Threads of this process; with one worker the thread that asks. Until they are closed, they let one
    another have the interpreter after ``SWITCH_INTERVAL``."""

    def __init__(self, workers: int) -> None:
        self._pool = WorkerThreads(workers)
        self._interval_before = sys.getswitchinterval()
        if workers > 1:
            sys.setswitchinterval(min(SWITCH_INTERVAL, self._interval_before))

    @property
    def workers(self) -> int:
        """As ``Executor``."""
        return self._pool.count

    def as_they_end(
        self, task: Callable[[Problem, Item], Result], problem: Problem, items: Sequence[Item]
    ) -> Generator[tuple[int, Result]]:
        """As ``Executor``."""
        return self._pool.as_they_end(partial(task, problem), items)

    def from_queue(
        self, task: Callable[[Problem, Item], Result], problem: Problem, queue: deque[Item]
    ) -> Generator[tuple[int, Result]]:
        """As ``Executor``."""
        return self._pool.from_queue(partial(task, problem), queue)

    def close(self) -> None:
        """As ``Executor``."""
        try:
            self._pool.close()
        finally:
            sys.setswitchinterval(self._interval_before)
