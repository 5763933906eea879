"""Dask clusters of real processes, and tasks for their workers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.result import Evaluation
from tpm_design.problem import Problem


def environment(problem: Problem, name: str) -> str | None:
    """A worker's environment variable."""
    return os.environ.get(name)


def evaluated_or_killed(problem: Problem, item: tuple[dict[str, float | str], str]) -> Evaluation:
    """An evaluation; whoever meets a file's name first, or no name but "always", is gone at once."""
    design, killer = item
    if killer:
        with suppress(FileExistsError):
            if killer != "always":
                Path(killer).touch(exist_ok=False)
            os.kill(os.getpid(), signal.SIGKILL)
    return evaluate(problem, design)


@contextmanager
def started(*words: str, more: Mapping[str, str], log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A process, ended with all that it began."""
    with log.open("wb") as file:
        running = subprocess.Popen(
            [sys.executable, "-m", *words], stdout=file, stderr=file, env=os.environ | more
        )
        try:
            yield running
        finally:
            with suppress(psutil.NoSuchProcess):
                begun = psutil.Process(running.pid).children(recursive=True)
                running.kill()
                for child in begun:
                    with suppress(psutil.NoSuchProcess):
                        child.kill()
            running.wait()


@contextmanager
def scheduler(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """A scheduler and its address."""
    log = folder / "scheduler.log"
    words = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    with started("distributed.cli.dask_scheduler", *words, more={}, log=log) as running:
        yield running, said(running, log, "Scheduler at:").split()[-1]


@contextmanager
def worker(address: str, folder: Path, more: Mapping[str, str]) -> Iterator[None]:
    """A worker of one thread that has joined a scheduler; ``more``: of its environment."""
    log = folder / "worker.log"
    words = ("--nthreads", "1", "--no-dashboard", "--local-directory", str(folder))
    with started("distributed.cli.dask_worker", address, *words, more=more, log=log) as running:
        said(running, log, "Registered to:")
        yield


def said(running: subprocess.Popen[bytes], log: Path, words: str) -> str:
    """The first line of a log with these words, as soon as it is there."""
    while running.poll() is None:
        for line in log.read_text(encoding="utf-8").splitlines():
            if words in line:
                return line
        time.sleep(0.02)
    raise AssertionError(log.read_text(encoding="utf-8"))
