"""The volume to 1e-3 by rays against counting the poses of a NumPy grid to the same error."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from scipy import ndimage

from machines import DESIGNS, machine
from numpy_formulas import margins, reachable
from row import Row, interleaved, seconds
from tpm_design.workspace.volume import VolumeKind, workspace_volume

ERROR = 1e-3
ROUNDS, REPEATS = 11, 5
SHARE_TARGET, TIME_TARGET = 0.01, 2e-3
SMALLEST, LARGEST = 24, 100
KINDS: tuple[VolumeKind, ...] = ("reachable", "singularity_free")
# m³, from 3 · 192² rays (R1: exactly 4π/3)
VOLUMES = {
    ("R1", "reachable"): 4.0 * math.pi / 3.0,
    ("R1", "singularity_free"): 4.0 * math.pi / 3.0,
    ("R2", "reachable"): 4.4632171,
    ("R2", "singularity_free"): 4.3767101,
    ("R3", "reachable"): 3.2394547,
    ("R3", "singularity_free"): 3.1791857,
}


def counted(name: str, kind: VolumeKind, size: int) -> float:
    """Volume (m³) of the cells of a size³ grid over the octant whose centre is reachable or, largest
    connected set of equal signs, in the largest aspect."""
    d = DESIGNS[name]
    offset, f, r, k = d["dp"] - d["db"], d["f"], d["r"], d["k"]
    edge = (f + r) / size
    axis = (np.arange(size) + 0.5) * edge
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    inside = reachable(offset, f, r, x, y, z)
    if kind == "reachable":
        return float(np.count_nonzero(inside)) * edge**3
    _, _, translation, actuation, _ = margins(offset, f, r, k, x[inside], y[inside], z[inside])
    code = np.zeros(inside.shape, np.int8)
    code[inside] = 1 + (translation > 0.0) + 2 * (actuation > 0.0)
    most = 0
    for value in np.unique(code[code > 0]):
        parts, _ = ndimage.label(code == value)
        most = max(most, int(np.bincount(parts.ravel())[1:].max()))
    return most * edge**3


def reliable_size(name: str, kind: VolumeKind) -> int:
    """The size from which on every grid up to ``LARGEST`` stays within ``ERROR``."""
    exact = VOLUMES[name, kind]
    for size in range(LARGEST, SMALLEST, -1):
        if abs(counted(name, kind, size) / exact - 1.0) > ERROR:
            return size + 1
    return SMALLEST


def rows() -> list[Row]:
    table = []
    for kind in KINDS:
        for name in DESIGNS:
            uru = machine(name)
            mode = uru.mode(octant="+++", elbows="+++")
            call = partial(workspace_volume, uru, mode, kind, rtol=ERROR)
            found = call().value / VOLUMES[name, kind] - 1.0
            size = reliable_size(name, kind)
            count = partial(counted, name, kind, size)
            ours, peer = interleaved([partial(seconds, call, REPEATS), partial(seconds, count)], ROUNDS)
            table.append(
                Row(
                    f"volume {name} {kind}",
                    f"{1e3 * ours:.2f} ms, {found:+.0e}",
                    f"{1e3 * peer:.1f} ms, {size}³",
                    f"{ours / peer:.3f}",
                    f"≤ {SHARE_TARGET:g}, ≤ {1e3 * TIME_TARGET:g} ms",
                    ours / peer <= SHARE_TARGET and ours <= TIME_TARGET,
                )
            )
    return table
