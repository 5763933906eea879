"""Threads of this process that carry out tasks, whenever Ctrl-C may come.

An interrupt is an exception between any two steps of the main thread. One that falls into the waiting, or
into the taking of a lock, that ``threading`` and ``concurrent.futures`` write in Python leaves locks taken
that others wait for, or gives back those that others hold. So the main thread does nothing here that an
interrupt could leave half done: what it shares with the workers are queues and sets whose operations are
single steps.
"""

from __future__ import annotations

import time
from _thread import start_new_thread
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from functools import partial
from queue import Empty, SimpleQueue
from typing import Generic, NoReturn, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

AHEAD = 2
"""Items handed to the threads at a time, for each of them: what is taken lags behind by no more."""

SECONDS_BETWEEN_LOOKS = 1e-3
"""How soon it is seen that a thread has ended what it is at."""


class WorkerThreads:
    """``count`` threads; with one, the thread that asks. A program can end without waiting for them."""

    def __init__(self, count: int) -> None:
        self.count = count
        self._asked: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._present: set[int] = set()
        if count > 1:
            for number in range(count):
                self._present.add(number)
                start_new_thread(_work, (number, self._present, self._asked))

    def as_they_end(
        self, task: Callable[[Item], Result], items: Iterable[Item]
    ) -> Generator[tuple[int, Result]]:
        """The place of each item in ``items`` and what ``task(item)`` gave, in any order.

        Raises what a task raised. Once it is closed, items that were not begun are dropped, and none is under
        way; a second Ctrl-C ends that wait.
        """
        return self.from_queue(task, deque(items))

    def from_queue(self, task: Callable[[Item], Result], queue: deque[Item]) -> Generator[tuple[int, Result]]:
        """As ``as_they_end``, of items that are taken from the left of a queue; others may be added to it
        between results."""
        asked = ended = 0
        if self.count <= 1:
            while queue:
                yield asked, task(queue.popleft())
                asked += 1
            return
        batch, ahead = _Batch(task), AHEAD * self.count
        try:
            while queue or ended < asked:
                if queue and asked - ended < ahead:
                    self._asked.put(partial(batch.carry_out, asked, queue.popleft()))
                    asked += 1
                else:
                    result = batch.next_result()
                    ended += 1
                    yield result
        finally:
            batch.drop()

    def close(self) -> None:
        """Drop what was not begun and wait for the threads to end; again harmless."""
        try:
            while True:
                self._asked.get_nowait()
        except Empty:
            pass
        for _ in range(len(self._present)):
            self._asked.put(None)
        _wait_until_empty(self._present)


THIS_THREAD = WorkerThreads(1)


def in_order(results: Iterable[tuple[int, Result]]) -> Iterator[Result]:
    """Results by their places 0, 1, 2, …, each as soon as those before it are there."""
    early: dict[int, Result] = {}
    following = 0
    for place, result in results:
        early[place] = result
        while following in early:
            yield early.pop(following)
            following += 1


class _Batch(Generic[Item, Result]):
    """Items of one call. The workers alone keep ``_running``: what the main thread counts may be one off
    after an interrupt."""

    def __init__(self, task: Callable[[Item], Result]) -> None:
        self._task = task
        self._ended: SimpleQueue[tuple[int, Callable[[], Result]]] = SimpleQueue()
        self._running: set[int] = set()
        self._is_dropped = False

    def carry_out(self, place: int, item: Item) -> None:
        """By a worker: never raises."""
        # first this, then a look: a drop in between waits for this item, or it is not begun
        self._running.add(place)
        outcome = None if self._is_dropped else _outcome(partial(self._task, item))
        self._running.discard(place)
        if outcome is not None:
            self._ended.put((place, outcome))

    def next_result(self) -> tuple[int, Result]:
        """By whoever asks: wait for one more. Raises what the task raised."""
        place, outcome = self._ended.get()
        return place, outcome()

    def drop(self) -> None:
        """By whoever asks: let nothing more begin, and wait for what has."""
        self._is_dropped = True
        _wait_until_empty(self._running)


def in_a_thread(results: Generator[Result]) -> Generator[Result]:
    """What ``results`` gives, carried out by a thread of its own while the one that asks waits: for libraries
    whose waiting an interrupt would break.

    Raises what it raised. Once this is closed, so is ``results``; a second Ctrl-C ends that wait.
    """
    asked: SimpleQueue[bool] = SimpleQueue()
    given: SimpleQueue[Callable[[], Result | _End]] = SimpleQueue()
    present = {0}
    start_new_thread(_give, (results, asked, given, present))
    try:
        asked.put(True)
        while not isinstance(result := given.get()(), _End):
            yield result
            asked.put(True)
    finally:
        asked.put(False)
        _wait_until_empty(present)


class _End:
    """Nothing more is given."""


def _give(
    results: Generator[Result],
    asked: SimpleQueue[bool],
    given: SimpleQueue[Callable[[], Result | _End]],
    present: set[int],
) -> None:
    """What a thread does for ``in_a_thread``."""
    try:
        while asked.get():
            given.put(_outcome(partial(next, results, _End())))
        results.close()
    finally:
        present.clear()


def _outcome(call: Callable[[], Result]) -> Callable[[], Result]:
    """Gives what the call gave, or raises what it raised."""
    try:
        return partial(_same, call())
    except BaseException as error:
        return partial(_raised, error)


def _same(result: Result) -> Result:
    return result


def _raised(error: BaseException) -> NoReturn:
    raise error


def _work(number: int, present: set[int], asked: SimpleQueue[Callable[[], None] | None]) -> None:
    """What a thread does until it is told to end."""
    while (carry_out := asked.get()) is not None:
        carry_out()
        # what it refers to may be large, and the next one late
        del carry_out
    present.discard(number)


def _wait_until_empty(numbers: set[int]) -> None:
    while numbers:
        time.sleep(SECONDS_BETWEEN_LOOKS)
