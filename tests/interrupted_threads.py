"""Threads that are interrupted again and again, at random moments, each time once more soon afterwards.

Run as a program: how often, and the seed of the moments. It ends with code 0 and prints nothing but what a
worker, or the interpreter, has to say of interrupts that went astray.
"""

from __future__ import annotations

import faulthandler
import itertools
import random
import signal
import sys
import time
from collections.abc import Generator
from contextlib import closing
from typing import Any, NoReturn, cast

from tpm_design.runs.executors import Threads
from tpm_design.worker_threads import in_a_thread

LONGEST, LONGEST_BETWEEN = 2e-3, 3e-4
"""Seconds until the first interrupt, which may be before the threads have begun, and to the second one, which
may be during the cleaning up."""

SECONDS_TO_HANG = 20.0


class Moments:
    """Two interrupts, drawn anew each time."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self.left = 0
        signal.signal(signal.SIGALRM, self._interrupt)

    def draw(self) -> None:
        self.left = 2
        signal.setitimer(signal.ITIMER_REAL, self._random.uniform(1e-6, LONGEST))

    def _interrupt(self, *_: object) -> NoReturn:
        self.left -= 1
        if self.left:
            signal.setitimer(signal.ITIMER_REAL, self._random.uniform(1e-6, LONGEST_BETWEEN))
        raise KeyboardInterrupt


def square(_: object, number: int) -> int:
    return number * number


def endless() -> NoReturn:
    """Tiny tasks, until an interrupt comes."""
    with closing(Threads(2)) as threads:
        while True:
            with closing(threads.as_they_end(square, cast(Any, None), range(50))) as results:
                for place, result in results:
                    assert result == place * place


def endless_elsewhere() -> None:
    """Numbers that another thread counts, until an interrupt comes."""
    with closing(in_a_thread(counted())) as numbers:
        for expected, number in enumerate(numbers):
            assert number == expected


def counted() -> Generator[int]:
    yield from itertools.count()


def main(times: int, seed: int) -> None:
    moments = Moments(seed)
    for number in range(times):
        faulthandler.dump_traceback_later(SECONDS_TO_HANG, exit=True)
        try:
            try:
                moments.draw()
                endless_elsewhere() if number % 3 == 0 else endless()
            finally:
                while moments.left:
                    time.sleep(1e-5)
        except KeyboardInterrupt:
            pass
        faulthandler.cancel_dump_traceback_later()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
