"""Study files: what is accepted means what it says; what is not gives one clear message."""

from __future__ import annotations

import math
import os
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tpm_design.errors import StudyError, UsageError
from tpm_design.mechanisms import MECHANISMS
from tpm_design.study import (
    GridSweep,
    ListSweep,
    SampleSweep,
    Study,
    choose_design,
    dump_yaml,
    load_comparison,
    load_study,
    study_schema,
    template,
)
from tpm_design.study.document import parse_document, read_document
from tpm_design.study.form import parse
from tpm_design.study.registries import registries
from tpm_design.study.resolve import resolve
from tpm_design.units import Units, unit_for
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Points, Sphere

STUDIES = sorted((Path(__file__).parents[1] / "studies").glob("*.yaml"))
GOOD = next(path for path in STUDIES if path.name == "01-uru-cube.yaml").read_text(encoding="utf-8")
REGION = "region: {type: box, size: [200, 200, 200], center: free}"
MODE = 'mode: {octant: "+++", elbows: "+++"}'
SWEEP = "sweep: {type: grid, parameters: {f: {num: 9}, r: {num: 9}}}"


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "study.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def changed(*pairs: tuple[str, str], text: str = GOOD) -> str:
    """The good study with some text replaced; each piece must be there."""
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def loaded(folder: Path, *pairs: tuple[str, str]):  # type: ignore[no-untyped-def]
    return load_study(written(folder, changed(*pairs)))


# ------------------------------------------------------------------------------------- good studies


def studies_in(path: Path) -> list[Study]:
    """The study of a file, or all that it compares."""
    comparison = load_comparison(path)
    return [load_study(path)] if comparison is None else list(comparison.studies.values())


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.name)
def test_studies_of_the_project_are_valid_and_resolve_to_themselves(path: Path, tmp_path: Path) -> None:
    for study in studies_in(path):
        again = load_study(written(tmp_path, dump_yaml(study.resolved())))
        assert again == study
        assert again.resolved() == study.resolved()
        assert again.study_hash == study.study_hash


COMPARISON = """\
version: 1
name: both
units: {length: mm, angle: deg}
architectures:
  glide: {mechanism: {type: orthoglide, parameters: {L: {min: 100, max: 400}}, mode: {carriages: "+++"}}}
  towers:
    mechanism:
      type: linear_delta
      parameters: {R: 150, r: 40, l: {min: 200, max: 300}, rail: 500}
      mode: {carriages: "+++"}
    region: {type: sphere, radius: 30, center: [0, 0, -400]}
region: {type: sphere, radius: 30, center: [0, 0, 0]}
objectives: [{metric: total_link_length, sense: minimize}]
constraints: [{metric: coverage, min: 1}]
optimizer: {method: scipy.differential_evolution, budget: 40, seed: 1}
"""


def test_a_comparison_is_a_study_for_each_architecture(tmp_path: Path) -> None:
    comparison = load_comparison(written(tmp_path, COMPARISON))
    assert comparison is not None
    assert {label: study.name for label, study in comparison.studies.items()} == {
        "glide": "both-glide",
        "towers": "both-towers",
    }
    assert comparison.studies["glide"].problem.kind.name == "orthoglide"
    assert comparison.studies["glide"].problem.fixed["center_z"] == 0.0
    assert comparison.studies["towers"].problem.fixed["center_z"] == -0.4


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            "  glide: {mechanism:",
            "  glide: {units: {length: m}, mechanism:",
            r":5: units is said once for all",
        ),
        ("  glide: {mechanism:", "  glide: {mechanisms:", r":5: 'mechanisms' is no part of a study"),
        ("type: orthoglide", "type: orthoglid", r":5: there is no mechanism 'orthoglid'"),
        ("    region: {type: sphere, radius: 30", "    region: {type: sphere, radius: -30", r":11: .*radius"),
        ("{metric: coverage, min: 1}", "{metric: covrage, min: 1}", r":14: there is no metric 'covrage'"),
    ],
)
def test_what_is_wrong_in_a_comparison_is_told_with_its_line(
    old: str, new: str, told: str, tmp_path: Path
) -> None:
    assert old in COMPARISON
    with pytest.raises(StudyError) as caught:
        load_comparison(written(tmp_path, COMPARISON.replace(old, new)))
    assert re.search(told, str(caught.value)), str(caught.value)


def test_everything_inside_is_si(tmp_path: Path) -> None:
    study = loaded(tmp_path, ("limits: {}", "limits: {theta2: {min: -90, max: 180}, link_radius: 12.5}"))
    problem = study.problem
    variables = {variable.name: variable for variable in problem.variables}
    assert list(variables) == ["db", "f", "r", "k", "center_x", "center_y", "center_z"]
    assert (variables["f"].lower, variables["f"].upper) == (0.15, 0.6)
    assert variables["k"].values == (0.5, 1.0, 2.0)
    assert problem.fixed == {"dp": 0.06, "mode": "+++ +++"}
    assert problem.modes == {"+++ +++": {"octant": "+++", "elbows": "+++"}}
    assert problem.limits == {"theta2": (-math.pi / 2, math.pi), "link_radius": 0.0125}
    assert problem.region == Box((0.2, 0.2, 0.2))
    assert [goal.label for goal in problem.constraints] == [
        "coverage",
        "conditioning_min",
        "actuation_singularity_distance",
        "rotation_singularity_distance",
    ]
    assert [goal.minimum for goal in problem.constraints] == [1.0, 0.3, 0.02, 0.02]
    assert [(goal.label, goal.sense) for goal in problem.objectives] == [("total_link_length", "minimize")]
    assert [goal.label for goal in problem.record] == ["gci"]
    assert study.certification.tolerance == {"db": 1e-4, "f": 1e-4, "r": 1e-4}
    assert (study.optimizer.method, study.optimizer.budget) == ("scipy.differential_evolution", 4000)
    assert (study.optimizer.seed, study.optimizer.polish) == (1, "nlopt.cobyla")


def test_the_same_question_in_other_units_is_the_same_problem(tmp_path: Path) -> None:
    metres = changed(
        ("length: mm", "length: m"),
        ("db: {min: 0, max: 400}", "db: {min: 0, max: 0.4}"),
        ("dp: 60", "dp: 0.06"),
        ("f: {min: 150, max: 600}", "f: {min: 0.15, max: 0.6}"),
        ("r: {min: 150, max: 600}", "r: {min: 0.15, max: 0.6}"),
        ("[200, 200, 200]", "[0.2, 0.2, 0.2]"),
        ("actuation_singularity_distance, min: 20", "actuation_singularity_distance, min: 0.02"),
        ("rotation_singularity_distance, min: 20", "rotation_singularity_distance, min: 0.02"),
        ("{db: 0.1, f: 0.1, r: 0.1}", "{db: 1e-4, f: 1e-4, r: 1e-4}"),
    )
    millimetres = load_study(written(tmp_path, GOOD))
    study = load_study(written(tmp_path, metres))
    assert study.problem == millimetres.problem
    assert study.certification == millimetres.certification
    assert study.study_hash != millimetres.study_hash


def test_the_order_and_style_of_the_file_change_nothing(tmp_path: Path) -> None:
    shuffled = changed(
        ("    db: {min: 0, max: 400}\n    dp: 60\n", "    dp: 60.0\n    db:\n      max: 4e2\n      min: 0\n"),
        ("name: uru-cube\n", ""),
    )
    study = load_study(written(tmp_path, "\ufeff" + shuffled.replace("\n", "\r\n") + 'name: "uru-cube"\r\n'))
    assert study == load_study(written(tmp_path, GOOD))


def test_defaults_are_written_out(tmp_path: Path) -> None:
    cut = GOOD.index("optimizer:")
    resolved = load_study(written(tmp_path, GOOD[:cut])).resolved()
    assert resolved["optimizer"] == {"method": "multistart", "budget": 2000, "seed": 1}
    assert resolved["accuracy"] == {"volume": 1e-3, "region_samples": 9}


@pytest.mark.parametrize(
    ("region", "shape"),
    [
        ("{type: cylinder, radius: 100, height: 50, center: [0, 0, 0]}", Cylinder(0.1, 0.05)),
        ("{type: sphere, radius: 100, center: [0, 0, 0]}", Sphere(0.1)),
        ("{type: ellipsoid, semi_axes: [1, 2, 4], center: [0, 0, 0]}", Ellipsoid((0.001, 0.002, 0.004))),
        ("{type: points, points: [[1, 2, 4]], center: [0, 0, 0]}", Points(((0.001, 0.002, 0.004),))),
        (
            "{type: points, file: sub/poses.csv, center: [0, 0, 0]}",
            Points(((0.001, 0.002, 0.004), (0.0, -1.0, 0.5))),
        ),
    ],
)
def test_regions(tmp_path: Path, region: str, shape: object) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "poses.csv").write_text("x, y, z\n1,2,4\n\n0, -1e3 ,500.0\r\n", encoding="utf-8")
    study = loaded(tmp_path, (REGION, f"region: {region}"))
    assert study.problem.region == shape
    assert {study.problem.fixed[f"center_{axis}"] for axis in "xyz"} == {0.0}
    (tmp_path / "sub" / "poses.csv").unlink()  # the resolved study holds the points itself
    assert load_study(written(tmp_path, dump_yaml(study.resolved()))) == study


def center(study) -> list[tuple[float, float, bool]]:  # type: ignore[no-untyped-def]
    return [(v.lower, v.upper, v.mirrored) for v in study.problem.variables if v.name.startswith("center")]


def test_a_free_centre_reaches_as_far_as_the_mechanism_on_the_octants_side(tmp_path: Path) -> None:
    # f + r + |dp − db| ≤ 600 + 600 + 340 mm
    assert center(loaded(tmp_path)) == [(0.0, 1.54, False)] * 3
    signed = loaded(tmp_path, ('octant: "+++"', 'octant: "+-+"'))
    assert center(signed) == [(0.0, 1.54, False), (-1.54, 0.0, False), (0.0, 1.54, False)]
    assert center(loaded(tmp_path, ('octant: "+++"', "octant: any"))) == [(-1.54, 1.54, False)] * 3


def test_a_centre_may_be_free_in_part(tmp_path: Path) -> None:
    axes = "center: {x: 100, y: {min: 50, max: 90, initial: 60}, z: {values: [1, 2]}}}"
    problem = loaded(tmp_path, ("center: free}", axes)).problem
    assert problem.fixed["center_x"] == 0.1
    assert [v.name for v in problem.variables][-2:] == ["center_y", "center_z"]
    assert problem.variables[-2].initial == 0.06


def test_best_tries_working_modes_and_mirrors_the_centre(tmp_path: Path) -> None:
    study = loaded(tmp_path, (MODE, "mode: best"))
    mode = study.problem.variables[-1]
    assert mode.name == "mode"
    assert mode.values == tuple(study.problem.modes)
    assert all(f"{m['octant']} {m['elbows']}" == label for label, m in study.problem.modes.items())
    if len({m["octant"] for m in study.problem.modes.values()}) > 1:
        assert center(study) == [(0.0, 1.54, True)] * 3
    assert load_study(written(tmp_path, dump_yaml(study.resolved()))) == study


def test_limbs_may_differ(tmp_path: Path) -> None:
    three = "f1: 300\n    f2: {min: 150, max: 600}\n    f3: 310"
    problem = loaded(
        tmp_path, ("f: {min: 150, max: 600}", three), (SWEEP, ""), ("f: 0.1, r: 0.1", "f1: 1")
    ).problem
    assert problem.fixed["f1"] == 0.3
    assert [v.name for v in problem.variables][:4] == ["db", "r", "k", "f2"]


@pytest.mark.parametrize(
    ("plan", "sweep"),
    [
        ("{type: grid, parameters: {f: {num: 3}}}", GridSweep((("f", (0.15, 0.375, 0.6)),))),
        (
            "{type: grid, parameters: {k: {values: [2, 1]}, dp: {min: 10, max: 20, num: 2}}}",
            GridSweep((("dp", (0.01, 0.02)), ("k", (2.0, 1.0)))),
        ),
        (
            "{type: list, points: [{f: 200, r: 300}, {dp: 1}]}",
            ListSweep(({"f": 0.2, "r": 0.3}, {"dp": 0.001})),
        ),
        ("{type: sobol, samples: 64, parameters: [r, f]}", SampleSweep("sobol", 64, 1, ("f", "r"))),
        (
            "{type: latin_hypercube, samples: 5, seed: 9}",
            SampleSweep("latin_hypercube", 5, 9, ("db", "f", "r", "k", "center_x", "center_y", "center_z")),
        ),
    ],
)
def test_sweeps(tmp_path: Path, plan: str, sweep: object) -> None:
    study = loaded(tmp_path, (SWEEP, f"sweep: {plan}"))
    assert study.sweep == sweep
    assert load_study(written(tmp_path, dump_yaml(study.resolved()))) == study


def test_labels_tell_the_options_that_differ_from_their_defaults(tmp_path: Path) -> None:
    entries = (
        "record:\n"
        "  - {metric: conditioning_share, threshold: 0.25, norm: 2}\n"
        "  - {metric: conditioning_share, threshold: 0.5, over: aspect, norm: frobenius}\n"
        "#"
    )
    first, second = loaded(tmp_path, ("record: ", entries)).problem.record
    assert first.label == "conditioning_share(threshold=0.25)"
    assert first.options["norm"] == second.metric.option("norm").default
    assert "threshold=0.5" in second.label
    assert "norm=frobenius" in second.label
    assert "over=aspect" in second.label


def test_bounds_carry_the_metrics_unit_in_the_studys_units(tmp_path: Path) -> None:
    entries = (
        "constraints:\n"
        "  - {metric: singularity_free_volume, home: [100, 200, 300], min: 5e6}\n"
        "  - {metric: actuator_range, max: 180}\n"
        "  - {metric: velocity_min, min: 2}\n"
    )
    volume, travel, velocity = loaded(tmp_path, ("constraints:\n", entries)).problem.constraints[:3]
    assert volume.minimum == pytest.approx(5e-3, rel=1e-15)
    assert volume.options["home"] == (0.1, 0.2, 0.3)
    assert travel.maximum == math.pi
    assert velocity.minimum == pytest.approx(2e-3 / math.radians(1), rel=1e-14)


def test_a_metric_over_the_aspect_needs_no_region(tmp_path: Path) -> None:
    text = (STUDIES[1]).read_text(encoding="utf-8")
    assert load_study(written(tmp_path, text)).problem.region is None
    with pytest.raises(StudyError, match="needs a region"):
        load_study(
            written(
                tmp_path, changed(("{metric: robot_size, over: aspect,", "{metric: robot_size,"), text=text)
            )
        )


def test_another_seed_or_budget_is_another_study(tmp_path: Path) -> None:
    study = loaded(tmp_path)
    other = study.searched_with(seed=7, budget=10)
    assert (other.optimizer.seed, other.optimizer.budget) == (7, 10)
    assert replace(other, optimizer=study.optimizer, resolved_json=study.resolved_json) == study
    assert load_study(written(tmp_path, dump_yaml(other.resolved()))) == other
    assert study.searched_with(seed=1) == study
    with pytest.raises(UsageError, match="budget"):
        study.searched_with(budget=0)
    with pytest.raises(UsageError, match="seed"):
        study.searched_with(seed=-1)


# -------------------------------------------------------------------------------------- bad studies

# (what is replaced, by what, text in the line that must be named, words of the message)
BAD = {
    "unknown key": (
        "accuracy:",
        "acuracy:",
        "acuracy:",
        ["unknown key 'acuracy'", "Did you mean 'accuracy'"],
    ),
    "unknown inner key": ("seed: 1,", "sed: 1,", "sed: 1", ["unknown key 'sed'", "'seed'"]),
    "missing key": ("version: 1\n", "", "name:", ["`version` is missing", "Add `version: 1`"]),
    "missing units": ("units: {length: mm, angle: deg}\n", "", "version", ["`units` is missing", "Add"]),
    "future version": ("version: 1", "version: 2", "version", ["version cannot be 2", "at most 1"]),
    "boolean version": ("version: 1", "version: true", "version", ["must be a whole number, not true"]),
    "unit": ("length: mm", "length: km", "units:", ["units.length cannot be 'km'", "Choose mm or cm"]),
    "text for number": ("dp: 60", "dp: 60 mm", "dp:", ["must be a number, not '60 mm'", "units"]),
    "quoted number": ("dp: 60", 'dp: "60"', "dp:", ["must be a number", "quotes"]),
    "boolean for number": ("dp: 60", "dp: true", "dp:", ["must be a number, not true", "Write"]),
    "nothing for number": ("dp: 60", "dp:", "dp:", ["must be a number, not nothing", "remove the key"]),
    "list for number": ("dp: 60", "dp: [1]", "dp:", ["must be a number, not a list", "Write"]),
    "mapping for list": ("size: [200, 200, 200]", "size: {x: 1}", "region:", ["must be a list", "Write"]),
    "two sizes": (
        "size: [200, 200, 200]",
        "size: [200, 200]",
        "region:",
        ["region.size has too few", "three"],
    ),
    "four sizes": ("size: [200, 200, 200]", "size: [1, 2, 3, 4]", "region:", ["too many", "Give 3"]),
    "number for mapping": (
        "units: {length: mm, angle: deg}",
        "units: 3",
        "units",
        ["must be a mapping", "Write"],
    ),
    "min over max": (
        "db: {min: 0, max: 400}",
        "db: {min: 500, max: 400}",
        "db:",
        ["min 500 is larger", "Swap"],
    ),
    "min is max": ("db: {min: 0, max: 400}", "db: {min: 4, max: 4}", "db:", ["both 4", "number alone"]),
    "no max": (
        "db: {min: 0, max: 400}",
        "db: {min: 0}",
        "db:",
        ["`max` is missing in mechanism.parameters.db"],
    ),
    "infinite": ("dp: 60", "dp: .inf", "dp:", ["finite", "ordinary number"]),
    "not a number": ("dp: 60", "dp: .nan", "dp:", ["finite", "ordinary number"]),
    "overflow": ("dp: 60", "dp: 1e999", "dp:", ["finite", "ordinary number"]),
    "a number of 5000 digits": ("dp: 60", "dp: " + "9" * 5000, "dp:", ["finite", "ordinary number"]),
    "far too large": ("dp: 60", "dp: 1e200", "dp:", ["out of bounds", "Stay within"]),
    "far too small": ("dp: 60", "dp: 1e-200", "dp:", ["out of bounds", "use 0"]),
    "infinite range": ("max: 400", "max: .inf", "db:", ["finite"]),
    "initial outside": ("max: 400", "max: 400, initial: 401", "db:", ["initial 401 is outside", "within"]),
    "negative length": ("dp: 60", "dp: -60", "dp:", ["dp cannot be -60", "0 or more"]),
    "zero link": ("f: {min: 150, max: 600}", "f: 0", "    f:", ["f cannot be 0", "greater than 0"]),
    "range from zero": ("f: {min: 150,", "f: {min: 0,", "    f:", ["f cannot be 0 … 600", "greater than 0"]),
    "zero gear ratio": (
        "values: [0.5, 1, 2]",
        "values: [0.5, 0, 2]",
        "    k:",
        ["k cannot be 0", "different from 0"],
    ),
    "gear range over zero": (
        "{values: [0.5, 1, 2]}",
        "{min: -1, max: 1}",
        "    k:",
        ["k cannot be -1 … 1", "contain 0"],
    ),
    "no values": ("values: [0.5, 1, 2]", "values: []", "    k:", ["too few", "at least 1"]),
    "same values": ("values: [0.5, 1, 2]", "values: [1, 1.0]", "    k:", ["twice", "Remove"]),
    "values and min": (
        "values: [0.5, 1, 2]",
        "values: [1], min: 1",
        "    k:",
        ["unknown key 'min'", "values"],
    ),
    "both f and f1": ("dp: 60", "dp: 60\n    f1: 300", "f1: 300", ["f sets all limbs", "Keep f"]),
    "one limb only": (
        "f: {min: 150, max: 600}",
        "f1: 3",
        "parameters:",
        ["uru needs the parameter f2 and f3", "Add `f2"],
    ),
    "parameter missing": ("    dp: 60\n", "", "parameters:", ["uru needs the parameter dp", "Add `dp"]),
    "unknown parameter": ("dp: 60", "dp: 60\n    dq: 3", "dq:", ["no parameter 'dq'", "Known: db"]),
    "unknown limit": (
        "limits: {}",
        "limits: {theta9: {min: 0, max: 1}}",
        "limits:",
        ["no limit 'theta9'", "Did you mean 'theta"],
    ),
    "limit is a range": (
        "limits: {}",
        "limits: {theta1: 4}",
        "limits:",
        ["theta1 is a range", "{min: …, max: …}"],
    ),
    "limit is a number": ("limits: {}", "limits: {link_radius: {min: 0, max: 1}}", "limits:", ["one number"]),
    "limit min over max": (
        "limits: {}",
        "limits: {theta1: {min: 1, max: 0}}",
        "limits:",
        ["min 1 is not below", "Swap"],
    ),
    "unknown mechanism": (
        "type: uru",
        "type: urru",
        "type: urru",
        ["no mechanism 'urru'", "Did you mean 'uru'"],
    ),
    "no mode": (f"  {MODE}", "  #", "mechanism:", ["no octant", "mode: best"]),
    "unknown mode word": (MODE, "mode: worst", "mode:", ["mechanism.mode cannot be 'worst'", "best"]),
    "unknown mode field": ("elbows:", "elbow:", "mode:", ["no mode field 'elbow'", "'elbows'"]),
    "short signs": ('elbows: "+++"', 'elbows: "++"', "mode:", ["elbows cannot be '++'", "3 signs"]),
    "wrong signs": ('elbows: "+++"', 'elbows: "+0+"', "mode:", ["elbows cannot be '+0+'", "3 signs"]),
    "any elbows": ('elbows: "+++"', "elbows: any", "mode:", ["elbows cannot be 'any'", "3 signs"]),
    "unknown region": ("type: box", "type: bax", "region:", ["region.type cannot be 'bax'", "box"]),
    "region without type": ("type: box, ", "", "region:", ["`type` is missing in region", "Add"]),
    "region as a word": (REGION, "region: box", "region:", ["region must be a mapping", "Write"]),
    "flat box": ("size: [200, 200, 200]", "size: [200, 0, 200]", "region:", ["cannot be 0", "more than 0"]),
    "no centre": (", center: free", "", "region:", ["`center` is missing", "free"]),
    "centre word": (
        "center: free",
        "center: middle",
        "region:",
        ["region.center cannot be 'middle'", "free"],
    ),
    "centre axis": ("center: free", "center: {x: 1, y: 2}", "region:", ["`z` is missing", "Add"]),
    "mirrored number": (
        "center: free",
        "center: {x: 1, y: 2, z: 3, mirrored: true}",
        "region:",
        ["needs ranges"],
    ),
    "points twice": (
        REGION,
        "region: {type: points, file: a, points: [[1, 2, 3]], center: free}",
        "region:",
        ["one place"],
    ),
    "no objective": (
        "  - {metric: total_link_length, sense: minimize}",
        "  []",
        "objectives:",
        ["too few", "at least 1"],
    ),
    "no sense": (", sense: minimize", "", "total_link_length", ["`sense` is missing", "maximize"]),
    "wrong sense": (
        "sense: minimize",
        "sense: least",
        "total_link_length",
        ["cannot be 'least'", "minimize"],
    ),
    "unknown metric": (
        "metric: coverage",
        "metric: covrage",
        "covrage",
        ["no metric 'covrage'", "'coverage'"],
    ),
    "unknown option": ("norm: 2", "nrm: 2", "nrm", ["no option 'nrm'", "'norm'"]),
    "option value": ("norm: 2", "norm: 3", "norm", ["norm cannot be 3", "frobenius"]),
    "option type": ("drive: motor", "drive: [1]", "drive", ["drive cannot be a list", "joint"]),
    "option missing": (
        "metric: coverage",
        "metric: conditioning_share",
        "_share",
        ["needs the option threshold", "Add"],
    ),
    "option number": (
        "metric: coverage",
        "metric: conditioning_share, threshold: yes",
        "_share",
        ["threshold cannot be 'yes'", "number"],
    ),
    "option infinite": (
        "metric: coverage",
        "metric: conditioning_share, threshold: .inf",
        "_share",
        ["threshold cannot be inf", "number"],
    ),
    "constraint without bound": (
        "metric: coverage, min: 1",
        "metric: coverage",
        "coverage",
        ["neither min nor max", "Add"],
    ),
    "constraint order": (
        "coverage, min: 1",
        "coverage, min: 1, max: 0",
        "coverage",
        ["min 1 is larger", "Swap"],
    ),
    "same label": (
        "label: gci",
        "label: coverage",
        "record:",
        ["two entries have the label 'coverage'", "label"],
    ),
    "same entry": (
        "  - {metric: coverage, min: 1}",
        "  - {metric: coverage, min: 1}\n" * 2,
        "coverage",
        ["two entries", "Give one of them a `label:`"],
    ),
    "label of a quantity": ("label: gci", "label: f", "record:", ["label 'f' is taken", "another"]),
    "label of signs": ("label: gci", 'label: "=1+1"', "record:", ["record[1].label cannot be", "Begin with"]),
    "unknown method": (
        "scipy.differential_evolution",
        "scipy.evolution",
        "optimizer:",
        ["no method", "Did you mean"],
    ),
    "global polish": (
        "polish: nlopt.cobyla",
        "polish: scipy.differential_evolution",
        "optimizer:",
        ["not a local"],
    ),
    "no budget": ("budget: 4000", "budget: 0", "optimizer:", ["optimizer.budget cannot be 0", "at least 1"]),
    "budget with exponent": ("budget: 4000", "budget: 4e3", "optimizer:", ["whole number", "exponent"]),
    "negative seed": ("seed: 1", "seed: -1", "optimizer:", ["optimizer.seed cannot be -1", "at least 0"]),
    "accuracy": (
        "volume: 1e-3",
        "volume: 0.5",
        "accuracy:",
        ["accuracy.volume cannot be 0.5", "at most 0.1"],
    ),
    "samples": (
        "volume: 1e-3",
        "region_samples: 2",
        "accuracy:",
        ["region_samples cannot be 2", "at least 3"],
    ),
    "impossible share": ("coverage, min: 1", "coverage, min: 95", "coverage", ["never above 1", "up to 1"]),
    "impossible conditioning": (
        "drive: motor, min: 0.3",
        "drive: motor, min: 3",
        "conditioning_min",
        ["never above 1", "min 3 cannot be met"],
    ),
    "tolerance name": ("{db: 0.1,", "{da: 0.1,", "certify:", ["no parameter 'da'", "Known: db"]),
    "tolerance sign": ("{db: 0.1,", "{db: -0.1,", "certify:", ["cannot be -0.1", "at least 0"]),
    "sweep type": ("type: grid", "type: gird", "sweep:", ["sweep.type cannot be 'gird'", "grid"]),
    "sweep name": ("{f: {num: 9},", "{g: {num: 9},", "sweep:", ["'g' is no quantity", "Known"]),
    "sweep of nothing free": ("{f: {num: 9},", "{dp: {num: 9},", "sweep:", ["dp has no range", "{min: …"]),
    "sweep of a list": ("{f: {num: 9},", "{k: {num: 9},", "sweep:", ["k has no range", "{values: […]}"]),
    "sweep domain": ("{f: {num: 9},", "{f: {values: [0]},", "sweep:", ["f cannot be 0", "greater than 0"]),
    "one step": ("{f: {num: 9},", "{f: {num: 1},", "sweep:", ["num cannot be 1", "at least 2"]),
    "huge grid": ("{num: 9}, r: {num: 9}", "{num: 9999}, r: {num: 9999}", "sweep:", ["more than", "fewer"]),
    "sample of fixed": (
        "{type: grid, parameters: {f: {num: 9}, r: {num: 9}}}",
        "{type: sobol, samples: 8, parameters: [dp]}",
        "sweep:",
        ["'dp' is not free", "range"],
    ),
    "name with path": ("name: uru-cube", "name: ../x", "name", ["name cannot be '../x'", "folder"]),
    "name with dot": ("name: uru-cube", "name: .hidden", "name", ["name cannot be", "letter or digit"]),
    "empty name": ("name: uru-cube", 'name: ""', "name", ["name cannot be", "letters"]),
    "long name": ("name: uru-cube", "name: " + "a" * 65, "name", ["name cannot be", "64"]),
    "number name": ("name: uru-cube", "name: 12", "name", ["must be a text, not 12", "quotes"]),
    "duplicate key": ("dp: 60", "dp: 60\n    dp: 61", "dp: 61", ["'dp' is there twice", "line 8"]),
    "number key": ("dp: 60", "7: 60", "7: 60", ["key must be a name, not '7'", "Write"]),
    "nothing key": ("dp: 60", "~: 60", "~: 60", ["key must be a name", "Write"]),
    "boolean key": ("dp: 60", "true: 60", "true: 60", ["key must be a name", "Write"]),
    "mapping key": ("dp: 60", "{a: 1}: 60", "{a: 1}", ["key must be a name", "Write"]),
    "list key": ("dp: 60", "? [a]\n    : 60", "? [a]", ["key must be a name", "Write"]),
    "anchor": ("dp: 60", "dp: &a 60", "dp:", ["anchors and aliases", "Write the value out"]),
    "alias": ("dp: 60", "dp: *a", "dp:", ["anchors and aliases", "Write the value out"]),
    "python tag": ("dp: 60", "dp: !!python/object/apply:os.getcwd []", "dp:", ["tags", "Remove"]),
    "harmless tag": ("dp: 60", "dp: !!float 60", "dp:", ["tags", "Remove"]),
    "tab": ("    dp: 60", "\tdp: 60", "\tdp", ["not valid YAML", "tabs"]),
    "open bracket": ("center: free}", "center: free", "objectives", ["not valid YAML", "brackets"]),
    "open quote": ("name: uru-cube", 'name: "uru', "  mode: {octant", ["not valid YAML", "quotes"]),
    "second document": ("region:", "---\nregion:", "---", ["second document", "one study"]),
    "old YAML": ("version: 1", "%YAML 1.1\n---\nversion: 1", "---", ["1.2", "Remove"]),
    "escape character": ("name: uru-cube", 'name: "\\e[31m"', "name", ["control characters", "plain line"]),
    "lone surrogate": ("name: uru-cube", 'name: "\\ud800"', "name", ["control characters", "plain line"]),
    "impossible escape": (
        "name: uru-cube",
        'name: "\\UFFFFFFFF"',
        "version: 1",
        ["not valid YAML", "escapes"],
    ),
    "control character": (
        "name: uru-cube",
        "name: uru\x07cube",
        "uru\x07",
        ["control character (U+0007)", "Remove"],
    ),
    "mark inside": (
        "name: uru-cube",
        "name: uru\ufeffcube",
        "name",
        ["control character (U+FEFF)", "Remove"],
    ),
    "long line": ("dp: 60", "dp: " + "6" * 100_001, "dp:", ["more than 100000 characters", "Break"]),
    "deep": ("dp: 60", "dp: " + "[" * 5000, "dp:", ["nested too deep", "brackets"]),
    "deep mappings": ("dp: 60", "dp: " + "{a: " * 5000, "dp:", ["nested too deep", "brackets"]),
}


@pytest.mark.parametrize("case", BAD.values(), ids=BAD.keys())
def test_each_fault_is_told_with_its_line_and_remedy(
    tmp_path: Path, case: tuple[str, str, str, list[str]]
) -> None:
    old, new, at, words = case
    text = changed((old, new))
    path = written(tmp_path, text)
    with pytest.raises(StudyError) as caught:
        load_study(path)
    error = caught.value
    lines = [number for number, line in enumerate(text.split("\n"), start=1) if at in line]
    assert error.where in {f"{path}:{line}" for line in lines}
    assert error.remedy
    assert error.exit_code == 2
    for word in words:
        assert word in error.message
    assert "pydantic" not in error.message
    assert len(error.message) < 5000


def test_a_metric_without_meaning_for_the_mechanism(tmp_path: Path) -> None:
    known = registries()
    limited = replace(known.metrics["coverage"], refusal=lambda kind, limits: f"none for {kind.name}")
    document = read_document(written(tmp_path, GOOD))
    with pytest.raises(StudyError, match="coverage has no meaning here: none for uru") as caught:
        resolve(document, parse(document), replace(known, metrics={**known.metrics, "coverage": limited}))
    assert caught.value.where == f"{document.path}:18"
    assert "total_link_length" in (caught.value.remedy or "")


def test_all_faults_are_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(StudyError) as caught:
        loaded(
            tmp_path,
            ("dp: 60", "dp: -60"),
            ("metric: coverage", "metric: covrage"),
            ("seed: 1", "seed: 1, x: 3"),
        )
    assert "unknown key 'x'" in caught.value.message  # a wrong form comes before wrong meanings
    with pytest.raises(StudyError) as caught:
        loaded(tmp_path, ("dp: 60", "dp: -60"), ("f: {min: 150", "f: {min: -5"), ("length: mm", "length: cm"))
    assert "study.yaml:8: dp cannot be -60" in caught.value.message
    assert "study.yaml:9: f cannot be -5 … 600" in caught.value.message


def test_thousands_of_faults_stay_readable(tmp_path: Path) -> None:
    with pytest.raises(StudyError) as caught:
        load_study(written(tmp_path, GOOD + "".join(f"key{i}: 1\n" for i in range(3000))))
    assert len(caught.value.message.splitlines()) < 20
    assert "more)" in caught.value.message


@pytest.mark.parametrize(
    ("content", "word", "remedy"),
    [
        (b"", "no study", "init"),
        (b"# only a comment\n", "no study", "init"),
        (b"\xef\xbb\xbf", "no study", "init"),
        (b"- 1\n- 2\n", "mapping", "version"),
        (b"just text", "mapping", "version"),
        (b"name: caf\xe9\n", "UTF-8", "Save"),
        (GOOD.encode("utf-16"), "UTF-8", "Save"),
        (b"a: \x00\n", "U+0000", "Remove"),
        (b"#" * 1_000_001, "1 MB", "Shorten"),
        (b"[" * 90_000, "too deep", "brackets"),
        (b"[\n" * 90_000, "too deep", "brackets"),
        (b"- " * 45_000, "too deep", "indentation"),
        (b"!" * 1000, "tags", "Remove"),
    ],
)
def test_files_that_are_no_studies(tmp_path: Path, content: bytes, word: str, remedy: str) -> None:
    path = written(tmp_path, content)
    with pytest.raises(StudyError) as caught:
        load_study(path)
    assert word in caught.value.what
    assert remedy in (caught.value.remedy or "")
    assert str(path) in (caught.value.where or "")


def test_places_that_hold_no_study(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"no such study file") as missing:
        load_study(tmp_path / "nothing.yaml")
    assert "nothing.yaml" in missing.value.message
    with pytest.raises(StudyError, match="a folder"):
        load_study(tmp_path)
    with pytest.raises(StudyError, match=r"^'a\\x00b': "):
        load_study("a\0b")
    with pytest.raises(StudyError):
        load_study(tmp_path / ("x" * 5000))
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        with pytest.raises(StudyError, match="not a regular file"):
            load_study(tmp_path / "pipe")


@pytest.mark.parametrize(
    "name", ["/etc/hostname", "../outside.csv", "sub/../../outside.csv", "link.csv", "C:\\x.csv"]
)
def test_points_stay_in_the_studys_folder(tmp_path: Path, name: str) -> None:
    (tmp_path / "outside.csv").write_text("1,2,3\n", encoding="utf-8")
    folder = tmp_path / "studies"
    folder.mkdir()
    (folder / "link.csv").symlink_to(tmp_path / "outside.csv")
    region = f"region: {{type: points, file: '{name}', center: free}}"
    with pytest.raises(StudyError, match=r"out(side)? of|outside") as caught:
        loaded(folder, (REGION, region))
    assert caught.value.where == f"{folder / 'study.yaml'}:14"
    assert "study" in (caught.value.remedy or "")


@pytest.mark.parametrize(
    ("content", "line", "word"),
    [
        ("1,2,3\n4,5\n", 2, "not a point"),
        ("x,y,z\n1,2,3\n1,2,nan\n", 3, "not a point"),
        ("1,2,inf\n", 1, "not a point"),
        ("1,2,1e999\n", 1, "not a point"),
        ("a,b,c\n1,2,3\n", 1, "not a point"),
        ("1,2,3\nx,y,z\n", 2, "not a point"),
        ("1;2;3\n", 1, "not a point"),
        ("\n\n", 1, "no points"),
    ],
)
def test_rows_that_are_no_points(tmp_path: Path, content: str, line: int, word: str) -> None:
    (tmp_path / "poses.csv").write_text(content, encoding="utf-8")
    with pytest.raises(StudyError) as caught:
        loaded(tmp_path, (REGION, "region: {type: points, file: poses.csv, center: free}"))
    assert caught.value.where == f"{tmp_path / 'poses.csv'}:{line}"
    assert word in caught.value.what
    assert caught.value.remedy


def test_points_files_that_are_not_there_or_no_text(tmp_path: Path) -> None:
    region = (REGION, "region: {type: points, file: poses.csv, center: free}")
    with pytest.raises(StudyError, match=r"poses\.csv: there is no such points file") as caught:
        loaded(tmp_path, region)
    assert caught.value.where == f"{tmp_path / 'study.yaml'}:14"
    (tmp_path / "poses.csv").write_bytes(b"\xff\xfe1")
    with pytest.raises(StudyError, match="UTF-8"):
        loaded(tmp_path, region)
    (tmp_path / "poses.csv").write_text("1,2,3\n" * 10_001, encoding="utf-8")
    with pytest.raises(StudyError, match="10001 points"):
        loaded(tmp_path, region)


# ---------------------------------------------------------------------------------------- fuzzing

LINES = GOOD.splitlines(keepends=True)
WORDS = [".inf", ".nan", "null", "true", "1e999", "-1", "0", "~", "free", "best", "f1", "{min: 1, max: 2}"]
MARKS = [
    "\n",
    "\t",
    "? ",
    "| ",
    "> ",
    "<<: ",
    "- ",
    ": ",
    "---\n",
    "&a ",
    "*a",
    "!!x ",
    *"{}[]\"'#%\\é\ufeff\x00",
]
PIECES = st.sampled_from([*WORDS, *MARKS])


@st.composite
def mutated(draw: st.DrawFn) -> bytes:
    lines = list(LINES)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(lines) - 1))
        kind = draw(st.sampled_from(["delete", "double", "swap", "insert", "cut", "bytes", "indent"]))
        if kind == "delete" and len(lines) > 1:
            del lines[at]
        elif kind == "double":
            lines.insert(at, lines[at])
        elif kind == "swap":
            other = draw(st.integers(0, len(lines) - 1))
            lines[at], lines[other] = lines[other], lines[at]
        elif kind == "indent":
            lines[at] = draw(st.sampled_from(["  ", " ", "\t"])) + lines[at]
        else:
            column = draw(st.integers(0, len(lines[at])))
            end = draw(st.integers(column, len(lines[at]))) if kind == "cut" else column
            piece = draw(st.text(max_size=8)) if kind == "bytes" else draw(PIECES)
            lines[at] = lines[at][:column] + piece + lines[at][end:]
    raw = bytearray("".join(lines).encode("utf-8", "surrogatepass"))
    if draw(st.booleans()) and draw(st.booleans()):
        raw[draw(st.integers(0, len(raw) - 1))] = draw(st.integers(0, 255))
    return bytes(raw)


@settings(
    max_examples=300,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(mutated())
@example(b"? - a\n: - b")
@example(b"a: |\n  \x85x")
@example(b"%TAG ! tag:x,2000:\n---\na: 1")
def test_whatever_the_text_it_is_a_study_or_a_clear_error(tmp_path: Path, text: bytes) -> None:
    path = written(tmp_path, text)
    try:
        study = load_study(path)
    except StudyError as error:
        assert error.where
        assert str(path) in error.where
        assert error.remedy
        assert error.message.isascii() or error.message.encode()  # can be printed
    else:
        assert load_study(written(tmp_path, dump_yaml(study.resolved()))) == study


DATA = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**18), 10**18)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(
        st.characters(exclude_categories=["Cc", "Cf", "Cs", "Zl", "Zp", "Zs", "Co", "Cn"]), max_size=30
    ),
    lambda inner: (
        st.lists(inner, max_size=5)
        | st.dictionaries(st.from_regex(r"\w{1,12}", fullmatch=True), inner, max_size=5)
    ),
    max_leaves=25,
)


def places(value: object) -> list[tuple[str | int, ...]]:
    """The way to every value inside plain data."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [(), *((key, *rest) for key, item in items for rest in places(item))]


@settings(
    max_examples=300,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.data())
def test_any_value_in_any_place_is_a_study_or_a_clear_error(tmp_path: Path, data: st.DataObject) -> None:
    study = load_study(STUDIES[0]).resolved()
    *way, last = data.draw(st.sampled_from(places(study)[1:]))
    inner = study
    for step in way:
        inner = inner[step]
    inner[last] = data.draw(DATA)
    try:
        load_study(written(tmp_path, dump_yaml(study)))
    except StudyError as error:
        assert error.remedy
        assert "study.yaml:" in error.message


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    st.dictionaries(
        st.sampled_from(["a", "b", "null", "x y", "1", "+-+", "true"]), DATA, min_size=1, max_size=4
    )
)
def test_written_yaml_reads_back_as_the_same_data(data: dict[str, object]) -> None:
    assert parse_document(dump_yaml(data), Path("x")).data == data


# ------------------------------------------------------------------------------------------ units


@pytest.mark.parametrize(
    ("units", "unit", "value", "si", "name"),
    [
        (Units("mm", "deg"), "m", 20, 0.02, "mm"),
        (Units("mm", "deg"), "m³", 1e9, 1.0, "mm³"),
        (Units("mm", "deg"), "rad", 180, math.pi, "deg"),
        (Units("mm", "deg"), "m/rad", 1, 1e-3 * 180 / math.pi, "mm/deg"),
        (Units("mm", "deg"), "-", 0.3, 0.3, "-"),
        (Units("mm", "deg"), "–", 0.3, 0.3, "-"),
        (Units("m", "rad"), "m³", 2, 2.0, "m³"),
        (Units("cm", "rad"), "m²", 1e4, 1.0, "cm²"),
        (Units("in", "deg"), "m", 1, 0.0254, "in"),
        (Units("in", "deg"), "m3", 1, 0.0254**3, "in³"),
        (Units("mm", "deg"), "1/m", 1, 1000.0, "1/mm"),
        (Units("mm", "deg"), "m·rad", 1, 1e-3 * math.pi / 180, "mm·deg"),
        (Units("mm", "deg"), "m^2/rad", 1, 1e-6 * 180 / math.pi, "mm²/deg"),
    ],
)
def test_units(units: Units, unit: str, value: float, si: float, name: str) -> None:
    assert units.to_si(value, unit) == pytest.approx(si, rel=1e-15)
    assert units.from_si(si, unit) == pytest.approx(value, rel=1e-15)
    assert units.name(unit) == name
    assert units.heading("q", unit) == f"q [{name}]"


@pytest.mark.parametrize("unit", ["kg", "m/s", "m//rad", "rad or m"])
def test_units_that_are_none(unit: str) -> None:
    with pytest.raises(ValueError, match="not a unit"):
        Units().to_si(1.0, unit)


def test_units_that_depend_on_the_motor() -> None:
    assert unit_for("rad or m", "rad") == "rad"
    assert unit_for("rad or m", "m") == "m"
    assert unit_for("m/rad or -", "rad") == "m/rad"
    assert unit_for("m/rad or -", "m") == "-"
    assert unit_for("m", "rad") == "m"


@settings(deadline=None, derandomize=True)
@given(
    st.decimals(-(10**9), 10**9, places=4).map(float),
    st.sampled_from(["mm", "cm", "m", "in"]),
    st.sampled_from(["deg", "rad"]),
    st.sampled_from(["m", "m³", "rad", "m/rad", "-"]),
)
def test_what_is_written_comes_back_as_written(value: float, length: str, angle: str, unit: str) -> None:
    units = Units(length, angle)  # type: ignore[arg-type]
    assert units.from_si(units.to_si(value, unit), unit) == value


# ---------------------------------------------------------------------------------- one design


def test_free_quantities_take_initial_middle_or_first(tmp_path: Path) -> None:
    study = loaded(tmp_path, ("r: {min: 150, max: 600}", "r: {min: 150, max: 600, initial: 200}"))
    design, assumptions = choose_design(study, {})
    assert design == {
        "db": 0.2,
        "dp": 0.06,
        "f": 0.375,
        "r": 0.2,
        "k": 0.5,
        "center_x": 0.77,
        "center_y": 0.77,
        "center_z": 0.77,
        "mode": "+++ +++",
    }
    assert assumptions[:4] == (
        "db = 200 mm (the middle of its range)",
        "f = 375 mm (the middle of its range)",
        "r = 200 mm (its initial value)",
        "k = 0.5 (the first one listed)",
    )


def test_settings_win_and_are_not_assumed(tmp_path: Path) -> None:
    study = loaded(tmp_path, (MODE, "mode: best"))
    label = list(study.problem.modes)[-1]
    # f beyond its range, dp although fixed: both are the caller's to choose
    design, assumptions = choose_design(study, {"f": "1e3", "dp": " 0 ", "mode": label, "center_x": "5"})
    assert (design["f"], design["dp"], design["mode"]) == (1.0, 0.0, label)
    assert {line.split(" = ")[0] for line in assumptions} == {"db", "r", "k", "center_y", "center_z"}


@pytest.mark.parametrize(
    ("settings_", "word", "remedy"),
    [
        ({"g": "1"}, "no quantity 'g'", "Known"),
        ({"center": "1"}, "no quantity 'center'", "center_"),
        ({"f1": "1"}, "no quantity 'f1'", "Set f"),
        ({"f": "0"}, "f cannot be 0", "another"),
        ({"f": "-1"}, "f cannot be -1", "another"),
        ({"k": "0"}, "k cannot be 0", "another"),
        ({"f": "ten"}, "must be a number", "f=…"),
        ({"f": "10 mm"}, "must be a number", "unit"),
        ({"f": "nan"}, "must be a number", "f=…"),
        ({"f": ".inf"}, "must be a number", "f=…"),
        ({"f": ""}, "must be a number", "f=…"),
        ({"mode": "+++ ++0"}, "mode cannot be '+++ ++0'", "another"),
    ],
)
def test_settings_that_cannot_be(tmp_path: Path, settings_: dict[str, str], word: str, remedy: str) -> None:
    with pytest.raises(UsageError) as caught:
        choose_design(loaded(tmp_path), settings_)
    assert word in caught.value.message
    assert remedy in caught.value.message


def test_a_study_without_free_quantities_is_one_design(tmp_path: Path) -> None:
    study = loaded(
        tmp_path,
        ("db: {min: 0, max: 400}", "db: 100"),
        ("f: {min: 150, max: 600}", "f: 300"),
        ("r: {min: 150, max: 600}", "r: 300"),
        ("k: {values: [0.5, 1, 2]}", "k: -1"),
        ("center: free", "center: [200, 200, 200]"),
        (SWEEP, ""),
    )
    assert study.problem.variables == ()
    assert choose_design(study, {}) == (dict(study.problem.fixed), ())


# ---------------------------------------------------------------------------- schema and template


def test_the_schema_knows_the_names_and_the_studies(tmp_path: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = study_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    for path in STUDIES:
        for study in studies_in(path):
            assert list(validator.iter_errors(study.resolved())) == []
        assert list(validator.iter_errors(read_document(path).data)) == []
    good = load_study(STUDIES[0]).resolved()
    for section, key, wrong in [
        ("mechanism", "type", "urru"),
        ("optimizer", "method", "scipy.none"),
        ("optimizer", "polish", "scipy.differential_evolution"),
        ("units", "length", "km"),
        ("region", "type", "bax"),
    ]:
        assert not validator.is_valid({**good, section: {**good[section], key: wrong}})
    for wrong_entry in [
        {"metric": "covrage", "min": 1},
        {"metric": "coverage", "norm": 2},
        {"metric": "coverage", "x": 1},
    ]:
        assert not validator.is_valid({**good, "constraints": [wrong_entry]})
    assert not validator.is_valid({**good, "extra": 1})
    assert not validator.is_valid(
        {
            **good,
            "mechanism": {**good["mechanism"], "parameters": {**good["mechanism"]["parameters"], "dq": 1}},
        }
    )


@pytest.mark.parametrize("kind", MECHANISMS.values(), ids=MECHANISMS.keys())
@pytest.mark.parametrize("name", ["hello", "1e3", "null", "true", "0x10", "12"])
def test_the_template_is_a_study(tmp_path: Path, kind, name: str) -> None:  # type: ignore[no-untyped-def]
    study = load_study(written(tmp_path, template(name, kind)))
    assert study.name == name
    assert study.problem.kind is kind
    assert study.problem.variables
    design, _ = choose_design(study, {})
    parameters = {key: value for key, value in design.items() if kind.parameter(key)}
    assert parameters == pytest.approx(dict(kind.example))
    kind.build(parameters, study.problem.limits)


@pytest.mark.parametrize("name", ["", "../x", "a b", "a\n", "x" * 65])
def test_a_template_needs_a_name(name: str) -> None:
    with pytest.raises(UsageError, match="name"):
        template(name, next(iter(MECHANISMS.values())))
