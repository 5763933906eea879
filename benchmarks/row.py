"""One line of the table, and how times are taken."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median


@dataclass(frozen=True)
class Row:
    """``ratio``: how the two compare, in the sense of ``target``. ``met`` None: nothing to compare."""

    name: str
    ours: str
    peer: str
    ratio: str
    target: str
    met: bool | None


def interleaved(calls: list[Callable[[], float]], rounds: int) -> list[float]:
    """Median of what each call measures; the calls take turns, so that a busy machine slows all of them."""
    measured: list[list[float]] = [[] for _ in calls]
    for _ in range(rounds):
        for results, call in zip(measured, calls, strict=True):
            results.append(call())
    return [median(results) for results in measured]


def seconds(call: Callable[[], object], repeats: int = 1) -> float:
    """Wall time of one call, the median of ``repeats``."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return median(times)
