"""The Orthoglide against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import tpm_design as tpm
from tpm_design.certificates.verdict import verdict
from tpm_design.mechanisms import MECHANISMS
from tpm_design.metrics import METRICS
from tpm_design.problem import Goal, Problem
from tpm_design.workspace.regions import Box

STRUT = 1.0
# largest cube with all velocity factors in [1/2, 2]: corners on the diagonal
FIRST, LAST = -STRUT / math.sqrt(6.0), STRUT / (3.0 * math.sqrt(2.0))


def machine() -> tpm.Mechanism:
    return tpm.mechanism("orthoglide", L=STRUT)


@pytest.mark.parametrize("t", np.linspace(-0.5, 0.5, 11))
def test_eigenvalues_on_the_diagonal(t: float) -> None:
    mode = machine().mode_of({"carriages": "+++"})
    inverse = np.linalg.inv(machine().jacobian([[t, t, t]], mode)[0])
    a = -t / math.sqrt(STRUT**2 - 2.0 * t * t)
    expected = sorted((1.0 + 2.0 * a, 1.0 - a, 1.0 - a))
    assert np.allclose(sorted(np.linalg.eigvals(inverse).real), expected, atol=1e-9)


def test_reachable_volume_is_that_of_three_crossing_cylinders() -> None:
    mode = machine().mode_of({"carriages": "+++"})
    exact = 8.0 * (2.0 - math.sqrt(2.0)) * STRUT**3
    assert tpm.workspace_volume(machine(), mode, kind="reachable").value == pytest.approx(exact, rel=1e-3)
    bounds = tpm.certified_volume(machine(), mode, kind="reachable")
    assert bounds.lower <= exact <= bounds.upper <= 1.0100001 * bounds.lower


def cube(edge: float) -> tuple[Problem, dict[str, float | str]]:
    """The problem of velocity factors in [1/2, 2] over a cube about the middle of the largest one."""
    goals = (
        Goal(METRICS["coverage"], "coverage", minimum=1.0),
        Goal(METRICS["velocity_min"], "slowest", {"drive": "motor"}, minimum=0.5),
        Goal(METRICS["velocity_max"], "fastest", {"drive": "motor"}, maximum=2.0),
    )
    kind = MECHANISMS["orthoglide"]
    modes = {"+++": {"carriages": "+++"}}
    middle = 0.5 * (FIRST + LAST)
    design: dict[str, float | str] = {"L": STRUT, "mode": "+++"}
    design |= dict.fromkeys(("center_x", "center_y", "center_z"), middle)
    return Problem(kind, {}, (), modes, {}, Box((edge, edge, edge)), (), goals, ()), design


@pytest.mark.parametrize(("share", "outcome"), [(0.999, "proved"), (1.001, "refuted")])
def test_the_largest_cube_is_proved_just_below_and_refuted_just_above(share: float, outcome: str) -> None:
    assert pytest.approx(0.6439506, abs=5e-8) == (LAST - FIRST) / STRUT
    problem, design = cube(share * (LAST - FIRST))
    assert verdict(problem, design, {}, boxes=20_000).outcome == outcome
