"""`optimize` on problems whose answers are known in closed form."""

from __future__ import annotations

from pathlib import Path

import pytest

import tpm_design as tpm

STUDIES = Path(__file__).parents[1] / "studies"


def test_the_smallest_orthoglide_for_a_cube() -> None:
    run = tpm.load_study(STUDIES / "04-orthoglide-velocity.yaml").optimize()
    assert run.best is not None
    assert run.best.status == "feasible"
    assert 0.2 / float(run.best.design["L"]) == pytest.approx(0.6439506, abs=1e-4)
