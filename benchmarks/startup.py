"""How long the command and the package take to start."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from functools import partial

from row import Row, interleaved, seconds

ROUNDS = 9
TARGET = 0.3
COMMAND = (sys.executable, "-c", "from tpm_design.cli import main; main()")


def run(words: tuple[str, ...], cache: str, bytecode: str) -> None:
    changes = {"XDG_CACHE_HOME": cache, "PYTHONPYCACHEPREFIX": bytecode, "PYTHONDONTWRITEBYTECODE": ""}
    subprocess.run(words, check=True, capture_output=True, env=os.environ | changes)


def cold(words: tuple[str, ...], bytecode: str | None) -> float:
    """With an empty kernel cache, and without ``bytecode`` with no bytecode either."""
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as empty:
        return seconds(partial(run, words, cache, bytecode or empty))


def rows() -> list[Row]:
    help_words = (*COMMAND, "--help")
    import_words = (sys.executable, "-c", "import tpm_design")
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as bytecode:
        calls = {
            "tpm-design --help": partial(seconds, partial(run, help_words, cache, bytecode)),
            "tpm-design --help, no kernels": partial(cold, help_words, bytecode),
            "tpm-design --help, no bytecode": partial(cold, help_words, None),
            "import tpm_design": partial(seconds, partial(run, import_words, cache, bytecode)),
            "python": partial(seconds, partial(run, (sys.executable, "-c", "pass"), cache, bytecode)),
        }
        # the first round writes the bytecode
        interleaved(list(calls.values()), 1)
        times = dict(zip(calls, interleaved(list(calls.values()), ROUNDS), strict=True))
    empty = times.pop("python")
    return [
        Row(title, f"{time:.2f} s", f"{empty:.2f} s", f"{time / empty:.1f}", f"< {TARGET:g} s", time < TARGET)
        for title, time in times.items()
    ]
