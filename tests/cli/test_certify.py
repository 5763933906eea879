"""`tpm-design certify` from outside: outcomes, exit codes, files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import tpm_design, written

# one worker compiles the kernels of all proofs of 3-URUs
pytestmark = pytest.mark.xdist_group("uru")

STUDY = """\
version: 1
name: small-cube
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters: {db: 190, dp: 60, f: {min: 200, max: 300, initial: 240}, r: 180, k: 1}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [100, 100, 100], center: [160, 160, 160]}
objectives: [{metric: total_link_length, sense: minimize}]
constraints:
  - {metric: coverage, min: 1}
  - {metric: conditioning_min, min: 0.3}
certify: {tolerance: {db: 0.1, f: 0.1, r: 0.1}}
"""


def test_a_proof_is_written_checked_and_rejected_when_it_is_altered(tmp_path: Path) -> None:
    study = written(tmp_path, STUDY)
    target = tmp_path / "proof.json"
    done = tpm_design("certify", study, "--output", target)
    assert done.code == 0, done.errors
    assert "Proved at every pose of the region, for every machine within db ± 0.1 mm" in done.output
    checked = tpm_design("certify", "--check", target, "--json")
    assert checked.code == 0
    assert json.loads(checked.output)["valid"] is True

    text = target.read_text(encoding="utf-8")
    target.write_text(text.replace('"label": "coverage"', '"label": "Coverage"'), encoding="utf-8")
    rejected = tpm_design("certify", "--check", target)
    assert rejected.code == 5
    assert "REJECTED" in rejected.output


def test_a_refuted_requirement_has_its_own_exit_code(tmp_path: Path) -> None:
    study = written(tmp_path, STUDY.replace("conditioning_min, min: 0.3", "conditioning_min, min: 0.8"))
    target = tmp_path / "proof.json"
    done = tpm_design("certify", study, "--output", target, "--json")
    assert done.code == 5
    data = json.loads(done.output)
    assert data["outcome"] == data["requirements"]["conditioning_min"]["outcome"] == "refuted"
    assert len(data["requirements"]["conditioning_min"]["pose"]) == 3
    assert data["requirements"]["coverage"] == {
        "outcome": "proved", "reason": "", "unit": "-",
        "slack": pytest.approx(0.15, abs=0.15),
    }  # fmt: skip


def test_the_certificate_of_a_study_lies_where_the_command_was_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path, STUDY)
    done = tpm_design("certify", "study.yaml", "--set", "f=245", "--quiet")
    assert done.code == 0, done.errors
    assert json.loads((tmp_path / "certificate.json").read_text(encoding="utf-8"))["design"]["f"] == 0.245


def test_the_largest_tolerance_is_printed_for_the_drawing(tmp_path: Path) -> None:
    text = STUDY.replace("certify: {", "certify: {boxes: 5000, ")
    done = tpm_design("certify", written(tmp_path, text), "--max-tolerance", "--json")
    data = json.loads(done.output)
    assert done.code == 0
    assert data["tolerance"]["f"]["unit"] == "mm"
    assert data["tolerance"]["f"]["value"] == pytest.approx(0.1 * data["factor"])
    assert data["factor"] < data["failed_factor"] <= 1.02 * data["factor"]


@pytest.mark.parametrize(
    ("arguments", "change", "expected"),
    [
        ([], None, "Nothing to certify"),
        (["STUDY", "--check", "x.json"], None, "--check stands alone"),
        (["--check", "missing.json"], None, "missing.json"),
        (["STUDY", "--workers", "0"], None, "0 workers"),
        (["STUDY", "--output", "missing/x.json"], None, "cannot be written"),
        (
            ["STUDY", "--max-tolerance"],
            ("certify: {tolerance: {db: 0.1, f: 0.1, r: 0.1}}", ""),
            "no tolerances",
        ),
        (["STUDY", "--set", "q=3"], None, "no quantity 'q'"),
    ],
)
def test_wrong_usage_is_one_message(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    change: tuple[str, str] | None,
    expected: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path, STUDY.replace(*change) if change else STUDY)
    done = tpm_design("certify", *("study.yaml" if a == "STUDY" else a for a in arguments))
    assert done.code == 2
    assert expected in done.errors
    assert "Traceback" not in done.errors
    # nothing was proved in vain
    assert "Proving" not in done.errors


def test_a_study_without_constraints_has_nothing_to_prove(tmp_path: Path) -> None:
    text = STUDY.split("constraints:", maxsplit=1)[0]
    done = tpm_design("certify", written(tmp_path, text))
    assert done.code == 2
    assert "no constraints" in done.errors


def test_a_study_that_asks_for_no_proof_gets_a_certificate_that_checks(tmp_path: Path) -> None:
    study = written(tmp_path, STUDY.replace("certify: {tolerance: {db: 0.1, f: 0.1, r: 0.1}}", ""))
    target = tmp_path / "proof.json"
    done = tpm_design("certify", study, "--output", target)
    assert done.code == 0, done.errors
    assert "for the exact dimensions" in done.output
    assert tpm_design("certify", "--check", target, "--quiet").code == 0


def test_a_folder_is_no_place_for_a_certificate(tmp_path: Path) -> None:
    done = tpm_design("certify", written(tmp_path, STUDY), "--output", tmp_path)
    assert done.code == 2
    assert "needs a file name" in done.errors
