"""A search that is killed again and again, each time in a process of its own, then resumed to its end.

Run as a program: the study, the folder of runs, how often it is killed, the seed of the moments. Processes
are forked from this one, so that what is imported and compiled is there at once.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from pathlib import Path

import tpm_design as tpm
from tpm_design.study import Study

LONGEST_WAIT = 60.0


def lines_in(results: Path) -> int:
    logs = list(results.glob("*/*/evaluations.jsonl"))
    return logs[0].read_bytes().count(b"\n") if logs else 0


def searched(study: Study, results: Path) -> None:
    """From the start, or from where the last process was killed."""
    begun = any(results.glob("*/*/evaluations.jsonl"))
    study.optimize(output=results, resume="latest" if begun else None)


def killed(study: Study, results: Path, chance: random.Random) -> bool:
    """Whether the kill came before the end: after a few further evaluations and a moment more."""
    wanted, moment = lines_in(results) + chance.randrange(10), chance.uniform(0.0, 0.03)
    child = os.fork()
    if child == 0:
        searched(study, results)
        os._exit(0)
    began = time.monotonic()
    while lines_in(results) < wanted and time.monotonic() - began < LONGEST_WAIT:
        time.sleep(0.001)
    time.sleep(moment)
    os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL


def main(path: Path, results: Path, times: int, seed: int) -> None:
    study, chance = tpm.load_study(path), random.Random(seed)
    study.optimize(budget=4)
    print(sum(killed(study, results, chance) for _ in range(times)))
    searched(study, results)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
