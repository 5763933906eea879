"""A search or a sweep that is killed again and again, each time in a process of its own, then resumed to its
end.

Run as a program: the study, the folder of runs, how often it is killed, the seed of the moments, and for a
sweep its shard, such as 1/1. Processes
are forked from this one, so that what is imported and compiled is there at once.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from contextlib import closing
from pathlib import Path

import tpm_design as tpm
from tpm_design.runs.executors import Threads
from tpm_design.runs.sweeps import Shard
from tpm_design.study import Study
from tpm_design.study.resuming import run_to_resume
from tpm_design.study.sweeping import sweep_study


def lines_in(results: Path) -> int:
    logs = list(results.glob("*/*/evaluations.jsonl"))
    return logs[0].read_bytes().count(b"\n") if logs else 0


def carried_out(study: Study, results: Path, shard: Shard | None) -> None:
    """From the start, or from where the last process was killed."""
    resume = "latest" if any(results.glob("*/*/evaluations.jsonl")) else None
    if shard is None:
        study.optimize(output=results, resume=resume)
        return
    folder = None if resume is None else run_to_resume(study, resume, results, shard)
    with closing(Threads(2)) as threads:
        sweep_study(study, shard=shard, executor=threads, output=results, resume=folder)


def killed(study: Study, results: Path, shard: Shard | None, chance: random.Random) -> bool:
    """Whether the kill came before the end: after a few further evaluations and a moment more."""
    wanted, moment = lines_in(results) + chance.randrange(10), chance.uniform(0.0, 0.03)
    child = os.fork()
    if child == 0:
        carried_out(study, results, shard)
        os._exit(0)
    # a child that has ended stays until it is asked for its status: killing it harms nobody else
    while lines_in(results) < wanted and not ended(child):
        time.sleep(0.001)
    time.sleep(moment)
    os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL


def ended(child: int) -> bool:
    return os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None


def main(path: Path, results: Path, times: int, seed: int, shard: Shard | None) -> None:
    study, chance = tpm.load_study(path), random.Random(seed)
    study.optimize(budget=4)
    kills = 0
    while kills < times:
        kills += killed(study, results, shard, chance)
    carried_out(study, results, shard)


if __name__ == "__main__":
    part = Shard(*map(int, sys.argv[5].split("/"))) if sys.argv[5:] else None
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]), part)
