"""Every registered mechanism: equations at many poses against C and NumPy, over boxes, and first calls.

C is written for a mechanism by adding kernels/<name>.c. Poses lie in the box of what the mechanism's example
reaches, widened by a tenth on each side.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import mechanism_kernels
import numpy_formulas
from row import Row, interleaved, seconds
from tpm_design.mechanisms import MECHANISMS, pointwise
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.workspace.box_verdicts import constraint_counts

POSES = 20_000
# NumPy in blocks that stay in the cache
BLOCK = 2_000
ROUNDS, REPEATS = 15, 20
BOXES, BOX_ROUNDS = 20_000, 5
# of a box, as a share of the reach
HALF_WIDTH = 0.005
ASSEMBLIES = 20
COMPILER = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
FLAGS = ("-O3", "-march=native", "-ffast-math")
C_TARGET, NUMPY_TARGET = 0.8, 8.0
KERNELS = Path(__file__).parent / "kernels"
FIRST_CALLS = Path(__file__).with_name("first_calls.py")

Array = np.ndarray
Call = Callable[[], float]


@dataclass(frozen=True)
class Rates:
    """Million poses/s; None: nothing to compare with."""

    ours: float
    c: float | None
    numpy: float | None


@dataclass(frozen=True)
class Figures:
    """What was measured of one mechanism. Times in seconds: per box, per pose, per call."""

    margins: Rates
    condition: Rates
    everything: Rates
    intervals: float
    slopes: float
    forms: float | None
    inverse: float
    forward: float
    first_pointwise: float
    first_proofs: float | None


class Subject:
    """One machine, its first mode, poses in and around its workspace, and room for what is computed there."""

    def __init__(self, machine: Mechanism) -> None:
        self.machine = machine
        kind = machine.kind
        self.signs = {field.name: "+" * field.length for field in kind.mode_fields}
        self.mode: Mode = machine.mode_of(self.signs)
        count = len(kind.determinants)
        self.out = np.empty((3 + count, POSES))
        self.poses = self._poses()
        self.inside = self.poses[:, self._inside(self.poses)]

    def _inside(self, poses: Array) -> Array:
        legs, side = np.empty(poses.shape[1]), np.empty(poses.shape[1])
        pointwise.reach_row(self.machine.geometry, self.mode.signs, *poses, legs, side)
        return (legs >= 0.0) & (side > 0.0)

    def _poses(self) -> Array:
        random = np.random.default_rng(1)
        radius = self.machine.reach_radius()
        found = random.uniform(-radius, radius, (3, 10 * POSES))
        found = found[:, self._inside(found)]
        low, high = found.min(axis=1), found.max(axis=1)
        return np.ascontiguousarray(
            random.uniform(low - 0.1 * (high - low), high + 0.1 * (high - low), (POSES, 3)).T
        )

    def compute_margins(self) -> None:
        """Least reach margin, least mode margin, determinants."""
        geometry, signs, out = self.machine.geometry, self.mode.signs, self.out
        pointwise.margins_row(geometry, signs, *self.poses, out[0], out[1], out[2:-1])

    def compute_condition(self) -> None:
        """1/κ_F of the motors."""
        pointwise.frobenius_row(self.machine.geometry, self.mode.signs, 1.0, *self.poses, self.out[-1])

    def compute_all(self) -> None:
        """The same in one loop."""
        mechanism_kernels.everything(self.machine.geometry, self.mode.signs, *self.poses, self.out)


class Peer:
    """A mechanism's program in C, which runs in a process of its own: -ffast-math flushes denormals."""

    def __init__(self, subject: Subject, source: Path, folder: Path) -> None:
        self.subject, self.folder = subject, folder
        self.program = folder / source.stem
        subprocess.run([str(COMPILER), *FLAGS, str(source), "-o", str(self.program), "-lm"], check=True)
        (folder / "in").write_bytes(subject.poses.tobytes())
        signs = subject.mode.signs._asdict()
        self.words = [
            f"{name}={','.join(repr(float(value)) for value in values)}"
            for name, values in {**subject.machine.parameters, **signs}.items()
        ]

    def run(self, what: str) -> list[float]:
        words = [
            self.program, what, POSES, REPEATS, self.folder / "in", self.folder / "out",
            *self.words,
        ]  # fmt: skip
        done = subprocess.run([str(word) for word in words], check=True, capture_output=True, text=True)
        return [float(line) for line in done.stdout.split()]

    def call(self, what: str) -> float:
        return median(self.run(what))

    def outputs(self) -> Array:
        self.run("all")
        return np.fromfile(self.folder / "out").reshape(self.subject.out.shape)


def in_blocks(functions: tuple[Callable[..., object], ...], poses: Array) -> None:
    for first in range(0, POSES, BLOCK):
        for function in functions:
            with np.errstate(invalid="ignore"):
                function(*poses[:, first : first + BLOCK])


def numpy_of_uru(machine: Mechanism) -> tuple[Callable[..., Any], ...]:
    first = {name: values[0] for name, values in machine.parameters.items()}
    numbers = first["dp"] - first["db"], first["f"], first["r"], first["k"]
    return partial(numpy_formulas.margins, *numbers), partial(numpy_formulas.conditioning, *numbers)


# the mechanisms that somebody wrote down in NumPy: margins, and 1/κ_F
NUMPY = {"uru": numpy_of_uru}


def assert_close(ours: Array, peer: Array, name: str) -> None:
    if not np.allclose(ours, peer, rtol=1e-9, atol=1e-9):
        difference = np.abs(ours - peer).max(axis=1)
        raise SystemExit(f"{name} computes something else: the largest differences are {difference}")


def rates(subject: Subject, folder: Path) -> list[Rates]:
    """Of the margins, of 1/κ_F, and of all in one loop, after a check that all compute the same."""
    name = subject.machine.kind.name
    source = KERNELS / f"{name}.c"
    peer = Peer(subject, source, folder) if COMPILER is not None and source.exists() else None
    written = NUMPY[name](subject.machine) if name in NUMPY else None
    subject.compute_margins()
    subject.compute_condition()
    computed = subject.out.copy()
    subject.compute_all()
    assert_close(subject.out, computed, f"{name}: one loop")
    if peer is not None:
        assert_close(computed, peer.outputs(), f"{name}: C")
    if written is not None:
        # out of reach κ is 0/0 there
        with np.errstate(invalid="ignore"):
            parts = [np.atleast_2d(function(*subject.poses)) for function in written]
        assert_close(computed, np.nan_to_num(np.vstack(parts)), f"{name}: NumPy")
    found = []
    for what, ours, used in (
        ("margins", subject.compute_margins, slice(0, 1)),
        ("condition", subject.compute_condition, slice(1, 2)),
        ("all", subject.compute_all, slice(0, 2)),
    ):
        calls: dict[str, Call] = {"ours": partial(seconds, ours, REPEATS)}
        if peer is not None:
            calls["c"] = partial(peer.call, what)
        if written is not None:
            calls["numpy"] = partial(seconds, partial(in_blocks, written[used], subject.poses), 3)
        times = dict(zip(calls, interleaved(list(calls.values()), ROUNDS), strict=True))
        speeds = {key: POSES / time / 1e6 for key, time in times.items()}
        found.append(Rates(speeds["ours"], speeds.get("c"), speeds.get("numpy")))
    return found


def chart_boxes(centres: Array, half: float) -> tuple[Array, Array, Array]:
    """Axes (N,), octants (N, 3) and boxes (N, 6) of the charts of proved volumes about the centres (3, N)."""
    octants = np.where(centres >= 0.0, 1.0, -1.0).T
    size = np.abs(centres).T
    axes = size.argmax(axis=1)
    turned = np.take_along_axis(size, (axes[:, None] + np.arange(3)) % 3, axis=1)
    t = turned[:, 0]
    low, high = np.maximum(t - half, 0.1 * t) ** 3 / 3.0, (t + half) ** 3 / 3.0
    sides = [low, high]
    for k in (1, 2):
        ratio = turned[:, k] / t
        sides += [np.maximum(ratio - half / t, 0.0), ratio + half / t]
    return axes, octants, np.ascontiguousarray(np.array(sides).T)


def box_times(subject: Subject) -> tuple[float, float, float | None]:
    """Seconds per box: bounds, bounds with those of derivatives, linear forms where poses are positions."""
    machine, signs = subject.machine, subject.mode.signs
    enclosed = machine.enclosed_geometry({})
    half = HALF_WIDTH * machine.reach_radius()
    centres = np.ascontiguousarray(subject.inside[:, np.arange(BOXES) % subject.inside.shape[1]])
    count = sum(constraint_counts(machine.geometry, signs, *centres[:, 0]))
    at_centres, held = np.empty((count, BOXES)), np.empty((count, 2, BOXES))
    slopes = np.empty((count, 2, BOXES, 4))
    boxes = np.ascontiguousarray(np.stack([centres - half, centres + half], axis=-1).swapaxes(0, 1))
    calls = [
        partial(mechanism_kernels.interval_bounds, enclosed, signs, boxes, held),
        partial(mechanism_kernels.slope_bounds, enclosed, signs, boxes, slopes),
    ]
    results = [held, slopes[..., 0]]
    if machine.kind.translational:
        forms = np.empty_like(held)
        charts = chart_boxes(centres, half)
        calls.append(partial(mechanism_kernels.form_bounds, enclosed, signs, *charts, forms))
        results.append(forms)
    mechanism_kernels.values(machine.geometry, signs, centres, at_centres)
    for call, result in zip(calls, results, strict=True):
        call()
        if not ((result[:, 0] <= at_centres + 1e-12) & (at_centres <= result[:, 1] + 1e-12)).all():
            raise SystemExit(f"{machine.kind.name}: a value lies outside its bounds")
    times = [time / BOXES for time in interleaved([partial(seconds, call) for call in calls], BOX_ROUNDS)]
    return times[0], times[1], times[2] if len(times) > 2 else None


def call_times(subject: Subject) -> tuple[float, float]:
    """Seconds per pose of ``ik`` of all poses at once, and per call of ``fk`` of one."""
    machine, mode = subject.machine, subject.mode
    # how long ik takes does not depend on what is asked, be the pose written in coordinates or not
    inverse = partial(machine.ik, np.ascontiguousarray(subject.inside.T), mode)
    inverse()
    actuators = np.empty((subject.inside.shape[1], 3))
    pointwise.actuators_row(machine.geometry, mode.signs, 1.0, *subject.inside, actuators)
    forward = [partial(seconds, partial(machine.fk, q, mode)) for q in actuators[:ASSEMBLIES]]
    forward[0]()
    return seconds(inverse, REPEATS) / len(actuators), median(call() for call in forward)


def first_times(name: str) -> tuple[float, float | None]:
    """Seconds of the first ``margins``, ``ik`` and ``jacobian``, and of the first ``certified_volume``."""
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [sys.executable, str(FIRST_CALLS), name],
            check=True, capture_output=True, text=True, env=os.environ | {"XDG_CACHE_HOME": cache},
        )  # fmt: skip
    found = json.loads(done.stdout)
    return found["pointwise"], found["proofs"]


def figures(name: str) -> Figures:
    kind = MECHANISMS[name]
    subject = Subject(kind.build(kind.example, {}))
    with tempfile.TemporaryDirectory() as folder:
        margins, condition, everything = rates(subject, Path(folder))
    return Figures(
        margins, condition, everything, *box_times(subject), *call_times(subject), *first_times(name)
    )


def against(name: str, ours: float, peer: float | None, target: float) -> Row:
    if peer is None:
        return Row(name, f"{ours:.1f} M/s", "none", "-", "-", None)
    ratio = ours / peer
    return Row(name, f"{ours:.1f} M/s", f"{peer:.1f} M/s", f"{ratio:.2f}", f"≥ {target:g}", ratio >= target)


def table_of(name: str, found: Figures) -> list[Row]:
    table = []
    for title, speed in (
        ("reach and determinants", found.margins),
        ("1/κ_F", found.condition),
        ("both in one loop", found.everything),
    ):
        table.append(against(f"{name}: {title}: C", speed.ours, speed.c, C_TARGET))
        if speed.numpy is not None:
            table.append(against(f"{name}: {title}: NumPy", speed.ours, speed.numpy, NUMPY_TARGET))
    value = 1e3 / found.margins.ours
    for title, time in (
        ("bounds per box", found.intervals),
        ("bounds of slopes per box", found.slopes),
        ("linear forms per box", found.forms),
        ("ik per pose", found.inverse),
        ("fk per call", found.forward),
    ):
        if time is not None:
            ratio = f"{1e9 * time / value:.0f}"
            table.append(Row(f"{name}: {title}", f"{1e9 * time:.0f} ns", f"{value:.1f} ns", ratio, "-", None))
    for title, first in (("calls", found.first_pointwise), ("proof", found.first_proofs)):
        if first is not None:
            table.append(Row(f"{name}: first {title}", f"{first:.1f} s", "-", "-", "-", None))
    return table


def rows() -> list[Row]:
    return [row for name in MECHANISMS for row in table_of(name, figures(name))]


def markdown(names: Sequence[str]) -> str:
    """The table of README.md: one line per mechanism."""
    heads = (
        "mechanism", "margins M/s", "C", "ratio", "1/κ_F M/s", "C", "ratio", "both M/s", "C", "ratio",
        "bounds ns", "slopes ns", "forms ns", "ik ns", "fk µs", "first calls s", "first proof s",
    )  # fmt: skip
    lines = [heads, tuple("---" if k == 0 else "---:" for k in range(len(heads)))]
    for name in names:
        found = figures(name)
        cells = [name]
        for speed in (found.margins, found.condition, found.everything):
            cells.append(f"{speed.ours:.1f}")
            cells += ["-", "-"] if speed.c is None else [f"{speed.c:.1f}", f"{speed.ours / speed.c:.2f}"]
        cells += [
            "-" if time is None else f"{1e9 * time:.0f}"
            for time in (found.intervals, found.slopes, found.forms, found.inverse)
        ]
        cells += [f"{1e6 * found.forward:.0f}", f"{found.first_pointwise:.1f}"]
        cells.append("-" if found.first_proofs is None else f"{found.first_proofs:.1f}")
        lines.append(tuple(cells))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


if __name__ == "__main__":
    print(markdown(sys.argv[1:] or list(MECHANISMS)))
