"""The command line under test: inside this process where that is enough, else as a process of its own."""

from __future__ import annotations

import io
import subprocess
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from small_studies import SHORTEST
from tpm_design.cli.app import app

STUDY = (
    SHORTEST
    + """\
  - {metric: rotation_singularity_distance, min: 20}
optimizer: {method: scipy.differential_evolution, budget: 60, seed: 1}
record: [{metric: velocity_max}]
"""
)


def written(folder: Path, text: str = STUDY, name: str = "study.yaml") -> Path:
    """A study file."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@dataclass(frozen=True)
class Outcome:
    """What a command printed, and its exit code."""

    code: int
    output: str
    errors: str


def tpm_design(*arguments: str | Path) -> Outcome:
    """The outcome of one command, run in this process."""
    output, errors, code = io.StringIO(), io.StringIO(), None
    with redirect_stdout(output), redirect_stderr(errors):
        try:
            app([str(argument) for argument in arguments], prog_name="tpm-design")
        except SystemExit as end:
            code = end.code
    assert isinstance(code, int)
    return Outcome(code, output.getvalue(), errors.getvalue())


def command(*arguments: str | Path) -> list[str]:
    """The command line of a process of its own."""
    return [sys.executable, "-m", "tpm_design", *map(str, arguments)]


def process(arguments: Sequence[str | Path], folder: Path) -> subprocess.CompletedProcess[str]:
    """The outcome of one command in a process of its own, started in ``folder``."""
    return subprocess.run(
        command(*arguments), cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False
    )
