"""Evaluations that end as soon as their design is sure to be worse than a cutoff."""

from __future__ import annotations

import csv
import io
import math
import shutil
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import tpm_design as tpm
from tpm_design.cli.app import app
from tpm_design.evaluation.cutoffs import is_worse
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.goals import scaled_objective
from tpm_design.evaluation.result import Cutoff, Evaluation
from tpm_design.optimizers.base import BudgetSpent, ScreeningSearch
from tpm_design.optimizers.watch import Watch
from tpm_design.problem import Design, Problem, Sample
from tpm_design.report.history import history
from tpm_design.runs.entry import Answers, Entry, design_key
from tpm_design.runs.executors import Executor, Threads
from tpm_design.runs.folder import RunWriter, entry_from_json, entry_to_json, read_run
from tpm_design.runs.log import EvaluationLog
from tpm_design.runs.optimize import view_of
from tpm_design.runs.ranking import best_entry, cutoff_at
from tpm_design.runs.replay import answers_in, left_over
from tpm_design.runs.tables import EvaluationTable, csv_line
from tpm_design.runs.unit_search import SCREENED, UnitSearch
from tpm_design.study.plain import dump_yaml
from tpm_design.study.study import Study

FloatArray = NDArray[np.float64]

STUDY = """\
version: 1
name: screened
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters:
    db: {min: 0, max: 400}
    dp: 60
    f: {min: 150, max: 600}
    r: {min: 150, max: 600}
    k: {values: [1, 2]}
  mode: {octant: "+++", elbows: "+++"}
region:
  type: box
  size: [100, 100, 100]
  center: {x: {min: 60, max: 500}, y: {min: 60, max: 500}, z: {min: 60, max: 500}}
objectives: [OBJECTIVE]
constraints: [CONSTRAINTS]
accuracy: {region_samples: 4}
record: [{metric: conditioning_mean, label: gci}]
"""
OBJECTIVES = (
    "{metric: total_link_length, sense: minimize}",
    "{metric: robot_size, sense: minimize}",
    "{metric: velocity_max, sense: minimize}",
    "{metric: singularity_free_volume, sense: maximize}",
)
CONSTRAINTS = (
    "{metric: coverage, min: 1}",
    "{metric: conditioning_min, min: 0.2}",
    "{metric: actuation_singularity_distance, min: 10}",
    "{metric: transmission_min, min: 0.1}",
    "{metric: singularity_margin_min, min: 0.05}",
)


def study_of(folder: Path, objective: str, constraints: Sequence[str]) -> Study:
    text = STUDY.replace("OBJECTIVE", objective).replace("CONSTRAINTS", ", ".join(constraints))
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return tpm.load_study(path)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return study_of(tmp_path_factory.mktemp("screened"), OBJECTIVES[0], CONSTRAINTS[:3])


def points_of(count: int, dimension: int, seed: int) -> FloatArray:
    return np.random.default_rng(seed).random((count, dimension))


def search_of(
    problem: Problem, *, executor: Executor | None = None, answers: Answers | None = None
) -> UnitSearch:
    log = EvaluationLog(problem, executor=executor or Threads(1), answers=answers or {})
    return view_of(log, 10_000)


def timeless(evaluation: Evaluation) -> dict[str, Any]:
    # as text: what has no value is NaN, which does not equal itself
    return {key: repr(value) for key, value in asdict(evaluation).items() if key != "seconds"}


def key_of(problem: Problem, evaluation: Evaluation) -> tuple[float, float]:
    """Violation, then objective: less is better."""
    goal = problem.objectives[0]
    value = evaluation.metrics.get(goal.label, math.nan)
    return evaluation.violation, scaled_objective(goal, value) if math.isfinite(value) else math.inf


# ---------------------------------------------------------------------------- one evaluation


@pytest.mark.parametrize("margin", [None, 0.0, 0.05])
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_an_aborted_design_is_worse_and_any_other_one_is_whole(
    study: Study, margin: float | None, seed: int
) -> None:
    longer = {"f": (1e-3, 0.0, 0.0)}
    samples = () if margin is None else (Sample("conditioning_min", longer, None, margin),)
    problem = replace(study.problem, samples=samples)
    one, other = (
        search_of(problem).space.design(point) for point in points_of(2, len(problem.variables), seed)
    )
    whole, best = evaluate(problem, one), evaluate(problem, other)
    cutoff = cutoff_at(problem, [best], 1)
    if cutoff is None:
        return
    found = evaluate(problem, one, cutoff)
    if found.status != "aborted":
        assert timeless(found) == timeless(whole)
        return
    assert key_of(problem, whole) > key_of(problem, best)
    assert is_worse(problem, found, cutoff)
    assert is_worse(problem, whole, cutoff)
    assert 0.0 <= found.violation <= whole.violation
    assert found.cutoff == cutoff
    assert set(found.metrics) <= set(whole.metrics)
    assert len(found.metrics) < len(whole.metrics) or "not measured further: samples" in found.reason
    for label, value in found.metrics.items():
        assert repr(value) == repr(whole.metrics[label])
        assert label not in found.reason.partition(";")[0]
    for label in set(whole.metrics) - set(found.metrics):
        assert label in found.reason.partition(";")[0]
    for label, slack in found.slacks.items():
        assert slack >= whole.slacks[label]
        assert slack == whole.slacks[label] or samples


def test_what_costs_least_is_measured_first(study: Study) -> None:
    """A long robot is worse than a short feasible one by its links alone, whatever else it is."""
    problem = study.problem
    middle: Design = {"db": 0.19, "dp": 0.06, "k": 1.0, "mode": "+++ +++"}
    centre = {f"center_{axis}": 0.16 for axis in "xyz"}
    short = evaluate(problem, {**middle, **centre, "f": 0.24, "r": 0.19})
    assert short.status == "feasible"
    cutoff = cutoff_at(problem, [short], 1)
    assert cutoff is not None
    assert cutoff.violation == 0.0
    long = evaluate(problem, {**middle, **centre, "f": 0.6, "r": 0.6}, cutoff)
    assert list(long.metrics) == ["total_link_length"]
    assert long.reason == (
        "not measured further: coverage, conditioning_min, actuation_singularity_distance, gci; "
        "already worse than the best known (total_link_length)"
    )
    far = evaluate(
        problem, {**middle, "center_x": 0.5, "center_y": 0.5, "center_z": 0.5, "f": 0.2, "r": 0.2}, cutoff
    )
    assert far.reason.endswith("already worse than the best known (conditioning_min missed)")
    assert far.violation > 0.0
    bad = evaluate(problem, {**middle, "center_x": 0.5, "center_y": 0.5, "center_z": 0.5, "f": 0.2, "r": 0.2})
    assert bad.status == "infeasible"
    assert evaluate(problem, bad.design, replace(cutoff, violation=bad.violation)).status == "infeasible"
    cut = evaluate(problem, bad.design, replace(cutoff, violation=0.9 * bad.violation))
    assert cut.reason.endswith("(violation)")
    for one in (short, bad):
        # the best one is not worse than itself
        own = cutoff_at(problem, [one], 1)
        assert timeless(evaluate(problem, one.design, own)) == timeless(one)


# ----------------------------------------------------------------------------------- screens


@settings(max_examples=10, deadline=None)
@given(
    objective=st.sampled_from(OBJECTIVES),
    constraints=st.lists(st.sampled_from(CONSTRAINTS), min_size=1, unique=True),
    keep=st.integers(1, 40),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_best_are_the_same_as_without_a_screen(
    tmp_path_factory: pytest.TempPathFactory, objective: str, constraints: list[str], keep: int, seed: int
) -> None:
    problem = study_of(tmp_path_factory.mktemp("study"), objective, constraints).problem
    points = points_of(2 * SCREENED + 8, len(problem.variables), seed)
    plain, screened = search_of(problem), search_of(problem)
    exact = plain.evaluate(points)
    outcome = screened.screen(points, keep)
    keys = [key_of(problem, entry.evaluation) for entry in plain.log.entries]
    best = sorted(range(len(points)), key=lambda number: (*keys[number], number))[:keep]
    for number in best:
        assert timeless(screened.log.entries[number].evaluation) == timeless(
            plain.log.entries[number].evaluation
        )
    assert not outcome.aborted[best].any()
    for name in ("objective", "constraints", "merit"):
        values = getattr(outcome, name)
        assert np.isfinite(values).all()
        assert (values[~outcome.aborted] == getattr(exact, name)[~outcome.aborted]).all()
    if outcome.aborted.any():
        assert outcome.merit[outcome.aborted].min() > outcome.merit[best].max()
        worst_kept = max(keys[number] for number in best)
        assert all(keys[number] > worst_kept for number in np.flatnonzero(outcome.aborted))


def test_a_screen_does_not_depend_on_the_number_of_workers(study: Study) -> None:
    points = points_of(4 * SCREENED, len(study.problem.variables), 5)
    logs = []
    for workers in (1, 2, 3):
        with closing(Threads(workers)) as threads:
            search = search_of(study.problem, executor=threads)
            search.screen(points, 6)
        logs.append([timeless(entry.evaluation) for entry in search.log.entries])
    assert logs[0] == logs[1] == logs[2]
    assert sum(entry["status"] == "'aborted'" for entry in logs[0]) > 2 * SCREENED


def test_a_watch_screens_where_the_search_can(study: Study) -> None:
    search = search_of(study.problem)
    assert isinstance(search, ScreeningSearch)
    points = points_of(2 * SCREENED, search.dimension, 6)
    assert Watch(search).screen(points - 0.5, 3).aborted.any()
    limited = replace(search_of(study.problem), limit=40)
    with pytest.raises(BudgetSpent):
        Watch(limited).screen(points, 3)
    assert len(limited.log.entries) == 40


# ------------------------------------------------------------------------- the log and resuming


@pytest.fixture(scope="module")
def course(study: Study) -> tuple[FloatArray, UnitSearch]:
    """A screen, then full evaluations of some of its points."""
    search = search_of(study.problem)
    points = points_of(3 * SCREENED, search.dimension, 7)
    search.screen(points, 4)
    search.evaluate(points[::8])
    return points, search


def aborted(entries: Sequence[Entry]) -> list[Entry]:
    return [entry for entry in entries if entry.evaluation.status == "aborted"]


def test_an_aborted_row_answers_only_what_would_abort_it(study: Study) -> None:
    problem = study.problem
    search = search_of(problem)
    log = search.log
    first = search.screen(points_of(2 * SCREENED, search.dimension, 8), 2)
    assert first.aborted.any()
    row = aborted(log.entries)[0].evaluation
    assert row.cutoff is not None
    count = len(log.entries)
    strict = replace(row.cutoff, violation=0.5 * row.cutoff.violation, objective=row.cutoff.objective - 1.0)
    assert log.evaluations([row.design], 10_000, strict) == [row]
    assert len(log.entries) == count
    lax = Cutoff(1e3, 1e6)
    (measured,) = log.evaluations([row.design], 10_000, lax)
    assert measured.status in ("feasible", "infeasible")
    assert len(log.entries) == count + 1
    for cutoff in (None, lax, strict):
        assert log.evaluations([row.design], 10_000, cutoff) == [measured]
    assert len(log.entries) == count + 1
    assert best_entry(problem, log.entries) not in aborted(log.entries)


def test_a_replay_gives_the_same_log_and_measures_nothing(
    study: Study, course: tuple[FloatArray, UnitSearch]
) -> None:
    points, search = course
    entries = search.log.entries
    repeated = {design_key(e.evaluation.design) for e in aborted(entries)} & {
        design_key(e.evaluation.design) for e in entries if e.evaluation.cutoff is None
    }
    assert len(repeated) >= 5
    stored = [entry_from_json(entry_to_json(entry)) for entry in entries]
    for kept in (len(stored), len(stored) - 3, 50):
        again = search_of(study.problem, answers=answers_in(stored[:kept]))
        again.screen(points, 4)
        again.evaluate(points[::8])
        found = again.log.entries
        assert [timeless(e.evaluation) for e in found] == [timeless(e.evaluation) for e in entries]
        # times are those of the stored rows: nothing was measured again
        assert [e.evaluation.seconds for e in found[:kept]] == [e.evaluation.seconds for e in entries[:kept]]
        assert left_over(stored[:kept], found) == []


def test_an_aborted_design_is_never_the_best(study: Study, course: tuple[FloatArray, UnitSearch]) -> None:
    entries = course[1].log.entries
    ranked = sorted(entries, key=course[1].log.rank)
    states = [entry.evaluation.status for entry in ranked]
    assert "aborted" not in states[: len(entries) - states.count("aborted")]
    of_aborted = history(study.problem, tuple(aborted(entries)))
    assert np.isnan(of_aborted.violation).all()
    assert np.isnan(of_aborted.objective).all()


def test_a_row_holds_what_was_measured_and_no_more(
    study: Study, course: tuple[FloatArray, UnitSearch]
) -> None:
    table = EvaluationTable(study.problem, study.units)
    text = csv_line(table.headings()) + "".join(
        csv_line(table.row(e)) for e in aborted(course[1].log.entries)
    )
    for row in csv.DictReader(io.StringIO(text)):
        assert row["status"] == "aborted"
        assert row["reason"].startswith("not measured further: ")
        assert row["gci [-]"] == ""
        assert not {"nan", "inf", "-inf"} & set(row.values())
        assert float(row["violation [-]"]) >= 0.0


def test_a_report_counts_rows_that_ended_early(
    study: Study, course: tuple[FloatArray, UnitSearch], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    entries = course[1].log.entries
    best = best_entry(study.problem, entries)
    assert best is not None
    folder = tmp_path / "results" / study.name / "20260101T000000Z-000000"
    folder.mkdir(parents=True)
    writer = RunWriter(folder, study.problem, study.units, dump_yaml(study.resolved()))
    for entry in entries:
        writer.record(entry)
    writer.finish(entries, [best], {"best_id": best.number, "feasible": best.evaluation.status == "feasible"})
    assert [repr(entry) for entry in read_run(folder).entries] == [repr(entry) for entry in entries]
    same = shutil.copytree(folder, tmp_path / "same")
    for arguments in (["report"], ["reproduce"], ["compare", str(same)], ["evaluate"]):
        with pytest.raises(SystemExit) as ended:
            app([*arguments, str(folder)])
        assert ended.value.code in (None, 0)
    told = (folder / "report.md").read_text(encoding="utf-8").replace("\\", "")
    assert f"{len(aborted(entries))} ended early, sure to be worse than others" in told
