"""`tpm-design inscribe`: what it prints can be used, and what cannot be answered has its own exit code."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from command_line import tpm_design, written

from tpm_design.checker import check_certificate

# the Orthoglide's determinant touches 0 with the square of the distance: its least margin of 1e-9 is met
# 3e-5 away
TOUCHING = 2e-4

STUDY = """\
version: 1
name: inscribed
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters: {db: 100, dp: 60, f: {min: 100, max: 500, initial: 250}, r: 250, k: 1}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [70, 70, 70], center: free}
objectives: [{metric: total_link_length, sense: minimize}]
constraints: [{metric: coverage, min: 1}, {metric: conditioning_min, min: 0.2}]
"""


ORTHOGLIDE = """\
version: 1
name: inscribed
units: {length: mm, angle: deg}
mechanism: {type: orthoglide, parameters: {L: 300}, mode: {carriages: "+++"}}
objectives: [{metric: total_link_length, sense: minimize}]
"""


def region_text(output: str) -> str:
    return output[output.index("\nregion:") + 1 :].partition("\n\n")[0]


def test_the_region_that_is_printed_can_be_pasted(tmp_path: Path) -> None:
    study = written(tmp_path, STUDY)
    shown = tpm_design("inscribe", study, "--body", "cylinder", "--margin", "0.1")
    assert shown.code == 0
    assert "Assumed: f = 250 mm" in shown.output and "Sampled, not proved" in shown.output
    before, after = STUDY.split("region: {type: box, size: [70, 70, 70], center: free}\n")
    pasted = written(tmp_path, f"{before}{region_text(shown.output)}{after}", "pasted.yaml")
    data = json.loads(tpm_design("evaluate", pasted, "--json").output)
    assert data["metrics"]["coverage"]["value"] == 1.0


def test_numbers_for_programs_carry_unit_and_error(tmp_path: Path) -> None:
    shown = tpm_design("inscribe", written(tmp_path, ORTHOGLIDE), "--body", "sphere", "--json")
    assert shown.code == 0 and shown.errors == ""
    told = json.loads(shown.output)
    assert told["verified"] == "sampled" and told["region"]["type"] == "sphere"
    # struts of 300 mm
    radius = 150.0 * (1.0 + 1.0 / math.sqrt(2.0))
    size = told["sizes"]["radius"]
    assert size["value"] == pytest.approx(radius, rel=TOUCHING) and size["unit"] == "mm"
    assert 0.0 < size["growth"] < 1e-6 * radius
    assert told["volume"]["value"] == pytest.approx(4.0 / 3.0 * math.pi * size["value"] ** 3)
    assert told["volume"]["unit"] == "mm³" and 0.0 <= told["volume"]["gap"] < 1e-6
    assert set(told["margins"]) == {"reach", "actuation"}
    assert all(one["value"] - one["error"] >= one["asked"] for one in told["margins"].values())


def test_a_proved_body_is_proved_again_by_other_means(tmp_path: Path) -> None:
    study, target = written(tmp_path, ORTHOGLIDE), tmp_path / "body.json"
    options = ("--body", "sphere", "--margin", "0.2", "--certify", "--output", target, "--workers", "1")
    shown = tpm_design("inscribe", study, *options, "--json")
    assert shown.code == 0
    told = json.loads(shown.output)
    assert told["verified"] == "proved" and 0.0 < told["shrunk"] <= 0.01
    radius = told["region"]["radius"]
    assert radius == pytest.approx((1.0 - told["shrunk"]) * told["largest_found"]["radius"], rel=1e-8)
    certificate = json.loads(target.read_text(encoding="utf-8"))
    (floor,) = [one["floor"] for one in certificate["statements"] if one["kind"] == "determinant"]
    assert floor >= 0.2
    assert certificate["region"]["half"] == pytest.approx([1e-3 * radius] * 3, rel=1e-12)
    assert check_certificate(target).valid


def test_a_proof_with_too_few_boxes_says_so(tmp_path: Path) -> None:
    study = written(tmp_path, f"{ORTHOGLIDE}certify: {{tolerance: {{L: 0.1}}, boxes: 1}}\n")
    target = tmp_path / "body.json"
    shown = tpm_design("inscribe", study, "--body", "box", "--certify", "--output", target, "--workers", "1")
    assert shown.code == 5
    assert "Not proved" in shown.output
    assert json.loads(target.read_text(encoding="utf-8"))["outcome"] == "undecided"


def test_a_study_with_no_room_ends_with_its_own_code(tmp_path: Path) -> None:
    shown = tpm_design("inscribe", written(tmp_path, STUDY), "--body", "sphere", "--margin", "0.8")
    assert shown.code == 3
    assert "No sphere fits" in shown.errors and "--margin" in shown.errors


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--body", "cone"], "no body 'cone'"),
        (["--body", "box", "--margin", "1"], "no margin"),
        (["--body", "box", "--proportions", "1,x,1"], "no proportions"),
        (["--body", "sphere", "--proportions", "1,1,1"], "as long as it is wide"),
        (["--body", "box", "--output", "body.json"], "--certify"),
        (["--body", "box", "--set", "g=1"], "no quantity 'g'"),
        (["--body", "box", "--set", "f=0"], "f cannot be 0"),
        ([], "--body"),
    ],
)
def test_bad_input_gets_one_message(tmp_path: Path, options: list[str], told: str) -> None:
    shown = tpm_design("inscribe", written(tmp_path, STUDY), *options)
    assert shown.code == 2
    assert told in shown.errors and "Traceback" not in shown.errors


def test_a_mechanism_without_positions_is_refused() -> None:
    study = Path(__file__).parents[2] / "studies" / "07-puu-tilt.yaml"
    shown = tpm_design("inscribe", study, "--body", "sphere")
    assert shown.code == 2
    assert "not positions" in shown.errors
