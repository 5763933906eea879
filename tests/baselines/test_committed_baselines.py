"""The committed baselines: their numbers are known by other means, and the program still gives them."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tpm_design.baselines.folders import check_same_question, read_result
from tpm_design.baselines.reproduction import reproduce
from tpm_design.baselines.tables import read_table
from tpm_design.runs.folder import DESIGNS
from tpm_design.study import load_study
from tpm_design.study.plain import dump_yaml

ROOT = Path(__file__).parents[2]
BASELINES = ROOT / "results" / "baselines"
ORTHOGLIDE = BASELINES / "orthoglide-velocity"

EDGE = 200.0
# corners of the largest cube on the diagonal, where the factors 1/2 and 2 are attained, for a strut of 1
FIRST, LAST = -1.0 / math.sqrt(6.0), 1.0 / (3.0 * math.sqrt(2.0))
STRUT = EDGE / (LAST - FIRST)


def closed_forms() -> dict[str, float]:
    """Every number of the best design, in mm."""
    centre = 0.5 * (FIRST + LAST) * STRUT
    # a carriage is at p + √(L² − q² − r²): furthest out on the last face at q = r = 0, nearest at the first
    # corner
    travel = (LAST + 1.0 - FIRST - math.sqrt(1.0 - 2.0 * FIRST**2)) * STRUT
    return {
        "L [mm]": STRUT,
        **{f"center_{axis} [mm]": centre for axis in "xyz"},
        "total_link_length [mm]": 3.0 * STRUT,
        "coverage [-]": 1.0,
        "velocity_min [-]": 0.5,
        "velocity_max [-]": 2.0,
        # factors 1/2, 2, 2 at the first corner
        "conditioning_min [-]": 0.25,
        "actuator_range [mm]": travel,
        "violation [-]": 0.0,
    }


def test_every_number_of_the_orthoglide_is_the_closed_form() -> None:
    assert pytest.approx(0.6439506, abs=5e-8) == EDGE / STRUT
    table = read_table(ORTHOGLIDE / DESIGNS)
    (row,) = table.rows.values()
    expected = closed_forms()
    metrics = {heading for heading in table.headings if "[" in heading and " error [" not in heading}
    assert set(expected) == metrics
    for heading, value in expected.items():
        assert float(row[heading]) == pytest.approx(value, rel=3e-5), heading


def test_the_baseline_asks_what_the_study_asks(tmp_path: Path) -> None:
    baseline = read_result(ORTHOGLIDE)
    study = load_study(ROOT / "studies" / "04-orthoglide-velocity.yaml")
    for name in ("run.json", DESIGNS):
        (tmp_path / name).write_bytes((ORTHOGLIDE / name).read_bytes())
    (tmp_path / "study.yaml").write_text(dump_yaml(study.resolved()), encoding="utf-8")
    check_same_question(baseline, read_result(tmp_path))


@pytest.mark.parametrize("folder", sorted(BASELINES.iterdir()), ids=lambda path: path.name)
def test_the_present_program_gives_the_designs_of_every_baseline(folder: Path) -> None:
    found = reproduce(folder, allow_code=False)
    assert found.exceedances == ()
    assert found.rows >= 1
