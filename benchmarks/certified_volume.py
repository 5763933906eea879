"""Proved volumes: time to a gap between the bounds; the reach set against codac's paver, to the same gap."""

from __future__ import annotations

import ctypes
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from paved_designs import PAVED, paved_machine
from row import Row, interleaved, seconds
from tpm_design.mechanisms.uru import Uru
from tpm_design.workspace.certified_volume import CertifiedVolume, certified_volume

MARGIN = 0.02
TO_NEAREST = 0
TARGETS = ((1e-2, 1.0, 3), (1e-3, 60.0, 1))
SPEED_TARGET = 100.0
# of codac's boxes, as a share of the reach: gaps of some 4 % and 2 %
FINENESS = (0.025, 0.0125)
ROUNDS, REPEATS = 3, 5
MOST_BOXES = 20_000_000


def relative_gap(found: CertifiedVolume) -> float:
    return (found.upper - found.lower) / found.lower if found.lower > 0.0 else float("inf")


def codac_gap(codac: Any, uru: Uru, eps: float) -> float:
    """Gap, as a share of the lower bound, of the octant's reach set paved to boxes of ``eps`` (m)."""
    geometry = uru.geometry
    pose = codac.VectorVar(3)
    rings, squares = [], []
    for i in range(3):
        f, r = geometry.proximal[i], geometry.distal[i]
        offset = geometry.platform[i] - geometry.base[i]
        squares.append(
            codac.sqr(pose[i] + offset) + codac.sqr(pose[(i + 1) % 3]) + codac.sqr(pose[(i + 2) % 3])
        )
        rings.append(codac.Interval((f - r) ** 2, (f + r) ** 2))
    separator = codac.SepInverse(
        codac.AnalyticFunction([pose], codac.vec(*squares)), codac.IntervalVector(rings)
    )
    paving = codac.pave(codac.IntervalVector([[0.0, uru.reach_radius()]] * 3), separator, eps)
    # codac leaves the process rounding upwards
    ctypes.CDLL(None).fesetround(TO_NEAREST)

    def volume(kind: Any) -> float:
        return float(sum(box.volume() for box in paving.boxes(kind)))

    return volume(codac.PavingInOut.bound) / volume(codac.PavingInOut.inner)


def closing(name: str, rtol: float, target: float, repeats: int) -> Row:
    """How long the largest aspect's bounds take."""
    call = partial(certified_volume, *paved_machine(name), margin=MARGIN, rtol=rtol, boxes=MOST_BOXES)
    found = call()
    taken = seconds(call, repeats)
    return Row(
        f"certified {name} to {rtol:g}",
        f"{taken:.2f} s, {found.boxes:,} boxes, gap {relative_gap(found):.1e}",
        "-",
        "-",
        f"≤ {target:g} s",
        taken <= target and relative_gap(found) <= rtol,
    )


def against_codac(name: str, share: float) -> Row:
    title = f"certified {name} reach set, boxes of {share:g}"
    if find_spec("codac") is None:
        return Row(title, "-", "codac is not installed", "-", f"≥ {SPEED_TARGET:g}", None)
    codac = import_module("codac")
    uru, mode = paved_machine(name)
    eps = share * uru.reach_radius()
    gap = codac_gap(codac, uru, eps)
    call = partial(certified_volume, uru, mode, "reachable", rtol=gap)
    found = call()
    ours, peer = interleaved(
        [partial(seconds, call, REPEATS), partial(seconds, partial(codac_gap, codac, uru, eps))], ROUNDS
    )
    return Row(
        title,
        f"{1e3 * ours:.1f} ms, gap {relative_gap(found):.1e}",
        f"{peer:.2f} s, gap {gap:.1e}",
        f"{peer / ours:.0f}",
        f"≥ {SPEED_TARGET:g}",
        peer / ours >= SPEED_TARGET,
    )


def rows() -> list[Row]:
    table = [closing(name, *target) for target in TARGETS for name in PAVED]
    return table + [against_codac(name, share) for name in ("R2", "R3") for share in FINENESS]
