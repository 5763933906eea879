"""Searches with several objectives from the command line: the front in every file and command."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import tpm_design, written

import tpm_design as tpm
from tpm_design.errors import RefusedError
from tpm_design.optimizers import default_method
from tpm_design.problem import Problem
from tpm_design.report.convergence import convergence_figure
from tpm_design.report.front_figures import front_figure
from tpm_design.report.reported import read_reported
from tpm_design.runs.entry import Entry
from tpm_design.runs.executors import Threads
from tpm_design.runs.folder import entry_to_json, read_run
from tpm_design.runs.front import extremes, knee, non_dominated
from tpm_design.runs.optimize import SearchPlan, search
from tpm_design.runs.ranking import scaled_objectives
from tpm_design.study import Study

FRONT = """\
version: 1
name: small-front
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters: {db: 178, dp: 60, f: {min: 100, max: 400}, r: {min: 100, max: 400}, k: 1}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [60, 60, 60], center: [150, 150, 150]}
objectives:
  - {metric: total_link_length, sense: minimize}
  - {metric: conditioning_min, norm: frobenius, label: even, sense: maximize}
constraints: [{metric: singularity_margin_min, min: 0.05}]
optimizer: {budget: 300, seed: 1}
accuracy: {region_samples: 3}
"""
METHODS = ("pymoo.nsga2", "pymoo.nsga3", "nlopt.epsilon_constraint")


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def loaded(folder: Path, text: str = FRONT) -> Study:
    return tpm.load_study(written(folder, text))


def with_method(method: str, text: str = FRONT) -> str:
    return text.replace("optimizer: {", f"optimizer: {{method: {method}, ")


def evaluations(entries: tuple[Entry, ...]) -> list[dict[str, object]]:
    return [{k: v for k, v in entry_to_json(entry).items() if k != "seconds"} for entry in entries]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A run from the command line, and what it printed."""
    folder = tmp_path_factory.mktemp("front")
    outcome = tpm_design("optimize", written(folder, FRONT), "--output", folder / "results", "--workers", "1")
    assert outcome.code == 0
    (run,) = (folder / "results").glob("*/*")
    return run, outcome.output


@pytest.fixture
def run(finished: tuple[Path, str]) -> Path:
    return finished[0]


# -------------------------------------------------------------------------------- the result


def test_a_study_of_several_objectives_that_names_no_method_is_searched_by_nsga2(tmp_path: Path) -> None:
    study = loaded(tmp_path)
    assert study.optimizer.method == study.resolved()["optimizer"]["method"] == "pymoo.nsga2"
    (first, _) = FRONT.split("  - {metric: conditioning_min")
    one = loaded(tmp_path, first + FRONT[FRONT.index("constraints:") :])
    assert one.optimizer.method == default_method(1)


def test_designs_csv_holds_the_front_of_the_whole_log(run: Path) -> None:
    stored = read_run(run)
    feasible = [e for e in stored.entries if e.evaluation.status == "feasible"]
    table = np.array(
        [[e.evaluation.metrics["total_link_length"], -e.evaluation.metrics["even"]] for e in feasible]
    )
    best = [feasible[row] for row in non_dominated(table)]
    rows = rows_of(run / "designs.csv")
    assert [row["id"] for row in rows] == [str(entry.number) for entry in best]
    assert [row["rank"] for row in rows] == [str(place) for place in range(1, len(rows) + 1)]
    lengths = [float(row["total_link_length [mm]"]) for row in rows]
    assert lengths == sorted(lengths)
    assert [float(row["even [-]"]) for row in rows] == sorted(float(row["even [-]"]) for row in rows)
    assert all(float(row["even error [-]"]) > 0.0 for row in rows)


def test_knee_and_extremes_are_marked_and_the_knee_is_the_best(run: Path) -> None:
    rows = rows_of(run / "designs.csv")
    table = np.array([[float(row["total_link_length [mm]"]), -float(row["even [-]"])] for row in rows])
    marks = {mark: place for place, row in enumerate(rows) for mark in row["mark"].split("; ") if mark}
    assert marks == {
        "knee": knee(table),
        "best total_link_length": extremes(table)[0],
        "best even": extremes(table)[1],
    }
    assert (marks["best total_link_length"], marks["best even"]) == (0, len(rows) - 1)
    summary = json.loads((run / "run.json").read_text(encoding="utf-8"))
    assert summary["best_id"] == int(rows[marks["knee"]]["id"])
    assert summary["front"] == {row["id"]: row["mark"] for row in rows}
    assert f"its knee is number {summary['best_id']}" in summary["status"]


def test_the_summary_shows_the_front_and_its_knee(finished: tuple[Path, str]) -> None:
    run, output = finished
    rows = rows_of(run / "designs.csv")
    assert f"Front of {len(rows)} designs from 300 evaluations" in output
    for mark in ("best total_link_length", "best even", "knee"):
        assert any(mark in line for line in output.splitlines() if line.split()[0:1] != ["rank"])
    assert "The knee:" in output


def test_one_objective_has_neither_marks_nor_a_front(tmp_path: Path) -> None:
    (first, _) = FRONT.split("  - {metric: conditioning_min")
    text = first + FRONT[FRONT.index("constraints:") :]
    found = loaded(tmp_path, text).optimize(budget=40, output=tmp_path / "results")
    assert found.folder is not None
    assert found.front == ()
    assert "mark" not in rows_of(found.folder / "designs.csv")[0]
    assert "front" not in json.loads((found.folder / "run.json").read_text(encoding="utf-8"))


def test_where_nothing_is_feasible_the_closest_design_is_the_result(tmp_path: Path) -> None:
    text = FRONT.replace("min: 0.05", "min: 2")
    outcome = tpm_design(
        "optimize", written(tmp_path, text), "--budget", "50", "--output", tmp_path, "--workers", "1"
    )
    assert outcome.code == 3
    (run,) = tmp_path.glob("small-front/*")
    (row,) = rows_of(run / "designs.csv")
    entries = read_run(run).entries
    assert float(row["violation [-]"]) == min(e.evaluation.violation for e in entries)
    assert row["mark"] == ""
    assert "the closest misses singularity_margin_min" in outcome.output
    reported = read_reported(run)
    assert front_figure(reported) is None
    assert convergence_figure(reported) is not None


# -------------------------------------------------------------------------------- other commands


def test_json_holds_the_front(run: Path, tmp_path: Path) -> None:
    outcome = tpm_design("optimize", run / "study.yaml", "--json", "--output", tmp_path, "--workers", "1")
    data = json.loads(outcome.output)
    rows = rows_of(run / "designs.csv")
    assert [str(one["id"]) for one in data["front"]] == [row["id"] for row in rows]
    assert [one["mark"] for one in data["front"]] == [row["mark"] for row in rows]
    (at_knee,) = (one for one in data["front"] if "knee" in one["mark"])
    assert {k: v for k, v in at_knee.items() if k not in ("id", "mark")} == data["best"]


def test_the_run_stands_for_its_knee_finished_or_not(run: Path, tmp_path: Path) -> None:
    rows = {row["mark"]: row for row in rows_of(run / "designs.csv")}
    for folder in (run, tmp_path):
        if folder is tmp_path:
            for name in ("study.yaml", "evaluations.jsonl"):
                (tmp_path / name).write_bytes((run / name).read_bytes())
        data = json.loads(tpm_design("evaluate", folder, "--json").output)
        assert data["design"]["f"]["value"] == pytest.approx(float(rows["knee"]["f [mm]"]), rel=1e-12)


def test_a_front_is_compared_and_reproduced(run: Path, tmp_path: Path) -> None:
    again = loaded(tmp_path).optimize(output=tmp_path / "results")
    assert again.folder is not None
    assert tpm_design("compare", run, again.folder).code == 0
    assert tpm_design("reproduce", run).code == 0
    other = loaded(tmp_path).optimize(seed=2, output=tmp_path / "results")
    assert other.folder is not None
    outcome = tpm_design("compare", run, other.folder)
    assert outcome.code == 4
    assert "mark" in outcome.output or "there" in outcome.output


def test_the_report_draws_the_front_and_states_the_reference_point(run: Path) -> None:
    assert tpm_design("report", run).code == 0
    report = (run / "report.md").read_text(encoding="utf-8")
    for name in ("front.png", "hypervolume.png"):
        assert (run / "figures" / name).stat().st_size > 10_000
        assert f"figures/{name}" in report
    rows = rows_of(run / "designs.csv")
    lengths = [float(row["total_link_length [mm]"]) for row in rows]
    reference = lengths[-1] + 0.1 * (lengths[-1] - lengths[0])
    assert f"total\\_link\\_length {reference:.4g}".replace(".", "\\.") in report or (
        f"total_link_length {reference:.4g} mm" in report
    )
    assert f"## Front ({len(rows)} designs)" in report
    assert "Knee of the front" in report


# -------------------------------------------------------------------------------- replay


@pytest.mark.parametrize("method", METHODS)
def test_two_workers_find_what_one_finds(method: str, tmp_path: Path) -> None:
    study = loaded(tmp_path, with_method(method))
    runs = [study.optimize(budget=130, workers=n, output=tmp_path / str(n)) for n in (1, 2)]
    one, two = runs
    assert evaluations(one.result.entries) == evaluations(two.result.entries)
    assert one.folder is not None
    assert two.folder is not None
    for name in ("designs.csv", "study.yaml"):
        assert (one.folder / name).read_bytes() == (two.folder / name).read_bytes()


@pytest.mark.parametrize("method", METHODS)
def test_a_run_that_was_cut_short_ends_with_the_same_designs(method: str, tmp_path: Path) -> None:
    study = loaded(tmp_path, with_method(method))
    whole = study.optimize(budget=160, output=tmp_path / "whole")
    begun = study.optimize(budget=90, output=tmp_path / "begun")
    assert whole.folder is not None
    assert begun.folder is not None
    log = begun.folder / "evaluations.jsonl"
    log.write_bytes(log.read_bytes()[: 3 * log.stat().st_size // 4])
    (begun.folder / "designs.csv").unlink()
    study.optimize(budget=160, output=tmp_path / "begun", resume="latest")
    assert (begun.folder / "designs.csv").read_bytes() == (whole.folder / "designs.csv").read_bytes()


@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked and killed")
def test_a_front_killed_several_times_ends_as_if_it_had_not_been(
    finished: tuple[Path, str], tmp_path: Path
) -> None:
    import subprocess

    program = Path(__file__).with_name("killed.py")
    words = [sys.executable, program, written(tmp_path, FRONT), tmp_path / "results", "5", "1"]
    subprocess.run([str(word) for word in words], check=True)
    (again,) = (tmp_path / "results").glob("*/*")
    assert (again / "designs.csv").read_bytes() == (finished[0] / "designs.csv").read_bytes()


# -------------------------------------------------------------------------------- refusals, proofs


def test_methods_and_objectives_must_go_together(tmp_path: Path) -> None:
    outcome = tpm_design("validate", written(tmp_path, with_method("nlopt.cobyla")))
    assert outcome.code == 2
    assert "takes one objective; this study has 2" in outcome.errors
    assert "nlopt.epsilon_constraint, pymoo.nsga2, pymoo.nsga3" in outcome.errors
    (first, _) = FRONT.split("  - {metric: conditioning_min")
    alone = with_method("pymoo.nsga3", first + FRONT[FRONT.index("constraints:") :])
    outcome = tpm_design("optimize", written(tmp_path, alone))
    assert outcome.code == 2
    assert "searches the front of several objectives" in outcome.errors
    assert "scipy.differential_evolution" in outcome.errors
    polished = FRONT.replace("seed: 1", "seed: 1, polish: nlopt.cobyla")
    outcome = tpm_design("optimize", written(tmp_path, polished))
    assert outcome.code == 2
    assert "Remove the polish" in outcome.errors
    third = FRONT.replace("constraints:", "  - {metric: robot_size, sense: minimize}\nconstraints:")
    with pytest.raises(RefusedError, match="at most 2 objectives; this study has 3") as refused:
        loaded(tmp_path, with_method("nlopt.epsilon_constraint", third)).optimize(budget=10)
    assert "pymoo.nsga3" in (refused.value.remedy or "")


@pytest.mark.parametrize(("least", "code", "word"), [(0.05, 0, "Proved"), (0.35, 5, "Not proved")])
def test_the_knee_alone_is_certified(least: float, code: int, word: str, tmp_path: Path) -> None:
    """1/κ over the region is proved with room to spare; the size of the body cannot be proved at all."""
    asked = "{metric: conditioning_min, norm: frobenius, min: 0.05}"
    if code:
        asked = "{metric: robot_size, max: 2000}"
    text = FRONT.replace("{metric: singularity_margin_min, min: 0.05}", asked) + (
        "certify: {tolerance: {f: 0.1}, boxes: 20000}\n"
    )
    outcome = tpm_design(
        "optimize", written(tmp_path, text), "--budget", "80", "--output", tmp_path, "--workers", "1"
    )
    assert outcome.code == code, outcome.errors
    assert "Of the front the knee alone was certified. " + word in outcome.output
    (run,) = tmp_path.glob("small-front/*")
    assert (run / "certificate.json").exists()
    summary = json.loads((run / "run.json").read_text(encoding="utf-8"))
    assert summary["rounds"] == []
    assert summary["certificate"]["outcome"] == ("undecided" if code else "proved")


# -------------------------------------------------------------------------------- how good it is


def not_longer(problem: Problem, entry: Entry, seed: int) -> float:
    """By which share the links of a design on the front are longer than a search of its own for the shortest
    links finds them, with its conditioning asked for."""
    size, even = problem.objectives
    floor = replace(
        even, sense=None, minimum=entry.evaluation.metrics["even"] - entry.evaluation.errors["even"]
    )
    alone = replace(problem, objectives=(size,), constraints=(*problem.constraints, floor))
    plan = SearchPlan("scipy.differential_evolution", 240, seed, "nlopt.cobyla")
    found = search(alone, plan, executor=Threads(1), record=lambda e: None, stored=()).best
    assert found is not None
    assert found.evaluation.status == "feasible"
    mine, best = (e.evaluation.metrics["total_link_length"] for e in (entry, found))
    return mine / best - 1.0


def test_no_search_of_its_own_improves_a_design_of_the_ladder(tmp_path: Path) -> None:
    """Differential evolution and a polish, which know nothing of the front, find links shorter by at most
    0.2 %."""
    study = loaded(tmp_path, with_method("nlopt.epsilon_constraint"))
    front = study.optimize(budget=1500).result.front
    values = np.array([scaled_objectives(study.problem, entry.evaluation) for entry in front])
    at = np.unique(np.linspace(0, len(front) - 1, 4).astype(int))
    for row in {*at.tolist(), knee(values)}:
        assert not_longer(study.problem, front[row], seed=1) <= 2e-3
