"""docs/ci/tpm-design.yml: its steps run in order, as GitHub runs them, in a project with one study."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).parents[2]
WORKFLOW = YAML(typ="safe").load((ROOT / "docs" / "ci" / "tpm-design.yml").read_text(encoding="utf-8"))
JOB, SWEEP, COMPARE_SWEEP = (WORKFLOW["jobs"][name] for name in ("search", "sweep", "compare-sweep"))
INSTALL, COMPARE, SHOW = "Install", "Compare with the baseline", "Show it in the pull request"

pytestmark = [
    pytest.mark.skipif(os.name == "nt", reason="the steps are for a Unix shell"),
    pytest.mark.xdist_group("workflow"),
]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with the workflow's study and baseline; `tpm-design` is this one, as if installed."""
    folder = tmp_path_factory.mktemp("project")
    for name in ("STUDY", "BASELINE", "SWEEP_BASELINE"):
        source, target = ROOT / WORKFLOW["env"][name], folder / WORKFLOW["env"][name]
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            shutil.copyfile(source, target)
    program = folder / "installed" / "tpm-design"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m tpm_design "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    return folder


def carried_out(
    project: Path, steps: list[dict[str, Any]], expressions: Mapping[str, str] = MappingProxyType({})
) -> dict[str, int]:
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
            script = re.sub(r"\$\{\{ (.*?) \}\}", lambda found: expressions[found[1]], step["run"])
            done = subprocess.run(["bash", "-e", "-c", script], cwd=project, env=environment, check=False)
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
def searched(project: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, int]]:
    """The project after all steps but the installation, on a machine of its own, and their exit codes."""
    project = shutil.copytree(project, tmp_path_factory.mktemp("searched") / "project")
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


def using(job: dict[str, Any], action: str) -> dict[str, Any]:
    """What the job's only step with this action is given."""
    (step,) = [step for step in job["steps"] if step.get("uses", "").startswith(f"actions/{action}@")]
    given: dict[str, Any] = step["with"]
    return given


def after_installation(job: dict[str, Any]) -> list[dict[str, Any]]:
    first, *others = [step for step in job["steps"] if "run" in step]
    assert first["name"] == INSTALL
    return others


@pytest.fixture(scope="module")
def joined(project: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, int]]:
    """Each shard in a project of its own, what they keep in a further one, and its exit codes."""
    shards = SWEEP["strategy"]["matrix"]["shard"]
    assert [shard.split("/") for shard in shards] == [
        [str(n + 1), str(len(shards))] for n in range(len(shards))
    ]
    assert COMPARE_SWEEP["needs"] == "sweep"
    kept, wanted = using(SWEEP, "upload-artifact"), using(COMPARE_SWEEP, "download-artifact")
    folder = shutil.copytree(project, tmp_path_factory.mktemp("joined") / "project")
    for number, shard in enumerate(shards):
        machine = shutil.copytree(project, tmp_path_factory.mktemp("machine") / "project")
        codes = carried_out(machine, after_installation(SWEEP), {"matrix.shard": shard})
        assert codes == {"Sweep a shard": 0}
        name = kept["name"].replace("${{ strategy.job-index }}", str(number))
        assert Path(name).match(wanted["pattern"])
        # an artifact is the content of the folder, put into one of its own name
        shutil.copytree(machine / kept["path"], folder / wanted["path"] / name)
    return folder, carried_out(folder, after_installation(COMPARE_SWEEP))


def test_the_shards_are_joined_and_compared_with_the_baseline(joined: tuple[Path, dict[str, int]]) -> None:
    folder, codes = joined
    assert codes == dict.fromkeys([step["name"] for step in after_installation(COMPARE_SWEEP)], 0)
    assert compared(folder).attrib["failures"] == "0"
    assert "within tolerance" in (folder / "summary.md").read_text(encoding="utf-8")
    assert all((folder / name).exists() for name in using(COMPARE_SWEEP, "upload-artifact")["path"].split())


def test_a_point_that_deviates_fails_the_comparison_of_the_sweep(
    joined: tuple[Path, dict[str, int]], tmp_path: Path
) -> None:
    folder = shutil.copytree(joined[0], tmp_path / "project")
    table = folder / WORKFLOW["env"]["SWEEP_BASELINE"] / "evaluations.csv"
    text = table.read_text(encoding="utf-8")
    assert text.count(",1.954167") == 1
    table.write_text(text.replace(",1.954167", ",1.954177"), encoding="utf-8")
    codes = carried_out(folder, after_installation(COMPARE_SWEEP)[1:])
    assert codes == {"Compare the sweep with its baseline": 4, SHOW: 0}
    (failed,) = compared(folder).iter("failure")
    assert "velocity_max" in failed.attrib["message"]
