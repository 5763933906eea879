"""Exit codes and output of `optimize` for studies that ask for a proof."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import Outcome, tpm_design, written

from small_studies import CERTIFIED
from tpm_design.cli.results import result_text
from tpm_design.study import load_study

# one worker compiles the kernels of all proofs of 3-URUs
pytestmark = pytest.mark.xdist_group("uru")


def optimized(folder: Path, text: str, *options: str) -> Outcome:
    return tpm_design("optimize", written(folder, text), "--output", folder, "--workers", "1", "-q", *options)


def test_a_proved_design_ends_with_0(tmp_path: Path) -> None:
    outcome = optimized(tmp_path, CERTIFIED)
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
    outcome = optimized(tmp_path, CERTIFIED.replace(*change))
    assert (outcome.code, outcome.errors) == (5, "")
    assert words in outcome.output
    data = optimized(tmp_path, CERTIFIED.replace(*change), "--json")
    assert data.code == 5
    assert json.loads(data.output)["verdict"]["outcome"] in ("refuted", "undecided")


def test_where_nothing_is_feasible_nothing_is_certified_and_the_code_is_3(tmp_path: Path) -> None:
    outcome = optimized(tmp_path, CERTIFIED.replace("min: 0.8", "min: 0.99999"), "--budget", "30")
    assert (outcome.code, outcome.errors) == (3, "")
    assert "Nothing was certified." in outcome.output
    assert list(tmp_path.glob("*/*/certificate.json")) == []


def test_a_slack_that_a_sample_leaves_is_told_apart_from_that_of_the_value(tmp_path: Path) -> None:
    study = load_study(written(tmp_path, CERTIFIED))
    alone = study.evaluate({})
    goal = next(g for g in study.problem.constraints if alone.slacks[g.label] > 0.0 and g.minimum != 1.0)
    with_samples = replace(alone, slacks={**alone.slacks, goal.label: 0.5 * alone.slacks[goal.label]})
    assert "in worst sample" not in result_text(study.problem, study.units, alone)
    rows = result_text(study.problem, study.units, with_samples).splitlines()
    assert [row.split()[0] for row in rows if "in worst sample" in row] == [goal.label]
