"""Margins and conditioning at many poses: the compiled rows against C and NumPy."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np

from machines import DESIGNS, machine
from numpy_formulas import conditioning, margins
from row import Row, interleaved, seconds
from tpm_design.mechanisms.pointwise import frobenius_row, reach_row, singularity_row

POSES = 20_000
# NumPy in blocks that stay in the cache
BLOCK = 2_000
ROUNDS, REPEATS = 15, 20
DESIGN = "R2"
COMPILER = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
FLAGS = ("-O3", "-march=native", "-ffast-math")
C_TARGET, NUMPY_TARGET = 0.8, 8.0

Call = Callable[[], float]


def compiled(folder: Path) -> Path | None:
    """The C program, or None without a compiler."""
    if COMPILER is None:
        return None
    program = folder / "point_kernel"
    source = Path(__file__).with_suffix(".c")
    subprocess.run([COMPILER, *FLAGS, str(source), "-o", str(program), "-lm"], check=True)
    return program


def c_call(program: Path, folder: Path, what: str) -> Call:
    """Seconds by C, in a process of its own: -ffast-math flushes denormals for the whole process."""

    def call() -> float:
        files = folder / "in", folder / f"{what}.out"
        words = [str(word) for word in (program, what, POSES, REPEATS, *files)]
        output = subprocess.run(words, check=True, capture_output=True, text=True).stdout
        return median(float(line) for line in output.split())

    return call


def in_blocks(function: Callable[..., object], x: np.ndarray, y: np.ndarray, z: np.ndarray) -> None:
    for first in range(0, POSES, BLOCK):
        block = slice(first, first + BLOCK)
        function(x[block], y[block], z[block])


def rows() -> list[Row]:
    uru = machine(DESIGN)
    mode = uru.mode(octant="+++", elbows="+++")
    geometry, signs = uru.geometry, mode.signs
    x, y, z = np.random.default_rng(1).uniform(0.0, 1.2, (3, POSES))
    dimensions = DESIGNS[DESIGN]
    numbers = dimensions["dp"] - dimensions["db"], dimensions["f"], dimensions["r"], dimensions["k"]
    legs, side, determinants = np.empty(POSES), np.empty(POSES), np.empty((3, POSES))
    condition = np.empty(POSES)

    def our_margins() -> None:
        reach_row(geometry, signs, x, y, z, legs, side)
        singularity_row(geometry, signs, x, y, z, determinants)

    def our_conditioning() -> None:
        frobenius_row(geometry, signs, 1.0, x, y, z, condition)

    tasks: list[tuple[str, str, Callable[[], object], Callable[..., object]]] = [
        ("reach, det V, det W, det H", "margins", our_margins, partial(margins, *numbers)),
        (
            "1/κ_F",
            "conditioning",
            our_conditioning,
            partial(conditioning, *numbers),
        ),
    ]
    table = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        groups = (
            geometry.base, geometry.platform, geometry.proximal, geometry.distal, geometry.gear,
            signs.octant, signs.elbows,
        )  # fmt: skip
        (folder / "in").write_bytes(np.concatenate([np.ravel(groups), x, y, z]).tobytes())
        program = compiled(folder)
        for title, what, ours, numpy in tasks:
            ours()
            calls: list[Call] = [
                partial(seconds, ours, REPEATS),
                partial(seconds, partial(in_blocks, numpy, x, y, z), 3),
            ]
            if program is not None:
                calls.append(c_call(program, folder, what))
            times = interleaved(calls, ROUNDS)
            rates = [POSES / time / 1e6 for time in times]
            values = np.vstack([legs, side, determinants]) if what == "margins" else condition[None]
            expected = np.atleast_2d(np.asarray(numpy(x, y, z)))
            assert_close(values, expected, "NumPy")
            if program is None:
                table.append(Row(f"{title}: C", f"{rates[0]:.1f} M/s", "no compiler", "-", "-", None))
            else:
                assert_close(values, np.fromfile(folder / f"{what}.out").reshape(values.shape), "C")
                table.append(against(f"{title}: C", rates[0], rates[2], C_TARGET))
            table.append(against(f"{title}: NumPy", rates[0], rates[1], NUMPY_TARGET))
    return table


def against(name: str, ours: float, peer: float, target: float) -> Row:
    ratio = ours / peer
    return Row(name, f"{ours:.1f} M/s", f"{peer:.1f} M/s", f"{ratio:.2f}", f"≥ {target:g}", ratio >= target)


def assert_close(ours: np.ndarray, peer: np.ndarray, name: str) -> None:
    if not np.allclose(ours, peer, rtol=1e-9, atol=1e-9):
        difference = np.abs(ours - peer).max()
        raise SystemExit(f"{name} computes something else: the largest difference is {difference}")
