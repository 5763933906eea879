"""docs/ci/tpm-design.yml: its steps run in order, as GitHub runs them, in a project with one study."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).parents[2]
WORKFLOW = YAML(typ="safe").load((ROOT / "docs" / "ci" / "tpm-design.yml").read_text(encoding="utf-8"))
(JOB,) = WORKFLOW["jobs"].values()
INSTALL, COMPARE, SHOW = "Install", "Compare with the baseline", "Show it in the pull request"

pytestmark = [
    pytest.mark.skipif(os.name == "nt", reason="the steps are for a Unix shell"),
    pytest.mark.xdist_group("workflow"),
]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with the workflow's study and baseline; `tpm-design` is this one, as if installed."""
    folder = tmp_path_factory.mktemp("project")
    for name in ("STUDY", "BASELINE"):
        source, target = ROOT / WORKFLOW["env"][name], folder / WORKFLOW["env"][name]
        target.parent.mkdir(parents=True)
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            shutil.copyfile(source, target)
    program = folder / "installed" / "tpm-design"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m tpm_design "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    return folder


def carried_out(project: Path, steps: list[dict[str, Any]]) -> dict[str, int]:
    """Exit codes of the steps that run, by name: after one that failed, those with `if: always()`."""
    environment = os.environ | WORKFLOW["env"]
    environment |= {
        "PATH": f"{project / 'installed'}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(sys.path),
        "GITHUB_STEP_SUMMARY": str(project / "summary.md"),
    }
    codes: dict[str, int] = {}
    for step in steps:
        assert step.get("if") in (None, "always()")
        if "run" in step and ("if" in step or not any(codes.values())):
            done = subprocess.run(
                ["bash", "-e", "-c", step["run"]], cwd=project, env=environment, check=False
            )
            codes[step["name"]] = done.returncode
    return codes


def uploaded(project: Path) -> list[Path]:
    (step,) = [step for step in JOB["steps"] if step.get("uses", "").startswith("actions/upload-artifact@")]
    assert step["if"] == "always()"
    return [project / name for name in step["with"]["path"].split()]


def compared(project: Path) -> Xml.Element:
    """The suite of test cases that the steps left."""
    return Xml.parse(project / "comparison.xml").getroot()[0]


@pytest.fixture(scope="module")
def searched(project: Path) -> tuple[Path, dict[str, int]]:
    """The project after all steps but the installation, and their exit codes."""
    steps = [step for step in JOB["steps"] if "run" in step]
    assert steps[0]["name"] == INSTALL
    assert "pip install" in steps[0]["run"]
    return project, carried_out(project, steps[1:])


def test_the_steps_compare_a_search_with_the_baseline(searched: tuple[Path, dict[str, int]]) -> None:
    project, codes = searched
    names = [step["name"] for step in JOB["steps"] if "run" in step]
    assert codes == dict.fromkeys(names[1:], 0)
    assert (project / "summary.md").read_text(encoding="utf-8").startswith("### orthoglide")
    assert "within tolerance" in (project / "summary.md").read_text(encoding="utf-8")
    assert all(path.exists() for path in uploaded(project))
    assert compared(project).attrib["failures"] == "0"


def test_a_result_that_deviates_fails_the_job_and_is_shown(
    searched: tuple[Path, dict[str, int]], tmp_path: Path
) -> None:
    project = shutil.copytree(searched[0], tmp_path / "project")
    table = project / WORKFLOW["env"]["BASELINE"] / "designs.csv"
    text = table.read_text(encoding="utf-8")
    assert text.count(",310.58") == 1
    table.write_text(text.replace(",310.58", ",310.88"), encoding="utf-8")
    (project / "summary.md").unlink()
    names = [step.get("name") for step in JOB["steps"]]
    codes = carried_out(project, JOB["steps"][names.index(COMPARE) :])
    assert codes == {COMPARE: 4, SHOW: 0}
    assert "| rank 1 | L " in (project / "summary.md").read_text(encoding="utf-8")
    (failed,) = compared(project).iter("failure")
    assert failed.attrib["message"].startswith("rank 1, L [mm]: 310.88")


def test_a_study_that_is_not_valid_ends_the_job_before_anything_is_searched(
    project: Path, tmp_path: Path
) -> None:
    shutil.copytree(project / "installed", tmp_path / "installed")
    (tmp_path / "studies").mkdir()
    (tmp_path / "studies" / "broken.yaml").write_text("version: 1\n", encoding="utf-8")
    steps = [step for step in JOB["steps"] if "run" in step]
    codes = carried_out(tmp_path, steps[1:])
    assert codes == {steps[1]["name"]: 2, SHOW: 0}
    assert not (tmp_path / "summary.md").exists()
