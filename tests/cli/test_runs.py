"""Searches from the command line: what a run folder holds, and that nothing is lost, whatever happens."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from command_line import STUDY, Outcome, command, tpm_design, written

import tpm_design as tpm
from tpm_design.errors import UsageError
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.runs.entry import Entry
from tpm_design.runs.folder import entry_to_json, read_run
from tpm_design.runs.ranking import best_entry

FILES = {"study.yaml", "evaluations.csv", "evaluations.jsonl", "designs.csv", "run.json"}
SECONDS = "seconds [s]"


def optimized(folder: Path, *options: str, text: str = STUDY) -> tuple[Outcome, Path]:
    """One search below ``folder``, and its run folder."""
    study = written(folder, text)
    outcome = tpm_design("optimize", study, "--output", folder / "results", "--workers", "1", *options)
    (run,) = sorted(path for path in (folder / "results").glob("*/*") if path.name in outcome.output)
    return outcome, run


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def contents(run: Path) -> tuple[list[dict[str, str]], list[dict[str, object]], bytes, str]:
    """Everything of a run that may not depend on time or workers."""
    rows = [{k: v for k, v in row.items() if k != SECONDS} for row in rows_of(run / "evaluations.csv")]
    log = [json.loads(line) for line in (run / "evaluations.jsonl").read_text(encoding="utf-8").splitlines()]
    entries = [{k: v for k, v in entry.items() if k != "seconds"} for entry in log]
    return rows, entries, (run / "designs.csv").read_bytes(), (run / "study.yaml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Path]:
    """A search of 60 evaluations."""
    return optimized(tmp_path_factory.mktemp("finished"), "--quiet")


def test_a_search_ends_with_its_result_and_the_way_on(finished: tuple[Outcome, Path]) -> None:
    outcome, run = finished
    assert (outcome.code, outcome.errors) == (0, "")
    assert "Best feasible design of 60 evaluations" in outcome.output
    assert f"Run: {run}\n" in outcome.output
    assert outcome.output.endswith(f"tpm-design report {run}\n")
    assert run.parent.name == "small"


def test_the_run_folder_is_complete(finished: tuple[Outcome, Path]) -> None:
    _, run = finished
    assert {path.name for path in run.iterdir()} == FILES
    resolved = tpm.load_study(run / "study.yaml")
    assert resolved == tpm.load_study(run.parents[2] / "study.yaml")
    assert run.name.endswith(f"-{resolved.study_hash[:6]}")


def test_the_table_has_units_and_every_evaluation_in_order(finished: tuple[Outcome, Path]) -> None:
    rows = rows_of(finished[1] / "evaluations.csv")
    assert list(rows[0]) == [
        "id",
        "round",
        "status",
        "reason",
        "db [mm]",
        "dp [mm]",
        "f [mm]",
        "r [mm]",
        "k [-]",
        "center_x [mm]",
        "center_y [mm]",
        "center_z [mm]",
        "mode",
        "total_link_length [mm]",
        "coverage [-]",
        "conditioning_min [-]",
        "rotation_singularity_distance [mm]",
        "velocity_max [mm/deg]",
        "rotation_singularity_distance_locus",
        "violation [-]",
        SECONDS,
    ]
    assert [int(row["id"]) for row in rows] == list(range(60))
    assert len({(row["f [mm]"], row["r [mm]"], row["k [-]"]) for row in rows}) == 60
    assert {row["status"] for row in rows} == {"feasible", "infeasible"}
    for row in rows:
        assert bool(row["reason"]) == (row["status"] == "infeasible")
        assert (float(row["violation [-]"]) > 0.0) == (row["status"] == "infeasible")
        total = 3.0 * (float(row["f [mm]"]) + float(row["r [mm]"]))
        assert float(row["total_link_length [mm]"]) == pytest.approx(total, rel=1e-14)


def test_the_log_holds_exact_numbers(finished: tuple[Outcome, Path]) -> None:
    _, run = finished
    study, entries = tpm.load_study(run / "study.yaml"), read_run(run).entries
    rows = rows_of(run / "evaluations.csv")
    for entry, row in zip(entries[::7], rows[::7], strict=True):
        again = evaluate(study.problem, entry.evaluation.design)
        repeated = entry_to_json(Entry(entry.number, again)) | {"seconds": entry.evaluation.seconds}
        assert repeated == entry_to_json(entry)
        assert study.units.from_si(float(again.design["f"]), "m") == float(row["f [mm]"])


def test_the_best_design_is_the_best_row(finished: tuple[Outcome, Path]) -> None:
    _, run = finished
    (best,), rows = rows_of(run / "designs.csv"), rows_of(run / "evaluations.csv")
    feasible = [row for row in rows if row["status"] == "feasible"]
    least = min(feasible, key=lambda row: float(row["total_link_length [mm]"]))
    assert (best["rank"], best["id"], best["status"]) == ("1", least["id"], "feasible")
    shared = set(best) & set(least)
    assert {name: best[name] for name in shared} == {name: least[name] for name in shared}
    assert {name.replace(" [", " error [", 1) for name in best if name.startswith("velocity_max [")} <= set(
        best
    )
    assert not any("seconds" in name for name in best)


def test_the_summary_says_how_it_came_about(finished: tuple[Outcome, Path]) -> None:
    _, run = finished
    summary = json.loads((run / "run.json").read_text(encoding="utf-8"))
    (best,) = rows_of(run / "designs.csv")
    study = tpm.load_study(run / "study.yaml")
    expected = {
        "ending": "budget spent",
        "best_id": int(best["id"]),
        "feasible": True,
        "evaluations": 60,
        "method": "scipy.differential_evolution",
        "polish": None,
        "seed": 1,
        "budget": 60,
        "workers": 1,
        "remarks": [],
        "study_hash": study.study_hash,
    }
    assert expected.items() <= summary.items()
    assert summary["status"] in finished[0].output
    assert summary["versions"]["tpm-design"] == tpm.__version__
    assert {"python", "numpy", "scipy", "numba", "nlopt"} <= set(summary["versions"])
    assert summary["machine"]["processors"] == os.cpu_count()
    assert summary["seconds"] > 0.0


@pytest.mark.parametrize("workers", ["1", "2", "3"])
def test_the_same_seed_gives_the_same_run(
    workers: str, finished: tuple[Outcome, Path], tmp_path: Path
) -> None:
    _, again = optimized(tmp_path, "--workers", workers)
    assert contents(again) == contents(finished[1])


def test_another_seed_gives_another_run(finished: tuple[Outcome, Path], tmp_path: Path) -> None:
    _, other = optimized(tmp_path, "--seed", "2")
    assert contents(other)[0] != contents(finished[1])[0]
    assert json.loads((other / "run.json").read_text(encoding="utf-8"))["seed"] == 2


def test_a_larger_budget_goes_on_the_same_way(finished: tuple[Outcome, Path], tmp_path: Path) -> None:
    _, longer = optimized(tmp_path, "--budget", "75")
    assert contents(longer)[1][:60] == contents(finished[1])[1]


def test_the_python_interface_runs_the_same_search(finished: tuple[Outcome, Path]) -> None:
    _, run = finished
    result = tpm.load_study(run / "study.yaml").optimize(workers=2)
    best = read_run(run).best
    assert result.folder is None
    assert result.best is not None and best is not None
    assert result.best.design == best.evaluation.design
    assert result.best.metrics == best.evaluation.metrics
    assert result.status == read_run(run).summary["status"]
    table = result.evaluations
    assert list(table.columns) == list(rows_of(run / "evaluations.csv")[0])
    assert table["f [mm]"].tolist() == [float(row["f [mm]"]) for row in rows_of(run / "evaluations.csv")]


def test_a_run_stands_for_its_best_design(finished: tuple[Outcome, Path]) -> None:
    _, run = finished
    (best,) = rows_of(run / "designs.csv")
    data = json.loads(tpm_design("evaluate", run, "--json").output)
    assert data["status"] == "feasible"
    assert data["assumed"] == []
    for name, entry in (data["design"] | data["metrics"]).items():
        column = name if "unit" not in entry else f"{name} [{entry['unit']}]"
        value = entry["value"]
        assert best[column] == (value if isinstance(value, str) else repr(float(value)))
    changed = json.loads(tpm_design("evaluate", run, "--set", "k=2", "--set", "f=300", "--json").output)
    assert changed["design"]["f"]["value"] == 300.0
    assert changed["design"]["r"] == data["design"]["r"]


def test_json_is_all_there_is_on_standard_output(tmp_path: Path) -> None:
    study = written(tmp_path)
    outcome = tpm_design("optimize", study, "--budget", "8", "--json", "--output", tmp_path / "results")
    data = json.loads(outcome.output)
    (best,) = rows_of(Path(data["run"]) / "designs.csv")
    assert outcome.errors == ""
    assert data["study"] == "small"
    assert data["best"]["metrics"]["total_link_length"]["value"] == float(best["total_link_length [mm]"])


def test_nothing_feasible_names_what_is_missed(tmp_path: Path) -> None:
    text = STUDY.replace("conditioning_min, min: 0.2", "conditioning_min, min: 0.99")
    outcome, run = optimized(tmp_path, "--budget", "20", text=text)
    assert outcome.code == 3
    assert "No feasible design in 20 evaluations; the closest misses conditioning_min" in outcome.output
    assert "relax conditioning_min" in outcome.output
    rows, (best,) = rows_of(run / "evaluations.csv"), rows_of(run / "designs.csv")
    assert best["status"] == "infeasible"
    assert float(best["violation [-]"]) == min(float(row["violation [-]"]) for row in rows)
    summary = json.loads((run / "run.json").read_text(encoding="utf-8"))
    assert (summary["feasible"], summary["best_id"]) == (False, int(best["id"]))


def test_a_method_without_constraints_says_that_it_uses_a_penalty(tmp_path: Path) -> None:
    text = STUDY.replace("scipy.differential_evolution", "nlopt.esch")
    outcome, run = optimized(tmp_path, "--budget", "8", text=text.replace("{values: [1, 2]}", "1"))
    assert "exact penalty" in outcome.output
    (remark,) = json.loads((run / "run.json").read_text(encoding="utf-8"))["remarks"]
    assert remark in outcome.output


OBJECTIVE = "  - {metric: total_link_length, sense: minimize}\n"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("scipy.differential_evolution", "scipy.slsqp", "discrete here: k"),
        ("scipy.differential_evolution", "nlopt.mma", "discrete here: k"),
        ("seed: 1", "seed: 1, polish: nlopt.isres", "not a local method"),
        (
            OBJECTIVE,
            OBJECTIVE + "  - {metric: robot_size, sense: minimize}\n",
            "takes one objective; this study has 2",
        ),
        ("scipy.differential_evolution", "scipy.diferential_evolution", "'scipy.differential_evolution'"),
    ],
)
def test_what_cannot_work_is_refused_before_anything_is_written(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    assert old in STUDY
    study = written(tmp_path, STUDY.replace(old, new))
    outcome = tpm_design("optimize", study, "--output", tmp_path / "results")
    assert (outcome.code, outcome.output) == (2, "")
    assert said in outcome.errors
    line = next(n for n, text in enumerate(STUDY.replace(old, new).splitlines(), 1) if "optimizer:" in text)
    assert f"{study}:{line}: " in outcome.errors
    assert not (tmp_path / "results").exists()


def test_a_study_in_which_nothing_is_free_is_not_searched(tmp_path: Path) -> None:
    text = STUDY.replace("{min: 100, max: 500, initial: 250}", "250").replace("{values: [1, 2]}", "1")
    outcome = tpm_design("optimize", written(tmp_path, text), "--output", tmp_path / "results")
    assert outcome.code == 2
    assert "evaluate" in outcome.errors
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("option", "value"), [("--workers", "0"), ("--budget", "0"), ("--seed", "-1"), ("--seed", str(2**32))]
)
def test_numbers_out_of_range_are_refused(option: str, value: str, tmp_path: Path) -> None:
    outcome = tpm_design("optimize", written(tmp_path), option, value, "--output", tmp_path / "results")
    assert outcome.code == 2
    assert "Choose a whole number" in outcome.errors
    assert not (tmp_path / "results").exists()


def test_a_folder_that_cannot_be_made_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "results").write_text("a file", encoding="utf-8")
    outcome = tpm_design("optimize", written(tmp_path), "--output", tmp_path / "results")
    assert (outcome.code, outcome.output) == (2, "")
    assert str(tmp_path / "results") in outcome.errors
    assert "--output" in outcome.errors


def test_two_searches_at_the_same_time_have_folders_of_their_own(tmp_path: Path) -> None:
    study = tpm.load_study(written(tmp_path)).searched_with(budget=2)
    folders = {study.optimize(output=tmp_path / "results").folder for _ in range(3)}
    assert len(folders) == 3


def started(folder: Path) -> tuple[subprocess.Popen[str], Path]:
    """A long search in a process of its own that has written its first rows."""
    study = written(folder, STUDY.replace("k: {values: [1, 2]}", "k: {min: 1, max: 2}"))
    search = subprocess.Popen(
        command("optimize", study, "--budget", "1000000", "--workers", "2", "--output", folder / "results"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )
    while search.poll() is None:
        logs = list((folder / "results").glob("*/*/evaluations.jsonl"))
        if logs and logs[0].read_bytes().count(b"\n") >= 20:
            return search, logs[0].parent
        time.sleep(0.05)
    raise AssertionError(search.communicate()[1])


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_an_interrupted_search_keeps_everything(tmp_path: Path) -> None:
    search, run = started(tmp_path)
    search.send_signal(signal.SIGINT)
    output, errors = search.communicate()
    assert search.returncode == 130
    assert "Traceback" not in errors
    assert "The search was interrupted." in output
    stored = read_run(run)
    assert {path.name for path in run.iterdir()} == FILES
    assert stored.summary["ending"] == "interrupted"
    assert stored.summary["evaluations"] == len(stored.entries) >= 20
    ids = [int(row["id"]) for row in rows_of(run / "evaluations.csv")]
    assert ids == [entry.number for entry in stored.entries] == list(range(len(ids)))
    assert stored.best is not None
    assert json.loads(tpm_design("evaluate", run, "--json").output)["status"] == stored.best.evaluation.status


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_a_killed_search_keeps_what_was_evaluated(tmp_path: Path) -> None:
    search, run = started(tmp_path)
    search.kill()
    search.communicate()
    stored = read_run(run)
    assert stored.summary == {}
    assert len(stored.entries) >= 20
    assert [entry.number for entry in stored.entries] == list(range(len(stored.entries)))
    assert abs(len(rows_of(run / "evaluations.csv")) - len(stored.entries)) <= 1
    best = best_entry(tpm.load_study(run / "study.yaml").problem, stored.entries)
    assert best is not None
    data = json.loads(tpm_design("evaluate", run, "--json").output)
    assert data["design"]["f"]["value"] / 1000.0 == pytest.approx(best.evaluation.design["f"], rel=1e-15)


def test_a_run_without_evaluations_stands_for_no_design(
    finished: tuple[Outcome, Path], tmp_path: Path
) -> None:
    shutil.copy(finished[1] / "study.yaml", tmp_path)
    (tmp_path / "evaluations.jsonl").touch()
    outcome = tpm_design("evaluate", tmp_path)
    assert outcome.code == 2
    assert "Nothing was evaluated" in outcome.errors


def test_a_line_cut_short_is_ignored_and_a_damaged_one_is_not(
    finished: tuple[Outcome, Path], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    shutil.copytree(finished[1], run)
    log = run / "evaluations.jsonl"
    lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
    log.write_text("".join(lines[:5]) + lines[5][:40], encoding="utf-8")
    assert [entry.number for entry in read_run(run).entries] == [0, 1, 2, 3, 4]
    log.write_text("".join([*lines[:3], lines[3][:40] + "\n", *lines[4:]]), encoding="utf-8")
    with pytest.raises(UsageError, match=r"evaluations\.jsonl:4: "):
        read_run(run)


def test_a_report_of_a_run(finished: tuple[Outcome, Path], tmp_path: Path) -> None:
    run = tmp_path / "run"
    shutil.copytree(finished[1], run)
    outcome = tpm_design("report", run)
    assert (outcome.code, outcome.errors) == (0, "")
    written_files = [Path(line) for line in outcome.output.splitlines()]
    assert run / "report.md" in written_files
    assert any(path.suffix == ".png" for path in written_files)
    for path in written_files:
        assert path.stat().st_size > 0
    assert "total_link_length" in (run / "report.md").read_text(encoding="utf-8")


def test_the_newest_run_is_reported_if_none_is_named(
    finished: tuple[Outcome, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = tpm_design("report")
    assert outcome.code == 2
    assert "tpm-design optimize STUDY" in outcome.errors
    for name in ("20200101T000000Z-aaaaaa", "20300101T000000Z-aaaaaa"):
        shutil.copytree(finished[1], tmp_path / "results" / "small" / name)
    assert tpm_design("report", "--quiet") == Outcome(0, "", "")
    assert (tmp_path / "results/small/20300101T000000Z-aaaaaa/report.md").is_file()
    assert not (tmp_path / "results/small/20200101T000000Z-aaaaaa/report.md").exists()
