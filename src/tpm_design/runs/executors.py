"""Where evaluations are carried out: by this thread, by several, elsewhere; results do not depend on it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Protocol, TypeVar

from tpm_design.problem import Problem

Item = TypeVar("Item")
Result = TypeVar("Result")

AHEAD = 2
"""Items handed to the threads at a time, for each of them: what is written lags behind by no more."""

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

    def close(self) -> None:
        """No more tasks; again harmless."""


class Threads:
    """Threads of this process; with one worker the thread that asks. Until they are closed, they let one
    another have the interpreter after ``SWITCH_INTERVAL``."""

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._pool = ThreadPoolExecutor(max_workers=workers) if workers > 1 else None
        self._interval_before = sys.getswitchinterval()
        if workers > 1:
            sys.setswitchinterval(min(SWITCH_INTERVAL, self._interval_before))

    @property
    def workers(self) -> int:
        """As ``Executor``."""
        return self._workers

    def as_they_end(
        self, task: Callable[[Problem, Item], Result], problem: Problem, items: Sequence[Item]
    ) -> Generator[tuple[int, Result]]:
        """As ``Executor``."""
        if self._pool is None:
            for place, item in enumerate(items):
                yield place, task(problem, item)
            return
        places: dict[Future[Result], int] = {}
        try:
            for place, item in enumerate(items):
                if len(places) >= AHEAD * self._workers:
                    yield from _ended(places)
                places[self._pool.submit(task, problem, item)] = place
            while places:
                yield from _ended(places)
        finally:
            for future in places:
                future.cancel()
            wait(places)

    def close(self) -> None:
        """As ``Executor``."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            sys.setswitchinterval(self._interval_before)


def _ended(places: dict[Future[Result], int]) -> Iterator[tuple[int, Result]]:
    """Wait for at least one, and take what has ended."""
    for future in wait(places, return_when=FIRST_COMPLETED).done:
        yield places.pop(future), future.result()


def in_order(results: Iterable[tuple[int, Result]]) -> Iterator[Result]:
    """Results by their places 0, 1, 2, …, each as soon as those before it are there."""
    early: dict[int, Result] = {}
    following = 0
    for place, result in results:
        early[place] = result
        while following in early:
            yield early.pop(following)
            following += 1
