"""A mechanism is added by one source file and one data file: a toy one, put beside the others in a copy."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).parents[2]
TOY = PROJECT / "tests" / "plug_ins"


def test_a_toy_mechanism_passes_every_contract(tmp_path: Path) -> None:
    shutil.copytree(PROJECT / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__"))
    for folder in ("contract", "papers"):
        shutil.copytree(
            PROJECT / "tests" / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(TOY / "gantry.py", tmp_path / "src" / "tpm_design" / "mechanisms")
    shutil.copy(TOY / "gantry.yaml", tmp_path / "papers")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "src")}
    chosen = ["-k", "gantry or published", "-p", "no:cacheprovider", "-p", "no:xdist", "-c", os.devnull]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", *chosen, "--rootdir", tmp_path, tmp_path],
        capture_output=True,
        text=True,
        env=environment,
        timeout=500,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    told = [line for line in done.stdout.splitlines() if "passed" in line]
    assert int(told[-1].split(" passed")[0].split()[-1]) >= 12, done.stdout[-500:]
