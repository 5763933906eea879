"""The optimality gap in what `optimize` prints, in run.json and in the report."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import STUDY, tpm_design, written

from tpm_design.report.markdown import report_markdown
from tpm_design.report.reported import read_reported

LINKS = "{metric: total_link_length, sense: minimize}"


def optimized(folder: Path, text: str, *options: str) -> tuple[int, str, dict[str, object], Path]:
    path = written(folder, text)
    outcome = tpm_design("optimize", path, "--output", folder / "out", "--workers", "1", "--quiet", *options)
    (run,) = (folder / "out").glob("*/*/run.json")
    return outcome.code, outcome.output, json.loads(run.read_text(encoding="utf-8")), run.parent


def test_the_gap_is_printed_and_kept(tmp_path: Path) -> None:
    code, output, summary, run = optimized(tmp_path, STUDY)
    assert code == 0
    bound = summary["bound"]
    assert isinstance(bound, dict)
    # the far corner of the cube at 185 mm from all planes: each limb reaches √(145² + 2·185²) mm
    reach = 1e-3 * (145.0**2 + 2 * 185.0**2) ** 0.5
    assert bound["least"] == pytest.approx(3 * reach, rel=1e-6)
    (line,) = (line for line in output.splitlines() if line.startswith("Optimality gap"))
    assert f"at most {100 * bound['gap']:.3g} % above the shortest links that reach the region at all" in line
    assert f"{1e3 * bound['least']:.6g} mm" in line
    assert line.split("(")[0].strip() in report_markdown(read_reported(run), [])


def test_a_study_of_another_objective_says_nothing(tmp_path: Path) -> None:
    code, output, summary, _ = optimized(
        tmp_path, STUDY.replace(LINKS, "{metric: robot_size, sense: minimize}"), "--budget", "20"
    )
    assert code in (0, 3)
    assert "bound" not in summary
    assert "gap" not in output


def test_a_lower_bound_alone_ends_with_code_3(tmp_path: Path) -> None:
    code, output, summary, _ = optimized(tmp_path, STUDY.replace("scipy.differential_evolution", "convex"))
    assert code == 3
    assert "lower bound, not a design" in output
    assert "whatever else is asked of it" in output
    assert isinstance(summary["bound"], dict)
    assert summary["bound"]["gap"] is None
