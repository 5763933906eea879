"""Exit codes and output of `optimize` for studies that ask for a proof."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import Outcome, tpm_design, written

STUDY = """\
version: 1
name: small
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters: {db: 178, dp: 60, f: {min: 100, max: 400}, r: {min: 100, max: 400}, k: 1}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [60, 60, 60], center: [150, 150, 150]}
objectives: [{metric: total_link_length, sense: minimize}]
constraints: [{metric: conditioning_min, label: even, norm: frobenius, min: 0.8}]
optimizer: {method: scipy.differential_evolution, budget: 100, seed: 1, polish: nlopt.cobyla}
certify: {tolerance: {f: 0.1, r: 0.1}, boxes: 20000}
"""


def optimized(folder: Path, text: str, *options: str) -> Outcome:
    return tpm_design("optimize", written(folder, text), "--output", folder, "--workers", "1", "-q", *options)


def test_a_proved_design_ends_with_0(tmp_path: Path) -> None:
    outcome = optimized(tmp_path, STUDY)
    assert (outcome.code, outcome.errors) == (0, "")
    assert "Proved in round 2 for every machine within the tolerances." in outcome.output


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("boxes: 20000", "boxes: 20"), "Not proved"),
        (("{f: 0.1, r: 0.1}", "{f: 20, r: 20}"), "Refuted: even"),
    ],
)
def test_a_design_that_is_not_proved_ends_with_5(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    outcome = optimized(tmp_path, STUDY.replace(*change))
    assert (outcome.code, outcome.errors) == (5, "")
    assert words in outcome.output
    data = optimized(tmp_path, STUDY.replace(*change), "--json")
    assert data.code == 5
    assert json.loads(data.output)["verdict"]["outcome"] in ("refuted", "undecided")


def test_where_nothing_is_feasible_nothing_is_certified_and_the_code_is_3(tmp_path: Path) -> None:
    outcome = optimized(tmp_path, STUDY.replace("min: 0.8", "min: 0.99999"), "--budget", "30")
    assert (outcome.code, outcome.errors) == (3, "")
    assert "Nothing was certified." in outcome.output
    assert list(tmp_path.glob("*/*/certificate.json")) == []
