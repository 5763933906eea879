"""The committed baselines: their numbers are known by other means, and the program still gives them."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tpm_design.baselines.deviations import Tolerance, compare_tables
from tpm_design.baselines.folders import check_same_question, read_result
from tpm_design.baselines.reproduction import reproduce
from tpm_design.baselines.tables import read_table
from tpm_design.runs.executors import Threads
from tpm_design.runs.folder import DESIGNS, TABLE
from tpm_design.runs.sweeps import WHOLE
from tpm_design.study import load_study
from tpm_design.study.plain import dump_yaml
from tpm_design.study.sweeping import sweep_study

ROOT = Path(__file__).parents[2]
BASELINES = ROOT / "results" / "baselines"
ORTHOGLIDE, SWEEP = BASELINES / "orthoglide-velocity", BASELINES / "orthoglide-sweep"
SEARCHES = sorted(path for path in BASELINES.iterdir() if not read_result(path).is_sweep)

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


def closed_forms_on_the_diagonal(strut: float, first: float, last: float) -> dict[str, float]:
    """Numbers of a cube between two corners (t, t, t), in mm.

    Carriages move by (1 − u) v + u (v · 1) 1 where the tool moves by v, u = −t / √(L² − 2 t²): by 1 − u
    times as much across the diagonal and 1 + 2 u times along it.
    """
    factors, spreads = [], []
    for t in (first, last):
        u = -t / math.sqrt(strut**2 - 2.0 * t**2)
        at_corner = [1.0 / (1.0 - u), 1.0 / (1.0 + 2.0 * u)]
        factors += at_corner
        spreads.append(min(at_corner) / max(at_corner))
    return {
        "L [mm]": strut,
        "total_link_length [mm]": 3.0 * strut,
        "coverage [-]": 1.0,
        "velocity_min [-]": min(factors),
        "velocity_max [-]": max(factors),
        "conditioning_min [-]": min(spreads),
        "actuator_range [mm]": last + strut - first - math.sqrt(strut**2 - 2.0 * first**2),
        "violation [-]": max(0.0, max(factors) - 2.0) + max(0.0, 0.5 - min(factors)),
    }


def test_every_number_of_the_sweep_is_the_closed_form() -> None:
    table = read_table(SWEEP / TABLE)
    assert len(table.rows) == 7
    for number, row in enumerate(table.rows.values()):
        expected = closed_forms_on_the_diagonal(310.0 + 15.0 * number, -125.0, 75.0)
        expected |= {f"center_{axis} [mm]": -25.0 for axis in "xyz"}
        assert set(expected) == {head for head in table.headings if "[" in head and "seconds" not in head}
        for heading, value in expected.items():
            assert float(row[heading]) == pytest.approx(value, rel=1e-8, abs=1e-12), heading
        assert row["status"] == ("infeasible" if expected["violation [-]"] > 0.0 else "feasible")


def test_the_present_program_gives_every_row_of_the_sweep(tmp_path: Path) -> None:
    run = sweep_study(load_study(SWEEP / "study.yaml"), shard=WHOLE, executor=Threads(1), output=tmp_path)
    assert run.folder is not None
    before, now = (read_table(folder / TABLE) for folder in (SWEEP, run.folder))
    assert compare_tables(before, now, Tolerance(1e-9, 1e-12).allowed).exceedances == ()


@pytest.mark.parametrize("folder", [ORTHOGLIDE, SWEEP], ids=lambda path: path.name)
def test_the_baseline_asks_what_the_study_asks(folder: Path, tmp_path: Path) -> None:
    baseline = read_result(folder)
    study = load_study(ROOT / "studies" / "04-orthoglide-velocity.yaml")
    for name in ("run.json", TABLE if baseline.is_sweep else DESIGNS):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    (tmp_path / "study.yaml").write_text(dump_yaml(study.resolved()), encoding="utf-8")
    check_same_question(baseline, read_result(tmp_path))


@pytest.mark.parametrize("folder", SEARCHES, ids=lambda path: path.name)
def test_the_present_program_gives_the_designs_of_every_search(folder: Path) -> None:
    found = reproduce(folder, allow_code=False)
    assert found.exceedances == ()
    assert found.rows >= 1
