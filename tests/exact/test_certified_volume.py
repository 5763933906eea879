"""Certified volumes: exact values between the bounds, counted grids, parts, limits, any number of threads."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from designs import random_parameters, random_signs
from scipy import ndimage

import tpm_design as tpm
from tpm_design.errors import ParameterError
from tpm_design.mechanisms.mechanism import Mode
from tpm_design.mechanisms.uru import Uru, build
from tpm_design.workspace.volume import VolumeKind

R1 = {"db": 0.0, "dp": 0.0, "f": 1.0, "r": 1.0, "k": 1.0}
R2 = R1 | {"db": 0.3}
R3 = R2 | {"r": 0.8, "k": 0.5}
R4 = {"db": 0.0, "dp": 0.25, "f": 0.9, "r": 1.1, "k": -1.0}
R5 = {"db": 0.2, "dp": 0.0, "f": (1.0, 0.9, 1.1), "r": (1.0, 1.05, 0.95), "k": (1.0, 1.5, 0.8)}


def machine(parameters: dict[str, Any], octant: str = "+++", elbows: str = "+++") -> tuple[Uru, Mode]:
    built = build(parameters, {})
    return built, built.mode(octant=octant, elbows=elbows)


def counted(uru: Uru, mode: Mode, kind: VolumeKind, margin: float, size: int) -> float:
    """Volume (m³) of the cells of a size³ grid over the octant whose centre belongs to the set."""
    edge = uru.reach_radius() / size
    axis = (np.arange(size) + 0.5) * edge
    y, z = (values.ravel() for values in np.meshgrid(axis, axis, indexing="ij"))
    code = np.zeros((size, size, size), np.int8)
    for i, x in enumerate(axis):
        margins = uru.margins(np.stack([np.full(y.size, x), y, z], axis=1) * mode.signs.octant, mode)
        sides = np.ones(y.size, np.int8)
        inside = margins["reach"] >= 0.0
        if kind == "singularity_free":
            for bit, name in ((2, "translation"), (4, "actuation"), (8, "rotation")):
                value = np.nan_to_num(margins[name])
                sides += (bit * (value > 0.0)).astype(np.int8)
                inside &= np.abs(value) > margin
        code[i] = np.where(inside, sides, 0).reshape(size, size)
    if kind == "reachable":
        return float(np.count_nonzero(code)) * edge**3
    most = 0
    for sides in np.unique(code[code > 0]):
        parts, _ = ndimage.label(code == sides)
        most = max(most, int(np.bincount(parts.ravel())[1:].max()))
    return most * edge**3


@pytest.mark.parametrize("radius", [0.35, 1.0])
def test_ball_and_octant(radius: float) -> None:
    """d_b = d_p, f = r = R: 32πR³/3 in all octants and 4πR³/3 in one, which is one aspect for k = 1."""
    parameters = R1 | {"f": radius, "r": radius}
    ball = tpm.certified_volume(*machine(parameters, "any"), "reachable", rtol=2e-3)
    assert ball.lower <= 32 * math.pi * radius**3 / 3 <= ball.upper
    assert ball.upper - ball.lower <= 2e-3 * ball.lower
    octant = tpm.certified_volume(*machine(parameters), margin=0.0, rtol=0.05)
    assert octant.lower <= 4 * math.pi * radius**3 / 3 <= octant.upper
    assert octant.upper - octant.lower <= 0.05 * octant.lower


@pytest.mark.parametrize(("parameters", "reachable", "free"), [(R2, 4.4632, 4.3750), (R3, 3.2392, 3.1790)])
def test_reference_designs(parameters: dict[str, float], reachable: float, free: float) -> None:
    """A 360³ grid, good to 3e-4."""
    for kind, margin, value in (("reachable", 0.0, reachable), ("singularity_free", 0.0, free)):
        found = tpm.certified_volume(*machine(parameters), kind, margin, 0.02)  # type: ignore[arg-type]
        assert found.lower <= value * 1.0003 and value * 0.9997 <= found.upper
        assert found.upper - found.lower <= 0.02 * found.lower


@pytest.mark.parametrize(
    ("parameters", "elbows"), [(R1, "+++"), (R2, "+++"), (R3, "+++"), (R4, "+++"), (R5, "++-")]
)
def test_reference_designs_with_a_margin(parameters: dict[str, Any], elbows: str) -> None:
    uru, mode = machine(parameters, elbows=elbows)
    found = tpm.certified_volume(uru, mode, margin=0.02, rtol=0.04)
    grid = counted(uru, mode, "singularity_free", 0.02, 96)
    assert found.lower * 0.998 <= grid <= found.upper * 1.002
    assert found.upper - found.lower <= 0.04 * found.lower


@pytest.mark.parametrize("seed", range(10))
def test_random_designs(seed: int) -> None:
    """Unequal limbs half of the time, any octant, elbows, joint limits half of the time."""
    random = np.random.default_rng(seed)
    limits: dict[str, Any] = {"theta3": (-2.8, 0.4), "theta1": (-3.0, 2.5)} if seed % 2 else {}
    uru = build(random_parameters(random), limits)
    mode = uru.mode(octant=random_signs(random), elbows=random_signs(random))
    for kind, margin in (("reachable", 0.0), ("singularity_free", 0.05)):
        found = tpm.certified_volume(uru, mode, kind, margin, 0.03, boxes=60_000)  # type: ignore[arg-type]
        grid = counted(uru, mode, kind, margin, 64)  # type: ignore[arg-type]
        slack = 0.01 * grid + 1e-4 * uru.reach_radius() ** 3
        assert found.lower - slack <= grid <= found.upper + slack


def test_any_octant() -> None:
    """Reachable volumes add up; the largest aspect lies in one octant."""
    uru, anywhere = machine(R4, "any")
    alone = [machine(R4, a + b + c)[1] for a in "+-" for b in "+-" for c in "+-"]
    parts = [tpm.certified_volume(uru, mode, "reachable", rtol=0.05) for mode in alone]
    every = tpm.certified_volume(uru, anywhere, "reachable", rtol=0.05)
    assert every.lower <= sum(part.upper for part in parts)
    assert sum(part.lower for part in parts) <= every.upper
    parts = [tpm.certified_volume(uru, mode, margin=0.2, rtol=0.1) for mode in alone]
    largest = tpm.certified_volume(uru, anywhere, margin=0.2, rtol=0.1)
    assert largest.lower <= max(part.upper for part in parts)
    assert max(part.lower for part in parts) <= largest.upper


def test_parts_that_do_not_touch_do_not_add_up() -> None:
    """A design whose sides of largest volume fall into two parts, the second a fifth of the first."""
    random = np.random.default_rng(50)
    uru = build(random_parameters(random), {})
    mode = uru.mode(octant=random_signs(random), elbows=random_signs(random))
    found = tpm.certified_volume(uru, mode, margin=0.2, rtol=0.03)
    grid = counted(uru, mode, "singularity_free", 0.2, 72)
    assert found.lower * 0.98 <= grid <= found.upper * 1.02
    assert found.upper <= 1.03 * found.lower


def test_bounds_close_and_nest() -> None:
    """Finer bounds lie within coarser ones: every halving only moves them inward."""
    found = [tpm.certified_volume(*machine(R4), rtol=rtol) for rtol in (0.2, 0.05, 0.01)]
    for coarse, fine in itertools.pairwise(found):
        assert coarse.lower <= fine.lower < fine.upper <= coarse.upper
    assert found[-1].upper - found[-1].lower <= 0.01 * found[-1].lower


@pytest.mark.parametrize("kind", ["reachable", "singularity_free"])
def test_any_number_of_threads(kind: VolumeKind) -> None:
    one, two = (
        tpm.certified_volume(*machine(R5, elbows="++-"), kind, rtol=0.05, threads=threads)
        for threads in (1, 2)
    )
    assert replace(one, seconds=0.0) == replace(two, seconds=0.0)


def test_limits_end_with_bounds_that_hold() -> None:
    exact = 4 * math.pi / 3
    few = tpm.certified_volume(*machine(R1), "reachable", rtol=1e-6, boxes=2_000)
    assert few.boxes <= 2_000
    assert 0.0 < few.lower <= exact <= few.upper
    short = tpm.certified_volume(*machine(R1), "reachable", rtol=1e-6, seconds=0.05)
    assert 0.0 < short.lower <= exact <= short.upper
    none = tpm.certified_volume(*machine(R1), margin=0.0, rtol=1e-6, boxes=1)
    assert none.lower == 0.0
    assert none.upper >= exact


def test_nothing_reachable() -> None:
    uru, mode = machine(R1 | {"f": (1.0, 0.1, 0.1), "r": (0.2, 0.1, 0.1)})
    for kind in ("reachable", "singularity_free"):
        found = tpm.certified_volume(uru, mode, kind, boxes=200_000)
        assert found.lower == 0.0
        assert found.upper <= 1e-6


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"kind": "reachabel"}, "Did you mean 'reachable'"),
        ({"margin": 1.0}, "margin"),
        ({"margin": -0.1}, "margin"),
        ({"rtol": 0.0}, "rtol"),
        ({"boxes": 0}, "boxes"),
        ({"seconds": 0.0}, "seconds"),
        ({"threads": 0}, "threads"),
    ],
)
def test_bad_requests(arguments: dict[str, Any], told: str) -> None:
    with pytest.raises(ParameterError, match=told):
        tpm.certified_volume(*machine(R1), **arguments)
