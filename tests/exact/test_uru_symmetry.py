"""Symmetries of the 3-URU: scale, signed permutations of the axes, equal working modes."""

from __future__ import annotations

import numpy as np
import pytest
from uru_vectors import good_poses, numbers, random_machine, random_signs

from tpm_design.mechanisms import mechanism
from tpm_design.mechanisms.symmetry import (
    SIGNED_PERMUTATIONS,
    SignedPermutation,
    inequivalent_modes,
    mode_orbits,
    symmetries,
)
from tpm_design.mechanisms.uru import KIND, Uru
from tpm_design.workspace.volume import workspace_volume

ALIKE = {"db": 0.1, "dp": 0.06, "f": 0.25, "r": 0.3, "k": 1.0}
RANGES = {"db": (0.0, 0.4), "dp": (0.06, 0.06), "f": (0.1, 0.6), "r": (0.1, 0.6), "k": (0.5, 2.0)}


def signs_of(values: tuple[float, ...]) -> str:
    return "".join("+" if value > 0.0 else "-" for value in values)


def moved_machine(machine: Uru, move: SignedPermutation, keep_gears: bool = False) -> Uru:
    """The machine carried by a signed permutation, with d_b raised so that no distance is negative."""
    g = machine.geometry
    offsets = np.array(move.moved(np.subtract(g.platform, g.base).tolist()))
    turn = 1.0 if keep_gears else move.determinant
    return mechanism(  # type: ignore[return-value]
        "uru",
        db=1.0,
        dp=tuple((1.0 + offsets).tolist()),
        f=move.moved(g.proximal, signed=False),
        r=move.moved(g.distal, signed=False),
        k=tuple(turn * gear for gear in move.moved(g.gear, signed=False)),
    )


@pytest.mark.parametrize("factor", [0.01, 3.7])
def test_scale(factor: float) -> None:
    """Lengths times λ: volumes times λ³; determinant margins and conditioning unchanged."""
    random = np.random.default_rng(1)
    machine = random_machine(random)
    scaled = {
        name: tuple(value * (factor if name != "k" else 1.0) for value in values)
        for name, values in machine.parameters.items()
    }
    larger = mechanism("uru", **scaled)
    assert isinstance(larger, Uru)
    mode = machine.mode(octant="+-+", elbows="++-")
    poses = good_poses(machine, "+-+", 50, random)
    before, after = machine.margins(poses, mode), larger.margins(factor * poses, mode)
    for name in ("serial", *KIND.determinants):
        np.testing.assert_allclose(after[name], before[name], atol=1e-11)
    np.testing.assert_allclose(after["reach"], factor * before["reach"], atol=1e-12 * factor)
    for drive in KIND.drives:
        np.testing.assert_allclose(
            np.linalg.cond(larger.jacobian(factor * poses, mode, drive=drive)),
            np.linalg.cond(machine.jacobian(poses, mode, drive=drive)),
            rtol=1e-8,
        )
    volumes = [workspace_volume(m, mode, rtol=1e-2).value for m in (machine, larger)]
    assert volumes[1] == pytest.approx(factor**3 * volumes[0], rel=1e-6)


@pytest.mark.parametrize("move", SIGNED_PERMUTATIONS, ids=lambda move: f"{move.permutation}{move.signs}")
def test_signed_permutations(move: SignedPermutation) -> None:
    """A random machine carried to other axes, its gear ratios with det R: nothing else changes."""
    random = np.random.default_rng(2)
    machine = random_machine(random)
    carried = moved_machine(machine, move)
    octant, elbows = random_signs(random), random_signs(random)
    mode = machine.mode(octant=octant, elbows=elbows)
    there = carried.mode(
        octant=signs_of(move.moved(numbers(octant))), elbows=signs_of(move.moved(numbers(elbows)))
    )
    poses = good_poses(machine, octant, 40, random)
    images = np.array([move.moved(pose.tolist()) for pose in poses])
    before, after = machine.margins(poses, mode), carried.margins(images, there)
    for name in ("reach", "serial"):
        np.testing.assert_allclose(after[name], before[name], atol=1e-11)
    for name in KIND.determinants:
        np.testing.assert_allclose(np.abs(after[name]), np.abs(before[name]), atol=1e-11)
    for drive in KIND.drives:
        np.testing.assert_allclose(
            1.0 / np.linalg.cond(carried.jacobian(images, there, drive=drive)),
            1.0 / np.linalg.cond(machine.jacobian(poses, mode, drive=drive)),
            atol=1e-9,
        )
    assert len(poses) == 40


def test_inversion_needs_the_gears_reversed() -> None:
    """(δ, p, s, k) → −(δ, p, s, k): V → −V, det W → −det W; with k kept |det W| differs."""
    random = np.random.default_rng(3)
    machine = random_machine(random)
    inversion = SignedPermutation((0, 1, 2), (-1.0, -1.0, -1.0))
    mode = machine.mode(octant="++-", elbows="+--")
    there = machine.mode(octant="--+", elbows="-++")
    poses = good_poses(machine, "++-", 40, random)
    before = machine.margins(poses, mode)
    after = moved_machine(machine, inversion).margins(-poses, there)
    for name in ("translation", "actuation"):
        np.testing.assert_allclose(after[name], -before[name], atol=1e-11)
    kept = moved_machine(machine, inversion, keep_gears=True).margins(-poses, there)
    assert np.abs(np.abs(kept["actuation"]) - np.abs(before["actuation"])).max() > 1e-2


def test_which_machines_are_symmetric() -> None:
    def count(**change: object) -> int:
        return len(symmetries(mechanism("uru", **(ALIKE | change)).geometry))  # type: ignore[arg-type]

    assert count() == 3  # the cyclic permutations
    assert count(db=0.06) == 24  # δ = 0: every rotation of the cube
    assert count(f=(0.25, 0.25, 0.3)) == 1
    assert count(r=(0.25, 0.3, 0.3)) == 1
    assert count(db=0.06, k=(1.0, 1.0, -1.0)) == 8
    limited = KIND.build({"db": 0.06, "dp": 0.06, "f": 0.25, "r": 0.3, "k": 1.0}, {"theta2": (0.0, 2.0)})
    assert len(symmetries(limited.geometry)) == 3
    limited = KIND.build({"db": 0.06, "dp": 0.06, "f": 0.25, "r": 0.3, "k": 1.0}, {"theta1": (0.0, 2.0)})
    assert len(symmetries(limited.geometry)) == 1


@pytest.mark.parametrize("change", [{}, {"db": 0.06}, {"db": 0.06, "k": (1.0, 1.0, -1.0)}])
def test_modes_of_an_orbit_are_equal(change: dict[str, float]) -> None:
    machine = mechanism("uru", **(ALIKE | change))
    orbits = mode_orbits(symmetries(machine.geometry))
    assert sum(len(orbit) for orbit in orbits) == 64
    largest = max(orbits, key=len)
    for kind in ("reachable", "singularity_free"):
        volumes = [
            workspace_volume(machine, machine.mode_of(signs), kind, rtol=1e-2).value for signs in largest[:6]
        ]
        np.testing.assert_allclose(volumes, volumes[0], rtol=1e-6)


def test_inequivalent_modes() -> None:
    machine = mechanism("uru", **ALIKE)
    modes = inequivalent_modes(machine)
    # 64 modes, of which the cyclic permutations fix 4: (64 + 2 · 4)/3
    assert len(modes) == 24
    assert modes[0].label == "+++ +++"
    assert len({mode.label for mode in modes}) == 24
    assert inequivalent_modes(machine) == modes


def test_mode_candidates_of_a_study() -> None:
    assert KIND.mode_candidates is not None
    assert len(KIND.mode_candidates(RANGES, True)) == 24
    assert len(KIND.mode_candidates(RANGES, False)) == 64
    apart = {name: span for name, span in RANGES.items() if name != "f"}
    apart |= {"f1": (0.1, 0.6), "f2": (0.1, 0.6), "f3": (0.1, 0.6)}
    assert len(KIND.mode_candidates(apart, True)) == 64
    # equal by chance at one end of the ranges is not equal for every design
    assert len(KIND.mode_candidates(RANGES | {"db": (0.06, 0.06)}, True)) < 24
    for signs in KIND.mode_candidates(RANGES, True):
        assert mechanism("uru", **ALIKE).mode_of(signs).label == f"{signs['octant']} {signs['elbows']}"
