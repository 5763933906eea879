"""A parameter that equals another one: no variable, and never out of step with the one it names."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import tpm_design as tpm
from tpm_design.design_space import DesignSpace, octant_signs
from tpm_design.errors import StudyError, UsageError
from tpm_design.runs.tables import parameter_columns
from tpm_design.study import choose_design
from tpm_design.study.plain import dump_yaml
from tpm_design.study.study import Study

pytestmark = pytest.mark.xdist_group("crr")

CUBE = (Path(__file__).parents[1] / "studies" / "03-crr-cube.yaml").read_text(encoding="utf-8")
CERTIFY = next(line for line in CUBE.splitlines() if line.startswith("certify:"))


def loaded(folder: Path, *pairs: tuple[str, str]) -> Study:
    text = CUBE
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return tpm.load_study(path)


def test_a_tied_parameter_is_no_variable_and_follows_everywhere(tmp_path: Path) -> None:
    study = loaded(tmp_path)
    problem = study.problem
    assert [variable.name for variable in problem.variables] == ["f", "ay1", "az1"]
    assert problem.ties["r"] == "f"
    assert "r" not in problem.fixed
    space = DesignSpace(problem.variables, problem.fixed, octant_signs(problem.modes), problem.ties)
    point = np.array([0.25, 0.4, 0.9])
    for design in (
        space.design(point),
        space.holding_discrete(space.design(point)).design(point),
        space.near(space.design(point), 0.2).design(point),
    ):
        assert design["r"] == design["f"]
        assert design["ax3"] == design["az2"] == design["ay1"]
        assert design["ax2"] == design["ay3"] == design["az1"]
    assert np.allclose(space.point(space.design(point)), point)
    chosen, assumed = choose_design(study, {"f": "200"})
    assert chosen["f"] == chosen["r"] == 0.2
    assert not any(line.startswith("r ") for line in assumed)
    headings = [column.heading for column in parameter_columns(problem, study.units)]
    assert headings[:2] == ["f [mm]", "r [mm]"]
    assert study.evaluate({"f": 0.25}).design["r"] == 0.25


def test_a_resolved_study_keeps_its_ties(tmp_path: Path) -> None:
    study = loaded(tmp_path)
    again = tmp_path / "again.yaml"
    again.write_text(dump_yaml(study.resolved()), encoding="utf-8")
    assert tpm.load_study(again) == study
    assert study.resolved()["mechanism"]["parameters"]["r"] == {"equals": "f"}


@pytest.mark.parametrize(
    ("tie", "told"),
    [
        ("{equals: q}", "'q', which this study does not give"),
        ("{equals: f1}", "'f1', which this study does not give"),
        ("{equals: r}", "equals itself"),
        ("{equals: ax2}", "which itself equals az1"),
        ("{equals: azimuth1}", "is a length and azimuth1 is an angle"),
        ("{equals: ay1}", "cannot take every value"),
        ("{equals: 5}", "must be a text"),
        ("{equals: f, min: 3}", "unknown key 'min'"),
    ],
)
def test_ties_that_cannot_be_are_told_with_their_line(tmp_path: Path, tie: str, told: str) -> None:
    angles = "azimuth1: 0\n    azimuth2: 90\n    azimuth3: 0\n    r: "
    with pytest.raises(StudyError) as found:
        loaded(tmp_path, ("    r: {equals: f}\n", f"    {angles}{tie}\n"))
    assert told in str(found.value)
    assert found.value.remedy
    assert "study.yaml:" in str(found.value)


def test_a_centre_is_not_tied(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="equals"):
        loaded(tmp_path, ("center: [0, 0, 0]", "center: {x: {equals: f}, y: 0, z: 0}"))


def test_a_tied_parameter_cannot_be_set_by_itself(tmp_path: Path) -> None:
    study = loaded(tmp_path)
    with pytest.raises(UsageError, match="r equals f") as found:
        choose_design(study, {"r": "100"})
    assert found.value.remedy is not None
    assert "Set f" in found.value.remedy
    with pytest.raises(UsageError, match="r equals f"):
        study.evaluate({"r": 0.1})


def test_a_tied_parameter_is_not_swept(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="no quantity"):
        loaded(tmp_path, (CERTIFY, "sweep: {type: grid, parameters: {r: {values: [100, 200]}}}"))


@pytest.mark.parametrize(
    ("limits", "least"), [("{}", 0.5 * math.sqrt(5.0)), ("{fold: false}", 1.0 / math.sqrt(2.0))]
)
def test_the_smallest_isotropic_crr_for_a_cube_is_found(tmp_path: Path, limits: str, least: float) -> None:
    study = loaded(tmp_path, (CERTIFY, ""), ("region:", f"  limits: {limits}\nregion:"))
    run = study.optimize(budget=700)
    assert run.best is not None
    assert run.best.status == "feasible"
    assert abs(run.best.metrics["total_link_length"] / 3.0 / (0.3 * least) - 1.0) < 1e-4
    assert (run.evaluations["f [mm]"] == run.evaluations["r [mm]"]).all()
    assert abs(run.best.metrics["conditioning_min"] - 1.0) < 1e-9


def test_a_free_centre_needs_bounds_where_the_axes_are_free(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="does not follow from its parameters"):
        loaded(
            tmp_path,
            ("center: [0, 0, 0]", "center: free"),
            ("    az3: 0", "    az3: 0\n    elevation: {min: 10, max: 40}"),
        )
