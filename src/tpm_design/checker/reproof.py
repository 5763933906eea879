"""Leaves of covers proved again, by one process or several: the answer is the same."""

from __future__ import annotations

import heapq
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context
from typing import NamedTuple

from tpm_design.checker.claims import Machine
from tpm_design.checker.cover import Cover, Letter, leaves
from tpm_design.checker.mechanisms.configuration import Machines
from tpm_design.checker.proof import never_reached, proved
from tpm_design.checker.regions import Box, Domain
from tpm_design.checker.statements import Locus, Statement
from tpm_design.worker_threads import in_a_thread

SAMPLES = 16
TOGETHER = 100
"""Leaves that a process takes at once."""
WORTH_A_PROCESS = 1500
"""Leaves that take longer than a process needs to start."""


class Leaf(NamedTuple):
    box: Box
    letter: Letter


class Failure(NamedTuple):
    """A leaf that could not be proved again, of the statement in a place of the certificate."""

    place: int
    leaf: Leaf


class Progress(NamedTuple):
    """``done`` of ``total`` leaves are proved again."""

    done: int
    total: int


Watch = Callable[[Progress], None]


@dataclass(frozen=True)
class Claimed:
    """One cover of the statement in the place ``index``, with ``size`` leaves that claim something about the
    poses of a domain."""

    index: int
    statement: Statement
    domain: Domain
    cover: Cover
    size: int

    def leaves(self) -> Iterator[Leaf]:
        return (Leaf(box, letter) for box, letter in leaves(self.cover) if letter != "u")

    def samples(self) -> tuple[Leaf, ...]:
        """The smallest leaves, where the proof was hardest, and some of all."""
        smallest = heapq.nsmallest(SAMPLES, self.leaves(), key=lambda leaf: volume(leaf.box))
        return (*smallest, *islice(self.leaves(), 0, None, max(1, self.size // SAMPLES)))


@dataclass(frozen=True)
class Task:
    """Some leaves of a cover."""

    index: int
    statement: Statement
    machine: Machine
    domain: Domain
    leaves: tuple[Leaf, ...]


def first_failure(
    machine: Machine, claims: Iterable[Claimed], workers: int, watch: Watch
) -> tuple[Failure | None, int]:
    """The first leaf that cannot be proved again, and how many of those before it are.

    Samples come before all the others: what is false is mostly false in many places.
    """
    claims = tuple(claims)
    total = sum(claimed.size for claimed in claims)
    failure, _ = _in_order(
        (_task(claimed, machine, claimed.samples()) for claimed in claims), 1, lambda _: None
    )
    if failure is not None:
        return failure, 0
    processes = min(workers, total // WORTH_A_PROCESS)
    return _in_order(_tasks(machine, claims), processes, lambda done: watch(Progress(done, total)))


def _task(claimed: Claimed, machine: Machine, some: tuple[Leaf, ...]) -> Task:
    return Task(claimed.index, claimed.statement, machine, claimed.domain, some)


def _tasks(machine: Machine, claims: Iterable[Claimed]) -> Iterator[Task]:
    for claimed in claims:
        waiting = claimed.leaves()
        while some := tuple(islice(waiting, TOGETHER)):
            yield _task(claimed, machine, some)


def _in_order(
    tasks: Iterable[Task], processes: int, watch: Callable[[int], None]
) -> tuple[Failure | None, int]:
    done = 0
    for task, failed in _results(tasks, processes):
        if failed is not None:
            return Failure(task.index, task.leaves[failed]), done + failed
        done += len(task.leaves)
        watch(done)
    return None, done


def _results(tasks: Iterable[Task], processes: int) -> Iterator[tuple[Task, int | None]]:
    """Each task with the place of its first leaf that could not be proved, in order."""
    if processes <= 1:
        yield from ((task, first_unproved(task)) for task in tasks)
        return
    with closing(in_a_thread(_results_of_processes(tasks, processes))) as results:
        yield from results


def _results_of_processes(tasks: Iterable[Task], processes: int) -> Generator[tuple[Task, int | None]]:
    # started afresh, as everywhere but on Linux, so that nothing depends on what this process has loaded
    with ProcessPoolExecutor(processes, get_context("spawn"), _leave_interrupts) as pool:
        ahead: deque[tuple[Task, Future[int | None]]] = deque()
        try:
            for task in tasks:
                ahead.append((task, pool.submit(first_unproved, task)))
                if len(ahead) > 4 * processes:
                    first, result = ahead.popleft()
                    yield first, result.result()
            for task, result in ahead:
                yield task, result.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _leave_interrupts() -> None:
    """An interrupt is for the process that waits for the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def first_unproved(task: Task) -> int | None:
    """The place of the first leaf of a task that cannot be proved again."""
    machines = task.machine.within_tolerance()
    for place, (box, letter) in enumerate(task.leaves):
        if not _holds(task.statement, machines, task.domain, box, letter):
            return place
    return None


def _holds(statement: Statement, machines: Machines, domain: Domain, box: Box, letter: Letter) -> bool:
    if letter == "o":
        return domain.outside(box)
    if letter == "n":
        return isinstance(statement, Locus) and never_reached(machines, box)
    return proved(statement, machines, domain, box)


def volume(box: Box) -> float:
    (a, b), (c, d), (e, f) = box
    return (b - a) * (d - c) * (f - e)
