"""Every mechanism against a multibody model of it: the model closes at the poses and actuator coordinates of
the inverse map, and its constraint Jacobian leaves the motions ẋ = J q̇ and no other."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest

pytest.importorskip("mujoco")

from assembled import Assembled, Motions
from builders import BUILDERS
from compared import CROSSED, DESIGNS, POSES, crossing, placement, poses_of, twists
from mjcf import FloatArray

from tpm_design.mechanisms import MECHANISMS, mechanism


@dataclass(frozen=True)
class Comparison:
    """One pose: how far the model is from closing there (m, rad) and its actuators from the inverse map's
    coordinates, the motions it allows, and the platform's twist (6, 3) for each actuator at unit speed."""

    residual: float
    actuator_error: float
    motions: Motions
    expected: FloatArray


CASES = [
    pytest.param(
        number, drive, id=f"{design.kind}-{number}-{drive}", marks=pytest.mark.xdist_group(design.kind)
    )
    for number, design in enumerate(DESIGNS)
    if design.kind in MECHANISMS
    for drive in MECHANISMS[design.kind].drives
]


@functools.cache
def comparisons(number: int, drive: str) -> tuple[Comparison, ...]:
    """All modes of one design, several poses each."""
    design = DESIGNS[number]
    machine = mechanism(design.kind, **design.parameters)
    model = Assembled(BUILDERS[design.kind](machine.parameters))
    random = np.random.default_rng(7)
    found = []
    for signs in design.modes:
        mode = machine.mode_of(signs)
        poses = poses_of(machine, mode, random)
        assert len(poses) == POSES
        jacobians = machine.jacobian(poses, mode, drive=drive)
        for pose, actuators, jacobian in zip(
            poses, machine.ik(poses, mode, drive=drive), jacobians, strict=True
        ):
            model.place(*placement(machine, pose))
            model.close(drive, actuators, machine.joint_centres(pose, mode), random)
            error = float(np.abs(model.actuators(drive) - actuators).max())
            expected = twists(machine, pose) @ jacobian
            found.append(Comparison(model.residual(), error, model.motions(drive), expected))
    return tuple(found)


def test_every_mechanism_has_a_model_and_designs() -> None:
    assert set(MECHANISMS) <= set(BUILDERS)
    assert set(MECHANISMS) <= {design.kind for design in DESIGNS}


@pytest.mark.parametrize(("number", "drive"), CASES)
def test_the_model_closes_where_the_inverse_map_says(number: int, drive: str) -> None:
    for comparison in comparisons(number, drive):
        assert comparison.residual < 1e-9
        assert comparison.actuator_error < 1e-9


@pytest.mark.parametrize(("number", "drive"), CASES)
def test_the_constraints_leave_the_motions_of_the_jacobian(number: int, drive: str) -> None:
    for comparison in comparisons(number, drive):
        motions = comparison.motions
        # the actuators move freely, one by one
        assert np.linalg.matrix_rank(motions.actuators, tol=1e-6) == 3
        scale = np.abs(comparison.expected).max()
        # every motion, those with the actuators at rest and those of rods about themselves too
        assert np.abs(motions.platform - comparison.expected @ motions.actuators).max() < 1e-6 * scale
        # the platform of a translational mechanism does not turn: expected[3:] is 0 there
        unit_speeds = motions.platform @ np.linalg.pinv(motions.actuators)
        assert np.abs(unit_speeds - comparison.expected).max() < 1e-6 * scale


@pytest.mark.parametrize(
    ("kind", "determinant", "locked"),
    [pytest.param(*crossed, id="-".join(crossed[:2])) for crossed in CROSSED if crossed[0] in MECHANISMS],
)
def test_a_motion_more_where_a_determinant_vanishes(kind: str, determinant: str, locked: str | None) -> None:
    random = np.random.default_rng(8)
    compared = 0
    for design in DESIGNS:
        for signs in design.modes if design.kind == kind else ():
            machine = mechanism(kind, **design.parameters)
            mode = machine.mode_of(signs)
            found = crossing(machine, mode, determinant, random)
            if found is None:
                continue
            model = Assembled(BUILDERS[kind](machine.parameters))
            drive = locked or machine.kind.drives[0]
            stiffness = []
            for pose in found:
                model.place(*placement(machine, pose))
                actuators = machine.ik(pose, mode, drive=drive)[0]
                model.close(drive, actuators, machine.joint_centres(pose, mode), random)
                stiffness.append(model.stiffness(locked))
            regular, singular = stiffness
            rank = int((regular > 1e-8 * regular[0]).sum())
            assert singular[rank - 1] < 1e-6 * regular[rank - 1]
            assert singular[rank - 2] > 1e-3 * regular[rank - 2]
            compared += 1
    assert compared > 0
