"""Reports: the figures show what is true of the design, the text holds every number with its unit."""

from __future__ import annotations

import math
import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from tpm_design.errors import UsageError
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.mechanisms import mechanism_kind
from tpm_design.metrics.context import Context
from tpm_design.problem import Goal
from tpm_design.report import write_report
from tpm_design.report.aspect import choose_aspect, middle_of
from tpm_design.report.escape import code, code_cell, table, text
from tpm_design.report.figures import DRAWING, pictures
from tpm_design.report.history import history
from tpm_design.report.readings import readings
from tpm_design.report.reported import best_context, read_reported
from tpm_design.report.slices import (
    Plane,
    Slice,
    Window,
    planes_through,
    region_middle,
    region_outline,
    slice_fields,
    window,
    zero_lines,
)
from tpm_design.report.survey import conditioning_shown, survey
from tpm_design.runs.entry import Entry
from tpm_design.runs.folder import DESIGNS, LOG, SUMMARY, TABLE, RunWriter
from tpm_design.runs.tables import goal_unit
from tpm_design.study import Study, choose_design, dump_yaml, load_study
from tpm_design.workspace.indices import CONDITION_2, CONDITION_FROBENIUS, Index
from tpm_design.workspace.region_geometry import place
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Points, Sphere

STUDIES = Path(__file__).parents[1] / "studies"
HOSTILE = "www.worst.org (1/kappa), _least_"
QUICK = f"""
version: 1
name: quick_one_
units: {{length: mm, angle: deg}}
mechanism:
  type: uru
  parameters: {{db: 250, dp: 60, f: {{min: 220, max: 420}}, r: {{min: 200, max: 420}}, k: 1}}
  mode: {{octant: "+++", elbows: "+++"}}
region: {{type: box, size: [120, 120, 120], center: {{x: {{min: 100, max: 260}}, y: 190, z: 190}}}}
objectives:
  - {{metric: total_link_length, sense: minimize}}
constraints:
  - {{metric: coverage, min: 1}}
  - {{metric: conditioning_min, min: 0.2, norm: frobenius, drive: joint, label: "{HOSTILE}"}}
  - {{metric: actuation_singularity_distance, min: 20}}
  - {{metric: robot_size, max: 700}}
record: [{{metric: conditioning_mean, label: gci}}, {{metric: reachable_volume}}]
optimizer: {{method: scipy.differential_evolution, budget: 60, seed: 1, polish: nlopt.cobyla}}
"""
BALL_RADIUS = 1.0  # of f = r = 0.5 m and db = dp


def study_in(folder: Path, source: str = QUICK) -> Study:
    path = folder / "input.yaml"
    path.write_text(source, encoding="utf-8")
    return load_study(path)


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A real optimisation that ends with a feasible design, and its report."""
    folder = tmp_path_factory.mktemp("quick")
    run = study_in(folder).optimize(output=folder / "results")
    assert run.folder is not None
    write_report(run.folder)
    return run.folder


def logged(folder: Path, study: Study, *changes: dict[str, float | str]) -> Path:
    """A run that was cut short after evaluating the study's own design with each of the changes."""
    folder.mkdir()
    writer = RunWriter(folder, study.problem, study.units, dump_yaml(study.resolved()))
    design, _ = choose_design(study, {})
    for number, change in enumerate(changes):
        writer.record(Entry(number, evaluate(study.problem, {**design, **change})))
    return folder


def report_of(folder: Path) -> str:
    write_report(folder)
    return (folder / "report.md").read_text(encoding="utf-8")


def png_size(path: Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", data[16:24])


def rows_of(markdown: str) -> dict[str, list[str]]:
    """Cells of every table row by its first cell."""
    lines = [line.strip("| ").split(" | ") for line in markdown.splitlines() if line.startswith("| ")]
    return {line[0]: line for line in lines}


# ------------------------------------------------------------------------------------- files and text


def test_the_report_and_its_figures_are_written(run_folder: Path) -> None:
    paths = write_report(run_folder)
    names = ["mechanism.png", "workspace.png", "conditioning.png", "constraints.png", "convergence.png"]
    assert paths == (run_folder / "report.md", *(run_folder / "figures" / name for name in names))
    markdown = paths[0].read_text(encoding="utf-8")
    for path in paths[1:]:
        width, height = png_size(path)
        assert 900 <= width <= 2400
        assert 400 <= height <= 1500
        assert f"(figures/{path.name})" in markdown


def test_the_design_is_drawn_with_its_own_dimensions_after_its_table(run_folder: Path) -> None:
    reported = read_reported(run_folder)
    assert reported.best is not None
    (picture,) = (found for found in pictures(reported) if found.file == DRAWING)
    words = " ".join(text.get_text() for text in picture.figure.axes[0].texts)
    for name, symbol in (("f", "f_{1}"), ("r", "r_{1}")):
        value = reported.study.units.written(float(reported.best.evaluation.design[name]), "m", 4)
        assert f"${symbol}$$\\mathrm{{\\,=\\,{value.replace(' ', chr(92) + ' ')}}}$" in words
    markdown = (run_folder / "report.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.*)$", markdown, re.MULTILINE)
    assert headings[headings.index("Mechanism") - 1].startswith("Best design")
    assert "*LaMaViP 3-URU in the middle of the useful region.*" in markdown


def test_two_reports_of_a_run_are_the_same_bytes(run_folder: Path) -> None:
    first = [path.read_bytes() for path in write_report(run_folder)]
    assert [path.read_bytes() for path in write_report(run_folder)] == first


def test_every_goal_stands_in_the_table_with_value_error_and_unit(run_folder: Path) -> None:
    reported = read_reported(run_folder)
    problem, units = reported.problem, reported.study.units
    rows = rows_of((run_folder / "report.md").read_text(encoding="utf-8"))
    assert reported.best is not None
    evaluation = reported.best.evaluation
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    assert len(goals) == 7
    for goal in goals:
        _, value, error, unit, asked, slack, met = rows[f"`{goal.label}`"]
        si = goal_unit(problem, goal)
        assert math.isclose(float(value), units.from_si(evaluation.metrics[goal.label], si), rel_tol=1e-5)
        assert math.isclose(
            float(error), units.from_si(evaluation.errors[goal.label], si), rel_tol=0.06, abs_tol=1e-12
        )
        assert unit == units.name(si).replace("-", "–")
        constrained = goal in problem.constraints
        assert met == ("yes" if constrained else "–")
        if constrained:
            assert math.isclose(float(slack), units.from_si(evaluation.slacks[goal.label], si), rel_tol=6e-3)
            assert ("≥" in asked) == (goal.minimum is not None)
    assert rows["`reachable_volume`"][3] == "mm³"
    assert rows["`robot_size`"][4] == "≤ 700 mm"
    assert rows["`total_link_length`"][4] == "minimise"


def test_every_parameter_stands_in_the_table_with_its_range(run_folder: Path) -> None:
    reported = read_reported(run_folder)
    assert reported.best is not None
    rows = rows_of((run_folder / "report.md").read_text(encoding="utf-8"))
    _, value, unit, searched, meaning = rows["`f`"]
    assert math.isclose(float(value) / 1000.0, float(reported.best.evaluation.design["f"]), rel_tol=1e-5)
    assert (unit, searched) == ("mm", "220 … 420 mm")
    assert "proximal link" in meaning
    assert rows["`db`"][1:4] == ["250", "mm", "fixed"]
    assert rows["`k`"][1:4] == ["1", "–", "fixed"]


def test_status_method_versions_caveats_and_files_are_stated(run_folder: Path) -> None:
    reported = read_reported(run_folder)
    markdown = (run_folder / "report.md").read_text(encoding="utf-8")
    assert markdown.startswith("# quick\\_one\\_: LaMaViP 3-URU\n")
    assert text(str(reported.run.summary["status"])) in markdown
    assert "`scipy.differential_evolution`, polished by `nlopt.cobyla`" in markdown
    assert "seed 1, budget 60 evaluations" in markdown
    assert f"numpy {np.__version__}" in markdown
    assert "not proved" in markdown
    for name in (DESIGNS, TABLE, LOG, SUMMARY):
        assert f"[{name}]({name})" in markdown


def test_names_from_the_study_stay_names(run_folder: Path) -> None:
    tokens = MarkdownIt("commonmark").enable("table").parse((run_folder / "report.md").read_text("utf-8"))
    inline = [child for token in tokens if token.children for child in token.children]
    assert [t.attrGet("href") for t in inline if t.type == "link_open"] == [
        DESIGNS, TABLE, LOG, "study.yaml", SUMMARY,
    ]  # fmt: skip
    assert sum(t.type == "code_inline" and t.content == HOSTILE for t in inline) >= 2
    assert not any(token.type.startswith("html") for token in [*tokens, *inline])
    emphasis = [inline[place + 1].content for place, t in enumerate(inline) if t.type == "em_open"]
    assert len(emphasis) == 5  # what the figures show
    assert "least" not in emphasis
    assert next(t for t in tokens if t.type == "inline").children[0].content.startswith("quick")


def test_a_run_without_a_feasible_design_says_what_is_missing(tmp_path: Path) -> None:
    study = load_study(STUDIES / "01-uru-cube.yaml")
    run = study.optimize(budget=12, output=tmp_path)
    assert run.folder is not None and run.best is not None
    assert run.best.status == "infeasible"
    markdown = report_of(run.folder)
    assert "## Closest design, not feasible" in markdown
    missing = markdown.split("## What is missing")[1].split("##")[0]
    for goal in study.problem.constraints:
        assert (f"`{goal.label}`" in missing) == (run.best.slacks[goal.label] < 0.0)
    assert f"violation of {run.best.violation:.3g}" in missing
    assert (run.folder / "figures" / "convergence.png").is_file()


def test_a_run_that_was_cut_short_is_reported_from_its_log(run_folder: Path, tmp_path: Path) -> None:
    whole = read_reported(run_folder)
    folder = tmp_path / "cut"
    folder.mkdir()
    (folder / "study.yaml").write_bytes((run_folder / "study.yaml").read_bytes())
    (folder / LOG).write_bytes((run_folder / LOG).read_bytes() + b'{"id":60,"desi')
    assert read_reported(folder).best == whole.best
    markdown = report_of(folder)
    assert "The run was cut short: run.json is missing." in markdown
    assert "the wall time is not known" in markdown
    assert f"]({DESIGNS})" not in markdown


def test_a_study_without_a_region_is_reported(tmp_path: Path) -> None:
    study = load_study(STUDIES / "02-uru-volume.yaml")
    folder = logged(tmp_path / "run", study, {"f": 0.3, "r": 0.3, "db": 0.1})
    markdown = report_of(folder)
    assert "no useful region" in markdown
    reported = read_reported(folder)
    context = best_context(reported)
    assert context is not None and reported.best is not None
    view = survey(context, study.problem)
    assert view is not None and view.volumes is not None
    # the headline's volume is the metric's, and the planes go through a pose of the aspect itself
    assert view.volumes[0] == reported.best.evaluation.metrics["singularity_free_volume"]
    assert view.aspect is not None
    middle = middle_of(context, view.aspect)
    assert np.allclose(middle, middle[0], rtol=1e-9)  # on the octant's diagonal, by symmetry
    assert all((view.aspect is not None) and (part.aspect > 0.0).any() for part in view.slices)


def test_designs_that_cannot_be_built_are_reported(tmp_path: Path) -> None:
    folder = logged(tmp_path / "run", study_in(tmp_path), {"f": -1.0}, {"f": -2.0})
    markdown = report_of(folder)
    assert "could not be evaluated" in markdown
    assert "2 evaluations: 0 feasible, 2 failed" in markdown
    assert not list((folder / "figures").iterdir())


def test_constraints_without_a_value_are_reported(tmp_path: Path) -> None:
    source = QUICK.split("constraints:", maxsplit=1)[0].replace("y: 190, z: 190", "y: 2000, z: 2000")
    study = study_in(tmp_path, source + "constraints: [{metric: robot_size, max: 700}]")
    markdown = report_of(logged(tmp_path / "run", study, {}))
    assert rows_of(markdown)["`robot_size`"][1:] == ["–", "–", "mm", "≤ 700 mm", "–", "**no**"]
    assert "- `robot_size` ≤ 700 mm: it has no value" in markdown
    assert "The region is not wholly within reach" in markdown


def test_a_choice_of_modes_is_reported(tmp_path: Path) -> None:
    source = QUICK.replace('{octant: "+++", elbows: "+++"}', "best")
    markdown = report_of(logged(tmp_path / "run", study_in(tmp_path, source), {}))
    _, value, _, searched, _ = rows_of(markdown)["`mode`"]
    assert (value, searched) == ("`+++ +++`", "one of 64")
    assert "Working mode (octant, elbows): any of 64." in markdown


def test_an_empty_log_is_reported(tmp_path: Path) -> None:
    markdown = report_of(logged(tmp_path / "run", study_in(tmp_path)))
    assert "No design was evaluated" in markdown


def test_what_is_no_run_or_cannot_be_written_gives_a_message(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="not a run folder"):
        write_report(tmp_path)
    folder = logged(tmp_path / "run", study_in(tmp_path))
    (folder / "figures").write_text("in the way", encoding="utf-8")
    with pytest.raises(UsageError, match="cannot be written"):
        write_report(folder)


# ------------------------------------------------------------------------------------- escaping

ROUGH = st.text(st.sampled_from("ab1. -+=\\`*_[]<>()|~&$#!:/\n\t;lt"), max_size=24)


def one_line(words: str) -> str:
    return " ".join(words.split())


@given(ROUGH)
def test_escaped_text_is_read_back_as_the_same_words(words: str) -> None:
    tokens = MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(text(words))
    expected = one_line(words)
    if not expected:
        assert tokens == []
        return
    assert [t.type for t in tokens] == ["paragraph_open", "inline", "paragraph_close"]
    children = tokens[1].children or []
    assert {child.type for child in children} <= {"text", "text_special"}
    assert "".join(child.content for child in children) == expected


@given(ROUGH)
def test_names_in_code_are_read_back_as_the_same_names(name: str) -> None:
    tokens = MarkdownIt("commonmark").parse(code(name))
    expected = one_line(name)
    if not expected:
        assert tokens == []
        return
    (child,) = tokens[1].children or []
    assert (child.type, child.content) == ("code_inline", expected)


@given(ROUGH, ROUGH)
def test_names_do_not_break_tables(name: str, words: str) -> None:
    lines = table(["name", "words"], [[code_cell(name), text(words)]])
    tokens = MarkdownIt("commonmark").enable("table").parse("\n".join(lines))
    cells = [tokens[i + 1] for i, token in enumerate(tokens) if token.type == "td_open"]
    assert len(cells) == 2
    assert "".join(child.content for child in cells[0].children or []) == one_line(name)
    assert "".join(child.content for child in cells[1].children or []) == one_line(words)


def test_addresses_are_not_made_links() -> None:
    assert text("see http://a.org, www.b.org") == "see http\\://a.org, www\\.b.org"


# ------------------------------------------------------------------------------------- the search


def test_the_history_is_that_of_the_log(run_folder: Path) -> None:
    reported = read_reported(run_folder)
    course = history(reported.problem, reported.run.entries)
    feasible = [e for e in reported.run.entries if e.evaluation.status == "feasible"]
    lengths = [e.evaluation.metrics["total_link_length"] for e in feasible]
    assert len(course.numbers) == 60
    assert course.first_feasible == feasible[0].number
    assert course.best[-1] == min(lengths)
    known = course.best[np.isfinite(course.best)]
    assert len(known) == 60 - feasible[0].number
    assert (np.diff(known) <= 0.0).all()
    assert (np.diff(course.closest) <= 0.0).all()
    assert course.closest[-1] == 0.0


def test_a_quantity_to_be_large_grows_in_the_history(tmp_path: Path) -> None:
    study = load_study(STUDIES / "02-uru-volume.yaml")
    problem = replace(study.problem, constraints=())
    design, _ = choose_design(study, {})
    entries = tuple(
        Entry(number, evaluate(problem, {**design, "f": f})) for number, f in enumerate((0.2, 0.4, 0.3))
    )
    course = history(problem, entries)
    assert course.best[0] < course.best[1] == course.best[2]


def test_readings_measure_room_against_the_nearer_bound(run_folder: Path) -> None:
    reported = read_reported(run_folder)
    assert reported.best is not None
    found = {r.goal.label: r for r in readings(reported.problem, reported.best.evaluation)}
    size = found["robot_size"]
    assert not size.above and size.met and not size.binding
    assert math.isclose(size.share, (0.7 - size.value - size.error) / 0.7)
    distance = found["actuation_singularity_distance"]
    assert distance.above
    assert math.isclose(distance.share, (distance.value - distance.error - 0.02) / 0.02)


@pytest.mark.parametrize(
    ("lower", "upper", "above", "binding", "met"),
    [
        (None, 1.39, False, False, True),
        (1.3, 1.36, False, False, True),
        (1.3495, 1.5, True, True, True),
        (1.4, 1.5, True, False, False),
    ],
)
def test_two_bounds(
    tmp_path: Path, lower: float | None, upper: float, above: bool, binding: bool, met: bool
) -> None:
    study = study_in(tmp_path)
    length = study.problem.objectives[0]
    goal = Goal(length.metric, "length", minimum=lower, maximum=upper)
    problem = replace(study.problem, constraints=(goal,), record=())
    design, _ = choose_design(study, {})
    evaluation = evaluate(problem, {**design, "f": 0.25, "r": 0.2})  # 3 · 0.45 m
    (reading,) = readings(problem, evaluation)
    assert math.isclose(reading.value, 1.35)
    assert (reading.above, reading.binding, reading.met) == (above, binding, met)


# ------------------------------------------------------------------------------------- the slices


def design(octant: str, elbows: str, **parameters: float) -> Context:
    mechanism = mechanism_kind("uru").build(parameters, {})
    mode = mechanism.mode_of({"octant": octant, "elbows": elbows})
    return Context(mechanism, mode, None, volume_rtol=1e-3, region_samples=9)


def ball(octant: str) -> Context:
    """f = r and db = dp: a ball of reach, in octant +++ with equal elbows without a singularity inside."""
    return design(octant, "+++", db=0.2, dp=0.2, f=0.5, r=0.5, k=1.0)


def slices_of(context: Context, pose: tuple[float, float, float], nodes: int) -> list[Slice]:
    planes = planes_through(pose)
    extent = window(context, planes)
    aspect = choose_aspect(context, None)
    return [slice_fields(context, plane, extent, aspect, Index(CONDITION_2), nodes) for plane in planes]


@pytest.mark.parametrize("height", [0.0, 0.3, 0.8])
def test_the_reach_of_the_ball_is_outlined_by_circles(height: float) -> None:
    for part in slices_of(ball("any"), (height, height, height), 200):
        (outline,) = part.reach_outline()
        assert np.allclose(outline[0], outline[-1])
        radii = np.linalg.norm(outline, axis=1)
        assert np.allclose(radii, math.sqrt(BALL_RADIUS**2 - height**2), rtol=1e-4)
        angles = np.sort(np.arctan2(outline[:, 1], outline[:, 0]))
        assert np.diff(angles).max() < 0.1  # all the way round


@pytest.mark.parametrize("octant", ["any", "+++", "-++", "-+-"])
def test_rotation_singularities_are_drawn_on_the_coordinate_planes(octant: str) -> None:
    signs = np.array([-1.0 if sign == "-" else 1.0 for sign in octant]) if octant != "any" else np.ones(3)
    pose = 0.25 * signs
    reach = math.sqrt(BALL_RADIUS**2 - 0.25**2)
    for part in slices_of(ball(octant), (pose[0], pose[1], pose[2]), 200):
        lines = part.determinant_lines(2)
        points = np.vstack(lines)
        off = np.abs(points).min(axis=1)
        assert off.max() < 1e-12
        farthest = np.abs(points).max(axis=0)
        cell = part.across[1] - part.across[0]
        assert (farthest <= reach + 1e-12).all()
        assert (farthest > reach - 2.0 * cell).all()  # both axes, out to the edge of reach


def test_the_outline_of_one_octant_follows_its_planes_and_the_sphere() -> None:
    for part in slices_of(ball("+++"), (0.3, 0.3, 0.3), 200):
        (outline,) = part.reach_outline()
        radii = np.linalg.norm(outline, axis=1)
        on_sphere = np.abs(radii - math.sqrt(BALL_RADIUS**2 - 0.09)) < 1e-4
        on_plane = np.abs(outline).min(axis=1) < 1e-12
        corner = radii > 0.9  # where the two meet, a cell is cut off
        assert (on_sphere | on_plane | corner).all()
        assert on_sphere.sum() > 50 and on_plane.sum() > 50


def test_the_aspect_of_the_ball_is_its_whole_octant() -> None:
    for part in slices_of(ball("any"), (0.3, 0.3, 0.3), 160):
        inside = part.aspect > 0.0
        u, v = np.meshgrid(part.across, part.up)
        assert (inside == ((u > 0.0) & (v > 0.0) & (part.reach > 0.0))).all()


@pytest.mark.parametrize("elbows", ["-++", "--+", "---"])
def test_an_aspect_does_not_go_on_beyond_the_planes_of_its_octant(elbows: str) -> None:
    # determinants have equal signs in several octants of this design
    context = design("any", elbows, db=0.1, dp=0.3, f=0.5, r=0.5, k=-1.0)
    aspect = choose_aspect(context, None)
    assert aspect is not None
    x, y, z = middle_of(context, aspect)
    for part in slices_of(context, (x, y, z), 120):
        inside = part.plane.poses(part.across, part.up)[(part.aspect > 0.0).ravel()]
        assert len(inside) > 500
        assert (inside * np.array([x, y, z]) > 0.0).all()


def test_the_shown_aspect_is_free_of_singularities_and_holds_the_region(run_folder: Path) -> None:
    reported = read_reported(run_folder)
    context = best_context(reported)
    assert context is not None and context.region is not None
    view = survey(context, reported.problem)
    assert view is not None
    for part in view.slices:
        inside = part.aspect > 0.0
        for determinant in part.determinants:
            assert len(np.unique(np.sign(determinant[inside]))) == 1
        assert (part.reach[inside] > 0.0).all()
        u, v = np.meshgrid(part.across, part.up)
        low = region_outline(context.region, part.plane).min(axis=0)
        high = region_outline(context.region, part.plane).max(axis=0)
        assert inside[(u >= low[0]) & (u <= high[0]) & (v >= low[1]) & (v <= high[1])].all()


def test_determinants_vanish_on_their_lines(run_folder: Path) -> None:
    context = best_context(read_reported(run_folder))
    assert context is not None and context.region is not None
    seen = 0
    for plane in planes_through(context.region.centre):
        extent = window(context, [plane])
        part = slice_fields(context, plane, extent, None, Index(CONDITION_2), 300)
        for line in part.determinant_lines(0):
            poses = np.empty((len(line), 3))
            poses[:, [plane.across, plane.up]] = line
            poses[:, plane.normal] = plane.height
            values = context.mechanism.determinants(poses, context.mode)[0]
            assert np.median(np.abs(values)) < 1e-3
            seen += len(line)
    assert seen > 100


def test_the_conditioning_shown_is_the_one_the_study_asks_for(run_folder: Path) -> None:
    reported = read_reported(run_folder)
    context = best_context(reported)
    assert context is not None
    shown = conditioning_shown(reported.problem)
    assert (shown.norm, shown.drive, shown.bound) == ("frobenius", "joint", 0.2)
    assert shown.index(context) == Index(CONDITION_FROBENIUS, motor=0.0)
    view = survey(context, reported.problem)
    assert view is not None
    part = view.slices[0]
    poses = part.plane.poses(part.across, part.up)[::997]
    jacobians = context.mechanism.jacobian(poses, context.mode, drive="joint")
    known = ~np.isnan(jacobians).any(axis=(1, 2))
    expected = [3.0 / (np.linalg.norm(j) * np.linalg.norm(np.linalg.inv(j))) for j in jacobians[known]]
    assert known.sum() > 40
    assert np.allclose(part.conditioning.ravel()[::997][known], expected, atol=1e-9)


def test_the_conditioning_of_a_study_that_names_none_is_the_2_norm_of_the_motors(tmp_path: Path) -> None:
    problem = replace(study_in(tmp_path).problem, constraints=(), record=())
    shown = conditioning_shown(problem)
    assert (shown.norm, shown.drive, shown.bound) == ("2", "motor", None)
    assert shown.name == "1/κ (2-norm, motor drive)"


def test_the_headline_names_the_nearest_limit(run_folder: Path) -> None:
    reported = read_reported(run_folder)
    context = best_context(reported)
    assert context is not None and reported.best is not None
    view = survey(context, reported.problem)
    assert view is not None and view.nearest is not None
    assert view.nearest.distance <= reported.best.evaluation.metrics["actuation_singularity_distance"]
    assert view.size == reported.best.evaluation.metrics["robot_size"]
    distance = reported.study.units.written(view.nearest.distance, "m", 3)
    assert f"keeps {distance} from the nearest limit, a {view.nearest.name}" in view.headline(
        reported.study.units
    )


@pytest.mark.parametrize(
    "shape",
    [Box((0.3, 0.2, 0.1)), Cylinder(0.2, 0.5), Sphere(0.2), Ellipsoid((0.3, 0.2, 0.1))],
    ids=lambda shape: type(shape).__name__,
)
def test_region_outlines_lie_on_the_regions_surface(shape: Box | Cylinder | Sphere | Ellipsoid) -> None:
    region = place(shape, (0.5, -0.4, 0.3))
    for plane in planes_through(region_middle(region).tolist()):
        outline = region_outline(region, plane)
        assert np.allclose(outline[0], outline[-1])
        axes = [plane.across, plane.up]
        assert np.allclose(np.ptp(outline, axis=0), 2.0 * np.asarray(region.half)[axes])
        poses = np.empty((len(outline), 3))
        poses[:, axes], poses[:, plane.normal] = outline, plane.height
        scaled = np.abs((poses - np.asarray(region.centre)) / np.asarray(region.half))
        across = np.hypot(scaled[:, 0], scaled[:, 1])
        gauge = {
            Box: scaled.max(axis=1),
            Cylinder: np.maximum(across, scaled[:, 2]),
            Sphere: np.linalg.norm(scaled, axis=1),
            Ellipsoid: np.linalg.norm(scaled, axis=1),
        }[type(shape)]
        assert np.allclose(gauge, 1.0, atol=1e-12)


def test_single_poses_are_projected_around_their_own_middle() -> None:
    region = place(Points(((0.1, 0.2, 0.3), (0.3, 0.6, 0.5))), (0.0, 0.0, 0.0))
    middle = region_middle(region)
    assert np.allclose(middle, (0.2, 0.4, 0.4))
    _, xz, _ = planes_through(middle.tolist())
    assert np.allclose(region_outline(region, xz), [(0.1, 0.3), (0.3, 0.5)])


def test_the_window_holds_a_region_out_of_reach() -> None:
    context = replace(ball("+++"), region=place(Sphere(0.1), (3.0, 3.0, 3.0)))
    extent = window(context, planes_through((3.0, 3.0, 3.0)))
    assert all(low < 2.9 and high > 3.1 for low, high in zip(extent.low, extent.high, strict=True))


def test_grids_contain_the_coordinate_planes() -> None:
    nodes = Window((-0.3, -1.0, 0.2), (1.0, 1.0, 0.9)).nodes(0, 0.007)
    assert 0.0 in nodes
    assert nodes[0] <= -0.3 and nodes[-1] >= 1.0
    plane = Plane(0, 2, 1, 0.4)
    poses = plane.poses(np.array([1.0, 2.0]), np.array([5.0, 6.0, 7.0]))
    assert poses[:3].tolist() == [[1.0, 0.4, 5.0], [2.0, 0.4, 5.0], [1.0, 0.4, 6.0]]


def test_fields_without_a_sign_change_have_no_line() -> None:
    axis = np.linspace(0.0, 1.0, 5)
    assert zero_lines(axis, axis, np.ones((5, 5))) == []
    assert zero_lines(axis, axis, np.zeros((5, 5))) == []
    assert zero_lines(axis, axis, np.full((5, 5), np.nan)) == []
