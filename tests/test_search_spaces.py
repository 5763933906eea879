"""Ranges searched by their logarithm, and parameters searched as multiples of another one."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tpm_design as tpm
from tpm_design.design_space import (
    DesignSpace,
    coordinate_at,
    octant_signs,
    spans,
    value_at,
    values_at,
    with_changes,
)
from tpm_design.errors import StudyError
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.problem import Problem, Variable
from tpm_design.report.readings import at_end
from tpm_design.report.words import range_text
from tpm_design.study import choose_design
from tpm_design.study.plain import dump_yaml
from tpm_design.study.schema import study_schema
from tpm_design.study.study import Study
from tpm_design.study.sweep_points import sweep_points
from tpm_design.study.template import template

STUDY = """\
version: 1
name: shares
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters:
    db: {ratio: f, min: 0.2, max: 1}
    dp: {ratio: db, min: 0.1, max: 0.9, initial: 0.3, scale: log}
    f: {min: 10, max: 1000, scale: log}
    r: {equals: db}
    k: {values: [1, 2]}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [10, 10, 10], center: [50, 50, 50]}
objectives: [{metric: total_link_length, sense: minimize}]
"""
OBJECTIVE = "{metric: total_link_length, sense: minimize}]\n"
GRID = OBJECTIVE + "sweep: {type: grid, parameters: "

shares = st.floats(0.0, 1.0)


def loaded(folder: Path, *pairs: tuple[str, str], text: str = STUDY) -> Study:
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return tpm.load_study(path)


def space_of(problem: Problem) -> DesignSpace:
    return DesignSpace(problem.variables, problem.fixed, octant_signs(problem.modes), problem.ties)


@st.composite
def ranges(draw: st.DrawFn) -> Variable:
    """A range that is not so narrow that its values have lost their digits."""
    lower = draw(st.floats(1e-6, 1e6))
    factor = draw(st.floats(1.5, 1e6))
    linear = Variable("x", "length", lower=lower, upper=lower * factor, mirrored=draw(st.booleans()))
    return replace(linear, scale="log") if draw(st.booleans()) else linear


# --------------------------------------------------------------------------------- one range


@settings(deadline=None)
@given(ranges(), shares)
def test_a_coordinate_comes_back_from_its_value(variable: Variable, share: float) -> None:
    value = float(value_at(variable, share))
    assert variable.lower <= value <= variable.upper
    assert abs(coordinate_at(variable, value) - share) <= 1e-12
    if variable.mirrored:
        assert coordinate_at(variable, -value) == coordinate_at(variable, value)


@settings(deadline=None)
@given(ranges())
def test_the_ends_of_a_range_are_exact(variable: Variable) -> None:
    for share, end in ((0.0, variable.lower), (1.0, variable.upper)):
        assert value_at(variable, share) == end
        assert coordinate_at(variable, end) == share
    assert value_at(variable, -0.1) == variable.lower
    assert value_at(variable, 1.1) == variable.upper


@settings(deadline=None)
@given(ranges(), shares, st.floats(0.0, 0.2))
def test_equal_steps_of_a_log_coordinate_are_equal_factors(
    variable: Variable, share: float, step: float
) -> None:
    low, middle, high = (float(value_at(variable, s)) for s in (share * 0.6, share * 0.6 + step, 0.2 + step))
    assert low <= middle
    if variable.scale == "log":
        whole = variable.upper / variable.lower
        assert math.isclose(middle / low, whole**step, rel_tol=1e-9)
        assert math.isclose(high / variable.lower, whole ** (0.2 + step), rel_tol=1e-9)


# ------------------------------------------------------------------------- a study with ratios


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return loaded(tmp_path_factory.mktemp("shares"))


@settings(deadline=None)
@given(coordinates=st.tuples(shares, shares, shares, shares))
def test_a_ratio_holds_in_every_design(study: Study, coordinates: tuple[float, ...]) -> None:
    problem = study.problem
    space, point = space_of(problem), np.array(coordinates)
    design = space.design(point)
    _, multiples = values_at(problem.variables, point)
    assert set(multiples) == {"db", "dp"}
    assert design["db"] == multiples["db"] * float(design["f"])
    assert design["dp"] == multiples["dp"] * float(design["db"])
    assert design["r"] == design["db"]
    continuous = [place for place, variable in enumerate(problem.variables) if not variable.values]
    assert np.abs(space.point(design) - point)[continuous].max() <= 1e-12
    for name, (low, high) in spans({v.name: v for v in problem.variables}).items():
        assert low <= float(design[name]) <= high


@settings(deadline=None)
@given(coordinates=st.tuples(shares, shares, shares, shares), share=st.floats(0.01, 0.3))
def test_a_neighbourhood_keeps_scales_and_ratios(
    study: Study, coordinates: tuple[float, ...], share: float
) -> None:
    space = space_of(study.problem)
    centre = space.design(np.array(coordinates))
    near = space.holding_discrete(centre).near(centre, share)
    around = [c for c, v in zip(coordinates, space.variables, strict=True) if not v.values]
    for corner in itertools.product((0.0, 1.0), repeat=3):
        design = near.design(np.array(corner))
        assert design["k"] == centre["k"]
        assert design["r"] == design["db"]
        found = np.delete(space.point(design), [v.name for v in space.variables].index("k"))
        expected = [
            min(1.0, max(0.0, c + (2 * end - 1) * share)) for c, end in zip(around, corner, strict=True)
        ]
        assert np.allclose(found, expected, rtol=0, atol=1e-10)


def test_what_is_not_said_is_a_multiple_or_a_geometric_mean(study: Study) -> None:
    design, assumed = choose_design(study, {})
    assert design["f"] == pytest.approx(0.1, rel=1e-12)
    assert design["db"] == 0.6 * float(design["f"])
    assert design["dp"] == 0.3 * float(design["db"])
    assert assumed[:3] == (
        "db = 0.6 × f (the middle of its range)",
        "dp = 0.3 × db (its initial value)",
        "f = 100 mm (the middle of its range)",
    )
    space = space_of(study.problem)
    assert space.design(space.start())["f"] == pytest.approx(0.1, rel=1e-12)
    assert space.start()[1] == pytest.approx(math.log(3.0) / math.log(9.0), abs=1e-15)


def test_setting_a_parameter_leaves_the_multiples_of_it(study: Study) -> None:
    design, assumed = choose_design(study, {"f": "200"})
    assert (design["f"], design["db"], design["dp"]) == (0.2, 0.6 * 0.2, 0.3 * (0.6 * 0.2))
    assert study.evaluate({"f": 0.2}).design == design
    assert not any(line.startswith("f ") for line in assumed)
    design, _ = choose_design(study, {"db": "60", "f": "500"})
    assert (design["f"], design["db"], design["r"], design["dp"]) == (0.5, 0.06, 0.06, 0.3 * 0.06)
    assert study.evaluate({"db": 0.06, "f": 0.5}).design == design


def test_a_stored_design_keeps_what_does_not_change(study: Study) -> None:
    stored = space_of(study.problem).design(np.array([0.3, 0.8, 0.9, 0.1]))
    assert with_changes(study.problem, stored, {}) == stored
    assert with_changes(study.problem, stored, {"k": 2.0}) == {**stored, "k": 2.0}
    longer = with_changes(study.problem, stored, {"f": 2.0 * float(stored["f"])})
    assert longer["db"] == longer["r"] == pytest.approx(2.0 * float(stored["db"]), rel=1e-15)
    assert longer["dp"] == pytest.approx(2.0 * float(stored["dp"]), rel=1e-15)
    wider = with_changes(study.problem, stored, {"db": 0.06})
    assert (wider["f"], wider["db"], wider["r"]) == (stored["f"], 0.06, 0.06)


def test_a_resolved_study_is_the_same_study(study: Study, tmp_path: Path) -> None:
    again = loaded(tmp_path, text=dump_yaml(study.resolved()))
    assert again == study
    assert study.resolved()["mechanism"]["parameters"]["dp"] == {
        "ratio": "db", "min": 0.1, "max": 0.9, "initial": 0.3, "scale": "log",
    }  # fmt: skip


def test_ranges_are_told_as_they_are_searched(study: Study) -> None:
    told = [range_text(study.problem, name, study.units) for name in ("db", "dp", "f", "r")]
    assert told == ["0.2 … 1 × f", "0.1 … 0.9 × db, log scale", "10 … 1000 mm, log scale", "equals db"]
    space = space_of(study.problem)
    for share, ends in ((0.0, ["db", "dp", "f"]), (0.5, []), (1.0, ["db", "dp", "f"])):
        evaluation = evaluate(study.problem, space.design(np.full(4, share)))
        assert [variable.name for variable in at_end(study.problem, evaluation)] == ends


def test_limbs_may_be_multiples_of_each_other(tmp_path: Path) -> None:
    text = STUDY.replace(
        "r: {equals: db}",
        "r1: 70\n    r2: {ratio: r1, min: 0.5, max: 2}\n    r3: {ratio: r2, min: 1, max: 3}",
    )
    problem = loaded(tmp_path, text=text).problem
    design = space_of(problem).design(np.full(len(problem.variables), 0.5))
    assert design["r2"] == 1.25 * 0.07
    assert design["r3"] == 2.0 * (1.25 * 0.07)
    assert spans({"r1": 0.07, **{v.name: v for v in problem.variables}})["r3"] == (0.035, 3.0 * (2.0 * 0.07))


def test_a_range_of_mirrored_centres_may_be_logarithmic(tmp_path: Path) -> None:
    axis = "{min: 40, max: 160, scale: log}"
    study = loaded(
        tmp_path,
        ("center: [50, 50, 50]", f"center: {{x: {axis}, y: {axis}, z: {axis}, mirrored: true}}"),
        ('{octant: "+++", elbows: "+++"}', "best"),
    )
    space = space_of(study.problem)
    names = [variable.name for variable in space.variables]
    modes = next(variable.values for variable in space.variables if variable.name == "mode")
    assert len({space.octants[str(mode)] for mode in modes}) > 1
    for place in range(len(modes)):
        point = np.full(len(names), 0.5)
        point[names.index("mode")] = (place + 0.5) / len(modes)
        design = space.design(point)
        signs = space.octants[str(design["mode"])]
        assert [design[f"center_{axis}"] for axis in "xyz"] == [0.08 * sign for sign in signs]
        assert np.allclose(space.point(design)[names.index("center_x")], 0.5, rtol=0, atol=1e-15)


# ------------------------------------------------------------------------------------ sweeps


def test_steps_of_a_log_range_are_geometric(tmp_path: Path) -> None:
    for axis, expected in (("{num: 5}", [10, 31.6227766017, 100, 316.227766017, 1000]),
                           ("{min: 20, max: 80, num: 3}", [20, 40, 80])):  # fmt: skip
        plan = OBJECTIVE + f"sweep: {{type: grid, parameters: {{f: {axis}}}}}\n"
        study = loaded(tmp_path, (OBJECTIVE, plan))
        points = sweep_points(study)
        assert [point.design["f"] for point in points] == [value / 1000 for value in expected]
        assert all(p.design["db"] == 0.6 * float(p.design["f"]) for p in points)
        assert loaded(tmp_path, text=dump_yaml(study.resolved())) == study


def test_a_sweep_names_lengths_and_samples_multiples(tmp_path: Path) -> None:
    plan = OBJECTIVE + "sweep: {type: list, points: [{db: 50}, {f: 80, db: 20}, {f: 80}]}\n"
    designs = [point.design for point in sweep_points(loaded(tmp_path, (OBJECTIVE, plan)))]
    assert [(d["f"], d["db"]) for d in designs[1:]] == [(0.08, 0.02), (0.08, 0.6 * 0.08)]
    assert designs[0]["db"] == designs[0]["r"] == 0.05
    assert [d["dp"] for d in designs] == [0.3 * float(d["db"]) for d in designs]
    for kind in ("sobol", "latin_hypercube"):
        plan = OBJECTIVE + f"sweep: {{type: {kind}, samples: 64, parameters: [f, db]}}\n"
        designs = [point.design for point in sweep_points(loaded(tmp_path, (OBJECTIVE, plan)))]
        multiples = sorted(float(d["db"]) / float(d["f"]) for d in designs)
        assert 0.2 <= multiples[0] < 0.23
        assert 0.97 < multiples[-1] <= 1.0
        # as many below the geometric mean as above it: two halves of the unit cube
        assert sum(float(d["f"]) < 0.1 for d in designs) == 32
        assert all(d["dp"] == 0.3 * float(d["db"]) for d in designs)


# ---------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("pairs", "told", "remedy"),
    [
        ([("min: 10, max: 1000", "min: 0, max: 1000")], "min 0 has no logarithm", "above 0"),
        ([("scale: log}\n    r", "scale: ln}\n    r")], "cannot be 'ln'", "log"),
        ([("ratio: f", "ratio: db")], "db is a ratio of itself", "another"),
        ([("ratio: f", "ratio: q")], "db is a ratio of 'q', which this study does not give", ""),
        ([("ratio: f", "ratio: f1")], "'f1', which this study does not give", "f"),
        ([("ratio: f", "ratio: r")], "db is a ratio of r, which equals db", "range of its own"),
        ([("{equals: db}", "{equals: f}"), ("ratio: f", "ratio: r")], "r, which equals f", "`ratio: f`"),
        ([("ratio: f", "ratio: k")], "db is a length and k is a ratio", "same kind"),
        ([("ratio: f", "ratio: dp")], "db is a ratio of dp, which is a ratio of db", "range of its own"),
        ([("min: 0.1, max: 0.9, initial: 0.3, scale: log", "min: -0.1, max: 0.9")],
         "dp cannot be every such multiple of db", "0 or more"),
        ([("{ratio: f, min: 0.2, max: 1}", "{min: 0, max: 10}"), ("equals: db", "equals: f")],
         "dp is a ratio of db, which can be 0", "above 0"),
        ([("min: 0.2, max: 1}", "min: 1, max: 0.2}")], "larger than max", "Swap"),
        ([("min: 0.2, max: 1}", "min: 1, max: 1}")], "both 1", "Widen"),
        ([("initial: 0.3", "initial: 3")], "initial 3 is outside", "within"),
        ([("min: 0.2, max: 1}", "values: [1, 2]}")], "unknown key 'ratio'", ""),
        ([("[50, 50, 50]", "{x: {ratio: f, min: 1, max: 2}, y: 0, z: 0}")], "unknown key 'ratio'", ""),
        ([(OBJECTIVE, GRID + "{db: {num: 3}}}\n")],
         "db is a ratio of f and has no range of its own to divide", "{min: …, max: …, num: …}"),
        ([(OBJECTIVE, GRID + "{f: {min: 0, max: 1, num: 3}}}\n")],
         "f is searched by its logarithm, and min 0 has none", "above 0"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_one_message(
    tmp_path: Path, pairs: list[tuple[str, str]], told: str, remedy: str
) -> None:
    with pytest.raises(StudyError) as found:
        loaded(tmp_path, *pairs)
    assert told in str(found.value)
    assert "\n" not in str(found.value.remedy)
    assert remedy in str(found.value.remedy)
    assert "study.yaml:" in str(found.value)


def test_the_commented_study_names_both_forms() -> None:
    text = template("mine", tpm.mechanisms.MECHANISMS["uru"])
    assert "{ratio: f, min:" in text
    assert "scale: log" in text


def test_the_schema_knows_both_forms(study: Study) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft202012Validator(study_schema())
    data = study.resolved()
    assert validator.is_valid(data)
    for key, value in (("scale", "ln"), ("ratio", 2), ("values", [1])):
        wrong = json.loads(json.dumps(data))
        wrong["mechanism"]["parameters"]["dp"][key] = value
        assert not validator.is_valid(wrong)
