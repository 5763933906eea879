"""Problems and tasks on their way to other processes: no code travels, what is registered has a name."""

from __future__ import annotations

import io
import pickle
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from functools import lru_cache
from importlib.metadata import version
from typing import Any

from tpm_design.errors import RefusedError, RunStoppedError
from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import Metric
from tpm_design.problem import Problem
from tpm_design.runs.executors import SWITCH_INTERVAL, Item, Result

KEPT = 8
"""Problems that a worker keeps unpacked."""


def packed(problem: Problem) -> bytes:
    """A problem for ``unpacked``, in another process with the same version of this program. Raises
    RefusedError where its mechanism is not part of the program."""
    file = io.BytesIO()
    _Packer(file).dump(problem)
    return file.getvalue()


@lru_cache(maxsize=KEPT)
def unpacked(data: bytes) -> Problem:
    """The problem in ``data``."""
    problem: Problem = _Unpacker(io.BytesIO(data)).load()
    return problem


class _Packer(pickle.Pickler):
    def persistent_id(self, thing: Any) -> tuple[str, str] | None:
        if isinstance(thing, Metric) and METRICS.get(thing.name) is thing:
            return ("metric", thing.name)
        if not isinstance(thing, MechanismKind):
            return None
        if MECHANISMS.get(thing.name) is not thing:
            raise RefusedError(
                f"{thing.name} is a mechanism from a file, which other processes do not have.",
                remedy="Evaluate it on threads, without --dask.",
            )
        return ("mechanism", thing.name)


class _Unpacker(pickle.Unpickler):
    def persistent_load(self, name: Any) -> Any:
        room, which = name
        return MECHANISMS[which] if room == "mechanism" else METRICS[which]


def carried_out(
    items: Sequence[Item], *, writer: str, task: Callable[[Problem, Item], Result], data: bytes
) -> tuple[list[Result], float]:
    """What ``task`` gives for each item, and the seconds this took. ``data``: a problem ``packed`` by version
    ``writer``. Raises RunStoppedError where this process has another version of the program.
    """
    mine = version("tpm-design")
    if mine != writer:
        raise RunStoppedError(
            f"A worker has tpm-design {mine}, and this is {writer}: numbers may differ.",
            remedy="Install the same version on all workers, then go on with --resume latest.",
        )
    sys.setswitchinterval(SWITCH_INTERVAL)
    problem = unpacked(data)
    began = time.perf_counter()
    results = [task(problem, item) for item in items]
    return results, time.perf_counter() - began


def portable(error: Exception) -> Exception:
    """The exception, or one with its words where it cannot travel, with its traceback in words."""
    try:
        pickle.loads(pickle.dumps(error))
        told = error
    except Exception:
        told = RuntimeError(f"{type(error).__name__}: {error}").with_traceback(error.__traceback__)
    told.add_note("".join(traceback.format_exception(error)))
    return told
