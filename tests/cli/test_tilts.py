"""Studies of a platform that tilts, from outside: poses in their own units, regions, refusals, proofs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import tpm_design, written

STUDY = """\
version: 1
name: tilting
units: {length: mm, angle: deg}
mechanism:
  type: puu
  parameters: {R: 120, r: 50, theta: 45, L: {min: 50, max: 75, initial: 62}, o: 8.2843}
  mode: {carriages: "+++"}
  limits: {stroke: {min: 20, max: 130}}
region: {type: tilt, tilt: 40, height: 10, center: {d: 94}}
objectives:
  - {metric: all_round_tilt, distance: 94, sense: maximize}
constraints:
  - {metric: coverage, min: 1}
optimizer: {method: scipy.differential_evolution, budget: 20, seed: 1}
record:
  - {metric: actuator_range}
"""

pytestmark = pytest.mark.xdist_group("puu")


def test_a_pose_is_given_and_shown_in_its_own_units(tmp_path: Path) -> None:
    study = written(tmp_path, STUDY)
    found = tpm_design("evaluate", study, "--at", "90,54,94", "--json")
    assert found.code == 0
    data = json.loads(found.output)
    assert data["pose"] == {"value": [90.0, 54.0, 94.0], "unit": ["deg", "deg", "mm"]}
    assert data["jacobian"]["motor"]["unit"] == ["deg/mm", "deg/mm", "-"]
    assert data["actuators"]["motor"]["value"] == pytest.approx([90.1052, 34.1818, 90.1052], abs=1e-4)
    text = tpm_design("evaluate", study, "--at", "90,54,94").output
    assert "(alpha, beta, d) = (90 deg, 54 deg, 94 mm)" in text
    assert "Jacobian of the motors, d [-]" in text
    wrong = tpm_design("evaluate", study, "--at", "90,54")
    assert wrong.code == 2
    assert "--at alpha,beta,d in deg, deg, mm" in wrong.errors


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("{type: tilt, tilt: 40, height: 10, center: {d: 94}}", "{type: sphere, radius: 5, center: free}",
         "do not fill a sphere region"),
        ("tilt: 40", "tilt: 200", "half a turn"),
        ("{metric: coverage, min: 1}", "{metric: conditioning_min, min: 0.1}", "characteristic_length"),
        ("{metric: coverage, min: 1}", "{metric: conditioning_mean, min: 0.1}", "no volume"),
        ("{metric: coverage, min: 1}", "{metric: position_sensitivity, max: 2}", "not positions"),
        ("distance: 94, ", "", "needs the option distance"),
        ("distance: 94", "distance: -94", "greater than 0"),
        ("optimizer:", "certify: {tolerance: {L: 0.1}}\noptimizer:", "limbs are alike"),
    ],
)  # fmt: skip
def test_what_means_nothing_is_refused_with_its_reason(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    assert old in STUDY
    refused = tpm_design("validate", written(tmp_path, STUDY.replace(old, new)))
    assert refused.code == 2
    assert words in refused.errors.replace("\n", " ")


def test_positions_fill_no_region_of_tilts(tmp_path: Path) -> None:
    study = """\
version: 1
name: position
units: {length: mm, angle: deg}
mechanism: {type: orthoglide, parameters: {L: 310}, mode: {carriages: "+++"}}
region: {type: tilt, tilt: 40, height: 10, center: {d: 94}}
objectives: [{metric: total_link_length, sense: minimize}]
"""
    refused = tpm_design("validate", written(tmp_path, study))
    assert refused.code == 2
    assert "do not fill a tilt region" in refused.errors


def test_a_condition_number_with_a_characteristic_length(tmp_path: Path) -> None:
    text = STUDY.replace("20, max: 130}}", "20, max: 130}, characteristic_length: 50}").replace(
        "{metric: actuator_range}", "{metric: conditioning_min}"
    )
    found = tpm_design("evaluate", written(tmp_path, text), "--json")
    value = json.loads(found.output)["metrics"]["conditioning_min"]["value"]
    assert 0.0 < value < 1.0


def test_the_remarks_are_shown() -> None:
    shown = tpm_design("show", "puu").output
    assert "alpha (angle), beta (angle), d (length)" in shown
    assert "The paper gives no L and no convention for the U-joint angle" in shown
    assert "67.38°" in shown


def test_a_new_study_is_valid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert tpm_design("init", "fresh", "--mechanism", "puu").code == 0
    assert tpm_design("validate", "fresh.yaml").code == 0


def test_every_tilt_of_a_region_is_proved_or_a_pose_is_named(tmp_path: Path) -> None:
    study = written(tmp_path, STUDY)
    proved = tpm_design("certify", study, "--output", tmp_path / "certificate.json")
    assert proved.code == 0, proved.output
    assert "Proved at every pose of the region, for the exact dimensions" in proved.output
    wide = written(tmp_path, STUDY.replace("tilt: 40", "tilt: 60"), "wide.yaml")
    broken = tpm_design("certify", wide, "--output", tmp_path / "broken.json", "--json")
    assert broken.code != 0
    requirement = json.loads(broken.output)["requirements"]["coverage"]
    assert requirement["outcome"] == "refuted"
    assert requirement["pose_unit"] == "deg, deg, mm"
    alpha, beta, d = requirement["pose"]
    assert -180.0 <= alpha <= 180.0
    assert 0.0 <= beta <= 60.0 + 1e-9
    assert 89.0 <= d <= 99.0


def test_a_run_is_searched_and_reported(tmp_path: Path) -> None:
    study = written(tmp_path, STUDY)
    searched = tpm_design("optimize", study, "--output", tmp_path / "runs", "--workers", "1", "--json")
    assert searched.code == 0, searched.errors
    run = Path(json.loads(searched.output)["run"])
    assert tpm_design("report", run).code == 0
    text = (run / "report.md").read_text(encoding="utf-8")
    assert "every tilt up to 40 deg, whichever way, over distances of 10 mm, its centre at d = 94 mm" in text
    assert "`center_d`" in text
    assert (run / "figures" / "workspace.png").stat().st_size > 10_000
    assert not (run / "figures" / "conditioning.png").exists()
