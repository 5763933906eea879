"""Evaluations on the workers of a Dask cluster (extra ``dask``).

What is sent are chunks of items, large enough that their number costs little. A chunk whose worker is lost
is given to another one by the scheduler.
"""

from __future__ import annotations

import asyncio
import logging
import math
import re
import signal
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from itertools import accumulate
from statistics import median
from typing import TYPE_CHECKING, Any

from tpm_design.errors import RunStoppedError, UsageError
from tpm_design.problem import Problem
from tpm_design.runs.executors import Item, Result
from tpm_design.runs.shipping import carried_out, packed
from tpm_design.worker_threads import in_a_thread

if TYPE_CHECKING:
    from distributed import Client

LOCAL = "local"

SECONDS_TO_ANSWER = 10.0

CHUNK_SECONDS = 0.25
"""What a chunk takes, far from the end of the items: long against the milliseconds that it costs, short for
whoever has to wait for it, or to do it again."""

HANDLING_SECONDS = 0.004
"""What scheduler and driver may take for a chunk, twice what they do. Chunks are so large that they keep up
with any number of workers, and that what a few items take is not spent on handing them out one by one."""

FIRST_GUESS = 0.05
"""Seconds of an item before any has ended."""

WAITING_LEAST, WAITING_MOST = 2, 4
"""Chunks handed out at a time, for each thread of a worker: filled up to the second number when the first one
is reached."""

SECONDS_BETWEEN_COUNTS = 1.0
"""How old the number of threads may be."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment of local workers: as many of them as processors, each on one."""

MEMORY_IS_KEPT: dict[str, None] = {"distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None}
"""Dask has workers hand freed memory back at once. Kernels ask for as much again some microseconds later: an
evaluation took a tenth longer."""

QUIET = ("distributed", "distributed.client", "tornado", "tornado.application", "asyncio")
"""Loggers that would tell of lost connections in their own way."""


@contextmanager
def dask_workers(address: str, processes: int) -> Iterator[DaskWorkers]:
    """Workers of the scheduler at ``address``; "local": of so many new processes of this machine.

    Raises UsageError where Dask is not installed, nobody answers at the address, or its workers have another
    version of this program.
    """
    if address != LOCAL:
        check_address(address)
    _check_installed()
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        cluster = None
        if address == LOCAL:
            cluster = stack.enter_context(_local_cluster(processes))
        client = stack.enter_context(_client(address if cluster is None else cluster))
        _check_workers(client, address)
        yield DaskWorkers(client)


def check_address(address: str) -> None:
    """Raises UsageError for what cannot be the address of a scheduler."""
    if not re.fullmatch(
        r"(tcp://|tls://|ws://|wss://|ucx://)?(\[[0-9A-Fa-f:.%]+\]|[\w.-]+):\d{1,5}", address
    ):
        raise UsageError(
            f"{address!r} is no address of a Dask scheduler.",
            where="--dask",
            remedy="Write tcp://HOST:PORT as the scheduler prints it, or local.",
        )


class DaskWorkers:
    """As ``Executor``, on all workers of a cluster, those included that join later."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._version = version("tpm-design")
        self._problem: Problem | None = None
        self._data: Any = None
        self._means: deque[float] = deque(maxlen=9)
        self._counted, self._threads = -math.inf, 1

    @property
    def workers(self) -> int:
        """As ``Executor``: threads of all workers, at least 1."""
        return self._threads

    def _count(self) -> None:
        """Count the threads, from time to time. Raises RunStoppedError."""
        now = time.monotonic()
        if now - self._counted > SECONDS_BETWEEN_COUNTS:
            with _lost_connection_told():
                self._counted, self._threads = now, max(1, sum(self._client.nthreads().values()))

    def as_they_end(
        self, task: Callable[[Problem, Item], Result], problem: Problem, items: Sequence[Item]
    ) -> Generator[tuple[int, Result]]:
        """As ``Executor``. ``task`` is a function that a module of this program holds by its name."""
        with closing(in_a_thread(self._chunks_as_they_end(task, problem, items))) as chunks:
            for first, results in chunks:
                yield from enumerate(results, start=first)

    def from_queue(
        self, task: Callable[[Problem, Item], Result], problem: Problem, queue: deque[Item]
    ) -> Generator[tuple[int, Result]]:
        """As ``Executor``: what is added comes to the workers once what was there before has ended."""
        ended = 0
        while queue:
            items = tuple(queue)
            queue.clear()
            with closing(self.as_they_end(task, problem, items)) as results:
                for place, result in results:
                    yield ended + place, result
            ended += len(items)

    def _chunks_as_they_end(
        self, task: Callable[[Problem, Item], Result], problem: Problem, items: Sequence[Item]
    ) -> Generator[tuple[int, list[Result]]]:
        """The place of each chunk's first item, and the results."""
        from distributed import as_completed

        ended = as_completed(with_results=True, raise_errors=False, loop=self._client.loop)
        firsts: dict[Any, int] = {}
        begun = 0
        try:
            while firsts or begun < len(items):
                self._count()
                if len(firsts) <= WAITING_LEAST * self._threads and begun < len(items):
                    sizes = self._sizes(len(items) - begun, WAITING_MOST * self._threads - len(firsts))
                    for future, size in zip(
                        self._submitted(task, problem, items[begun : begun + sum(sizes)], sizes),
                        sizes,
                        strict=True,
                    ):
                        firsts[future] = begun
                        begun += size
                        ended.add(future)
                for future, outcome in ended.next_batch():
                    results, seconds = _outcome(future, outcome)
                    self._means.append(seconds / len(results))
                    yield firsts.pop(future), results
        finally:
            if firsts:
                # where the scheduler is gone there is nothing left to be dropped
                with suppress(Exception):
                    self._client.cancel(list(firsts))

    def close(self) -> None:
        """As ``Executor``; the connection is closed by ``dask_workers``."""

    def _sizes(self, left: int, most: int) -> list[int]:
        """Sizes of the next chunks, at most so many: smaller towards the end, so that all workers end
        together."""
        each = max(median(self._means) if self._means else FIRST_GUESS, 1e-6)
        cost = HANDLING_SECONDS / each
        longest = math.ceil(max(self._threads * cost, CHUNK_SECONDS / each))
        sizes: list[int] = []
        while left and len(sizes) < most:
            least = min(self._threads * cost, math.sqrt(left * cost))
            share = min(longest, left / (2 * self._threads))
            sizes.append(min(left, math.ceil(max(least, share))))
            left -= sizes[-1]
        return sizes

    def _submitted(
        self,
        task: Callable[[Problem, Item], Result],
        problem: Problem,
        items: Sequence[Item],
        sizes: Sequence[int],
    ) -> list[Any]:
        """A future for each chunk of so many items."""
        ends = list(accumulate(sizes))
        chunks = [items[end - size : end] for size, end in zip(sizes, ends, strict=True)]
        with _lost_connection_told():
            if problem is not self._problem:
                # a task's result can be had again, scattered data are lost with the worker that holds them
                self._data = self._client.submit(bytes, packed(problem), pure=False)
                self._problem = problem
            futures: list[Any] = self._client.map(
                carried_out, chunks, writer=self._version, task=task, data=self._data, pure=False
            )
        return futures


def _outcome(future: Any, outcome: Any) -> Any:
    """What ``carried_out`` returned. Raises what it raised, and RunStoppedError for a chunk that is lost."""
    from distributed import KilledWorker

    if future.status == "finished":
        return outcome
    if future.status != "error":
        raise _connection_lost()
    _, error, trace = outcome
    if isinstance(error, KilledWorker):
        raise RunStoppedError(
            "The same designs were lost with one Dask worker after the other.",
            remedy="See the workers' logs, perhaps give them more memory; then go on with --resume latest.",
        )
    if isinstance(error, ModuleNotFoundError):
        raise RunStoppedError(
            f"A Dask worker lacks {error.name}.",
            remedy="Install tpm-design on all workers, then go on with --resume latest.",
        )
    raise error.with_traceback(trace)


def _connection_lost() -> RunStoppedError:
    return RunStoppedError(
        "The connection to the Dask scheduler is lost.",
        remedy="Start the cluster again, then go on with --resume latest; what was evaluated before is kept.",
    )


@contextmanager
def _lost_connection_told() -> Iterator[None]:
    """Raises RunStoppedError where a scheduler that was there does not answer."""
    try:
        yield
    except (OSError, RuntimeError, asyncio.CancelledError):
        raise _connection_lost() from None


def _check_installed() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise UsageError(
            "Dask is not installed.",
            where="--dask",
            remedy="Install it with `pip install 'tpm-design[dask]'`, or leave --dask out for threads.",
        ) from None


@contextmanager
def _local_cluster(processes: int) -> Iterator[Any]:
    """A scheduler in this process, so many workers in their own."""
    import dask.config
    from distributed import LocalCluster

    cluster = None
    try:
        with _interrupts_held_back(), dask.config.set(MEMORY_IS_KEPT):
            cluster = LocalCluster(
                n_workers=processes,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                dashboard_address=None,
                # its web server is on port 8787 otherwise, which may be taken
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                memory_limit=0,
                silence_logs=logging.CRITICAL,
                env=dict.fromkeys(THREADS, "1"),
            )
            _measure_no_garbage_collection()
        yield cluster
    finally:
        if cluster is not None:
            cluster.close()


def _measure_no_garbage_collection() -> None:
    """A scheduler looks at each collection of garbage, and there an interrupt would be swallowed."""
    # other versions may have it elsewhere
    with suppress(ImportError):
        from distributed.gc import disable_gc_diagnosis

        disable_gc_diagnosis(force=True)


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Threads and processes that begin here, and those that they begin, never get the Ctrl-C of the terminal:
    it is this thread's alone, which hears of it afterwards."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    # begun elsewhere, it would let interrupts through there
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _client(cluster: Any) -> Iterator[Client]:
    """A connection to a cluster, or to the scheduler at an address. Raises UsageError."""
    from distributed import Client

    if isinstance(cluster, str):
        try:
            # a client that got no answer would tell so again when it is thrown away
            asyncio.run(asyncio.wait_for(_knock(cluster), SECONDS_TO_ANSWER))
        except Exception as error:
            why = " ".join(str(error).split()) or f"nothing was heard in {SECONDS_TO_ANSWER:g} s"
            raise UsageError(
                f"No Dask scheduler answers at {cluster}: {why}.",
                where="--dask",
                remedy="Check the address and that the scheduler runs, or write --dask local.",
            ) from None
    client = Client(cluster, timeout=SECONDS_TO_ANSWER, set_as_default=False, name="tpm-design")
    try:
        yield client
    finally:
        with suppress(Exception):
            client.close(timeout=2)


async def _knock(address: str) -> None:
    """Say hello to a scheduler. Raises whatever goes wrong."""
    from distributed import Security
    from distributed.core import connect

    secured = Security().get_connection_args("client")
    comm = await connect(address, timeout=SECONDS_TO_ANSWER, **secured)
    try:
        await comm.write({"op": "identity", "n_workers": 0, "reply": True})
        answer = await comm.read()
        if not isinstance(answer, dict) or answer.get("type") != "Scheduler":
            raise ValueError("what is there is no scheduler")
    finally:
        comm.abort()


def _check_workers(client: Client, address: str) -> None:
    """Raises UsageError unless there are workers, all with this version of the program."""
    mine = version("tpm-design")
    found = client.run(version, "tpm-design", on_error="return")
    if not found:
        raise UsageError(
            f"The Dask scheduler at {address} has no workers.",
            where="--dask",
            remedy="Start some, and wait until they have joined.",
        )
    for worker, theirs in found.items():
        if isinstance(theirs, PackageNotFoundError):
            told = "does not have tpm-design"
        elif isinstance(theirs, Exception):
            told = f"cannot be asked for its version ({type(theirs).__name__})"
        elif theirs != mine:
            told = f"has tpm-design {theirs}, and this is {mine}: numbers may differ"
        else:
            continue
        raise UsageError(
            f"The Dask worker {worker} {told}.",
            where="--dask",
            remedy=f"Install tpm-design {mine} on all workers and start them again.",
        )


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the log messages that tell of every lost worker."""
    loggers = [logging.getLogger(name) for name in QUIET]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
