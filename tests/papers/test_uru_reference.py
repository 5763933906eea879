"""LaMaViP 3-URU: values at three poses from an independent program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numba import njit

from tpm_design.mechanisms import equations, mechanism
from tpm_design.mechanisms.uru import Uru, joint_angles

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Case:
    """Angles in degrees. ``first``: θ_i1, ``second``: θ_i2. Determinants raw, ``share``: det W / ∏|w_i|."""

    parameters: dict[str, Any]
    pose: Triple
    octant: str
    elbows: str
    first: Triple
    second: Triple
    det_h: float
    det_v: float
    det_w: float
    share: float
    condition_motor: float
    frobenius_motor: float
    condition_joint: float


PLAIN = {"db": 0.3, "dp": 0.1, "f": 0.6, "r": 0.5, "k": 1.0}
FIRST = (123.690068, -128.659808, 140.194429)
CASES = (
    Case(
        PLAIN, (0.5, 0.6, 0.4), "+++", "+++", FIRST, (107.217032, 99.36755, 113.864815),
        0.665507147, 0.765057255, 2.187473728, 0.974852610, 0.794396431, 0.980000023, 0.499117687,
    ),
    Case(
        PLAIN, (0.5, 0.6, 0.4), "+++", "-++", FIRST, (27.60589, 99.36755, 113.864815),
        0.665507147, -0.566740764, -1.103800385, -0.491911136, 0.263013281, 0.577816798, 0.341259069,
    ),
    Case(
        {"db": 0.2, "dp": 0.25, "f": (0.5, 0.55, 0.6), "r": (0.6, 0.5, 0.45), "k": (1.0, -2.0, 0.5)},
        (-0.35, 0.45, 0.55), "-++", "+-+",
        (140.710593, 147.528808, -142.125016), (163.928934, 16.121978, 75.509642),
        -0.655981224, 0.327008237, 2.015824920, 0.762223445, 0.381731230, 0.721487880, 0.177271731,
    ),
)  # fmt: skip
THIRD = ((-90.0, -93.822554, -86.177446), (90.0, -93.822554, -86.177446), (-91.432544, 77.13073, -76.888202))
ANGLE, NUMBER = 1e-6, 2e-9  # as many digits as the table has, and a little


@njit
def velocity_at(geometry, signs, motor, x, y, z):  # type: ignore[no-untyped-def]
    return equations.velocity_map(geometry, signs, motor, x, y, z)


@njit
def angles_at(geometry, signs, x, y, z):  # type: ignore[no-untyped-def]
    return joint_angles(geometry, signs, x, y, z)


def machine_of(case: Case) -> Uru:
    return mechanism("uru", **case.parameters)  # type: ignore[return-value]


def inverse_condition(matrix: np.ndarray) -> float:
    return float(1.0 / np.linalg.cond(matrix))


@pytest.mark.parametrize("case", CASES)
def test_actuators(case: Case) -> None:
    machine = machine_of(case)
    mode = machine.mode(octant=case.octant, elbows=case.elbows)
    joints = np.rad2deg(machine.ik([case.pose], mode, drive="joint")[0])
    assert joints == pytest.approx(case.second, abs=ANGLE)
    shafts = np.rad2deg(machine.ik([case.pose], mode)[0])
    gears = machine.geometry.gear
    expected = [second / k + first for second, k, first in zip(case.second, gears, case.first, strict=True)]
    assert shafts == pytest.approx(expected, abs=4 * ANGLE)


@pytest.mark.parametrize(("case", "third"), list(zip(CASES, THIRD, strict=True)))
def test_joint_angles(case: Case, third: Triple) -> None:
    machine = machine_of(case)
    mode = machine.mode(octant=case.octant, elbows=case.elbows)
    angles = np.rad2deg(angles_at(machine.geometry, mode.signs, *case.pose))
    assert angles[:, 0] == pytest.approx(case.first, abs=ANGLE)
    assert angles[:, 1] == pytest.approx(case.second, abs=ANGLE)
    assert angles[:, 2] == pytest.approx(third, abs=ANGLE)


@pytest.mark.parametrize("case", CASES)
def test_determinants(case: Case) -> None:
    machine = machine_of(case)
    mode = machine.mode(octant=case.octant, elbows=case.elbows)
    margins = machine.margins([case.pose], mode)
    assert margins["rotation"][0] == pytest.approx(case.det_h, abs=NUMBER)
    assert margins["translation"][0] == pytest.approx(case.det_v, abs=NUMBER)
    assert margins["actuation"][0] == pytest.approx(case.share, abs=NUMBER)
    for motor, expected in ((0.0, case.det_v), (1.0, case.det_w)):
        rows, _ = velocity_at(machine.geometry, mode.signs, motor, *case.pose)
        assert np.linalg.det(np.array(rows)) == pytest.approx(expected, abs=NUMBER)


@pytest.mark.parametrize("case", CASES)
def test_conditioning(case: Case) -> None:
    machine = machine_of(case)
    mode = machine.mode(octant=case.octant, elbows=case.elbows)
    motor = machine.jacobian([case.pose], mode)[0]
    joint = machine.jacobian([case.pose], mode, drive="joint")[0]
    assert inverse_condition(motor) == pytest.approx(case.condition_motor, abs=NUMBER)
    assert inverse_condition(joint) == pytest.approx(case.condition_joint, abs=NUMBER)
    frobenius = 3.0 / (np.linalg.norm(motor) * np.linalg.norm(np.linalg.inv(motor)))
    assert frobenius == pytest.approx(case.frobenius_motor, abs=NUMBER)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("drive", ["motor", "joint"])
def test_the_pose_is_among_the_assemblies(case: Case, drive: str) -> None:
    machine = machine_of(case)
    mode = machine.mode(octant=case.octant, elbows=case.elbows)
    q = machine.ik([case.pose], mode, drive=drive)[0]
    found = machine.fk(q, mode, drive=drive)
    assert np.min(np.abs(found - case.pose).max(axis=1)) < 1e-12
