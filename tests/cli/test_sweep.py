"""`sweep` and `merge` from the command line: a row for every point, the same run from its shards."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from command_line import STUDY, Outcome, command, process, tpm_design, written

from tpm_design.runs.folder import read_run

FILES = {"study.yaml", "evaluations.csv", "evaluations.jsonl", "designs.csv", "run.json"}
PLAN = "sweep: {type: grid, parameters: {f: {min: 200, max: 300, num: 5}, r: {num: 5}}}\n"
SWEPT = STUDY + PLAN

# limb 2 lies in the plane of limb 1 and z at every half turn: no such machine can be
HUNDRED_FAIL = """\
version: 1
name: many
units: {length: mm, angle: deg}
mechanism:
  type: crr
  parameters:
    f: {min: 100, max: 300}
    r: 200
    azimuth1: 0
    azimuth2: {min: 0, max: 180}
    azimuth3: 0
  mode: {elbows: "+++"}
region: {type: box, size: [100, 100, 100], center: [0, 0, 0]}
objectives:
  - {metric: total_link_length, sense: minimize}
sweep: {type: grid, parameters: {f: {num: 100}, azimuth2: {min: 0, max: 148.5, num: 100}}}
"""


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def summary_of(run: Path) -> dict[str, Any]:
    data: dict[str, Any] = json.loads((run / "run.json").read_text(encoding="utf-8"))
    return data


def run_in(outcome: Outcome) -> Path:
    (line,) = (line for line in outcome.output.splitlines() if line.startswith("Run: "))
    return Path(line.removeprefix("Run: "))


def swept(folder: Path, *options: str, text: str = SWEPT) -> tuple[Outcome, Path]:
    """One sweep below ``folder``, and its run folder."""
    study = written(folder, text)
    outcome = tpm_design("sweep", study, "--output", folder / "results", "--quiet", *options)
    return outcome, run_in(outcome)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Path]:
    """A sweep of 25 points."""
    return swept(tmp_path_factory.mktemp("whole"), "--workers", "1")


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The same in three shards."""
    folder = tmp_path_factory.mktemp("shards")
    return [swept(folder, "--shard", f"{index}/3", "--workers", "2")[1] for index in (1, 2, 3)]


def timeless(run: Path) -> tuple[Any, ...]:
    """Everything of a run but its times, and in run.json where and how it ran."""
    rows = [row | {"seconds [s]": ""} for row in rows_of(run / "evaluations.csv")]
    log = [json.loads(line) | {"seconds": 0} for line in (run / "evaluations.jsonl").read_text().splitlines()]
    summary = {k: v for k, v in summary_of(run).items() if k not in ("seconds", "workers", "merged")}
    return rows, log, summary, (run / "designs.csv").read_bytes(), (run / "study.yaml").read_bytes()


def test_ten_thousand_points_of_which_a_hundred_fail(tmp_path: Path) -> None:
    outcome, run = swept(tmp_path, "--workers", "2", text=HUNDRED_FAIL)
    assert outcome.code == 6
    rows = rows_of(run / "evaluations.csv")
    assert [int(row["id"]) for row in rows] == list(range(10_000))
    failed = [row for row in rows if row["status"] == "failed"]
    assert len(failed) == 100
    assert {row["azimuth2 [deg]"] for row in failed} == {"0.0"}
    assert all("parallel to one plane" in row["reason"] for row in failed)
    assert all(bool(row["reason"]) == (row["status"] == "failed") for row in rows)
    assert "100 of 10000 points failed:\n  100 points, the first of them 0: crr: the axes" in outcome.output
    assert "9900 feasible, 0 infeasible, 100 failed." in outcome.output
    assert [row["id"] for row in rows_of(run / "designs.csv")] == [row["id"] for row in rows]
    assert summary_of(run)["failed"] == 100


def test_a_sweep_has_a_row_for_every_point_of_its_plan(whole: tuple[Outcome, Path]) -> None:
    outcome, run = whole
    assert (outcome.code, outcome.errors) == (0, "")
    assert {path.name for path in run.iterdir()} == FILES
    rows = rows_of(run / "designs.csv")
    expected = [(f, r) for f in range(200, 301, 25) for r in range(100, 501, 100)]
    assert [(float(row["f [mm]"]), float(row["r [mm]"])) for row in rows] == expected
    assert list(rows[0])[:3] == ["id", "status", "db [mm]"]
    assert {row["k [-]"] for row in rows} == {"1.0"}
    summary = summary_of(run)
    assert summary["status"] in outcome.output
    assert summary["sweep"] == {"points": 25, "shard": "1/1", "repeated": 2, "disagreements": []}
    feasible = [row for row in rows if row["status"] == "feasible"]
    best = min(feasible, key=lambda row: float(row["total_link_length [mm]"]))
    assert (summary["best_id"], summary["feasible"]) == (int(best["id"]), True)
    length = float(best["total_link_length [mm]"])
    assert f"Best feasible design: point {best['id']}, total_link_length {length:.6g} mm" in outcome.output
    assert "No point is feasible" not in outcome.output
    stored = json.loads(tpm_design("evaluate", run, "--json").output)
    assert stored["design"]["r"]["value"] == float(best["r [mm]"])


def test_what_is_held_is_told(tmp_path: Path) -> None:
    outcome = tpm_design("sweep", written(tmp_path, SWEPT), "--output", tmp_path / "results")
    assert outcome.output.startswith("Held: k = 1 (the first one listed).\n")
    assert outcome.errors == "Evaluating; the equations are compiled on first use.\n"


def test_merged_shards_are_the_sweep(whole: tuple[Outcome, Path], shards: list[Path], tmp_path: Path) -> None:
    outcome = tpm_design("merge", *reversed(shards), "--output", tmp_path / "results")
    assert (outcome.code, outcome.errors) == (0, "")
    merged = run_in(outcome)
    assert timeless(merged) == timeless(whole[1])
    assert summary_of(merged)["merged"] == [run.name for run in reversed(shards)]
    # and are a sweep that can be merged
    again = tpm_design("merge", merged, "--output", tmp_path / "again", "--json")
    assert timeless(Path(json.loads(again.output)["run"])) == timeless(merged)


def test_merged_shards_with_failed_points_end_as_the_sweep_does(tmp_path: Path) -> None:
    text = HUNDRED_FAIL.replace("num: 100", "num: 4")
    runs = [swept(tmp_path, "--shard", f"{index}/2", text=text) for index in (1, 2)]
    assert [outcome.code for outcome, _ in runs] == [6, 0]
    outcome = tpm_design("merge", *(run for _, run in runs), "--output", tmp_path / "merged", "--json")
    assert outcome.code == 6
    data = json.loads(outcome.output)
    assert (data["feasible"], data["failed"]) == (12, 4)
    (reason,) = data["reasons"]
    assert (reason["points"], reason["first"]) == (4, 0)


def altered(folder: Path, run: Path, old: str, new: str, name: str = "run.json") -> Path:
    """A copy of a run with one file changed."""
    copy = folder / f"copy-{name}"
    shutil.copytree(run, copy)
    text = (copy / name).read_text(encoding="utf-8")
    assert old in text
    (copy / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    return copy


def refused(folder: Path, *runs: Path) -> str:
    """What `merge` says; it writes nothing."""
    outcome = tpm_design("merge", *runs, "--output", folder / "merged")
    assert (outcome.code, outcome.output) == (2, "")
    assert not (folder / "merged").exists()
    return outcome.errors


def test_points_that_are_missing_or_double_are_named(shards: list[Path], tmp_path: Path) -> None:
    first, second, third = shards
    missing = refused(tmp_path, first, third)
    assert "Points 1, 4, 7, 10, 13, 16, 19 and 22 are in none of these runs: the plan has 25." in missing
    assert "Points 1, 2, 4, 5, 7, 8, 10, 11, 13, 14, … (16 in all) are in none" in refused(tmp_path, first)
    double = refused(tmp_path, first, second, third, second)
    assert "Points 1, 4, 7, 10, 13, 16, 19 and 22 are there more than once" in double
    assert f"1 in {second} and {second}" in double


def test_what_does_not_belong_together_is_not_merged(
    whole: tuple[Outcome, Path], shards: list[Path], tmp_path: Path
) -> None:
    first, second, third = shards
    other = altered(tmp_path / "a", second, '"study_hash": "', '"study_hash": "0')
    assert f"{other}: This run is of another study, or of another plan." in refused(
        tmp_path, first, other, third
    )
    old = altered(tmp_path / "b", second, '"tpm-design": "', '"tpm-design": "9.')
    assert f"{old}: This run is by version 9." in refused(tmp_path, first, old, third)
    search = altered(tmp_path / "c", second, '"sweep"', '"no sweep"')
    assert f"{search}: This run is no sweep." in refused(tmp_path, first, search, third)
    (cut := altered(tmp_path / "d", second, "{", "{") / "run.json").unlink()
    assert f"{cut.parent}: This run was cut short" in refused(tmp_path, first, cut.parent, third)
    moved = altered(tmp_path / "e", second, '"dp":0.06', '"dp":0.07', "evaluations.jsonl")
    assert f"{moved}: Row 1 is not the plan's point 1." in refused(tmp_path, first, moved, third)
    beyond = altered(tmp_path / "f", whole[1], '{"id":24,', '{"id":25,', "evaluations.jsonl")
    assert "Point 24 is in none of these runs" in refused(tmp_path, beyond)


@pytest.mark.parametrize("shard", ["0/3", "4/3", "1", "a/b", "1/0", "-1/3", "1/3/5"])
def test_shards_that_cannot_be_are_refused(shard: str, tmp_path: Path) -> None:
    outcome = tpm_design("sweep", written(tmp_path, SWEPT), f"--shard={shard}", "--output", tmp_path / "out")
    assert outcome.code == 2
    assert "Write i/n" in outcome.errors
    assert not (tmp_path / "out").exists()


def test_a_study_without_a_plan_is_not_swept(tmp_path: Path) -> None:
    outcome = tpm_design("sweep", written(tmp_path), "--output", tmp_path / "out")
    assert (outcome.code, outcome.output) == (2, "")
    assert "no plan to sweep" in outcome.errors
    assert not (tmp_path / "out").exists()


def test_a_shard_may_be_empty(tmp_path: Path) -> None:
    outcome, run = swept(tmp_path, "--shard", "26/26")
    assert outcome.code == 0
    assert "0 of 25 points (shard 26/26) evaluated" in outcome.output
    assert rows_of(run / "designs.csv") == []
    assert tpm_design("report", run).code == 0


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_a_sweep_that_is_cut_short_keeps_its_rows(end: signal.Signals, tmp_path: Path) -> None:
    study = written(tmp_path, SWEPT.replace("num: 5", "num: 900", 1))
    running = subprocess.Popen(
        command("sweep", study, "--workers", "2", "--output", tmp_path / "results"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )
    logs: list[Path] = []
    while running.poll() is None and not (logs and logs[0].read_bytes().count(b"\n") >= 20):
        logs = list((tmp_path / "results").glob("*/*/evaluations.jsonl"))
        time.sleep(0.05)
    running.send_signal(end)
    output, errors = running.communicate()
    assert "Traceback" not in errors
    run = logs[0].parent
    stored = read_run(run)
    assert len(stored.entries) >= 20
    if end == signal.SIGINT:
        assert running.returncode == 130
        assert "The sweep was interrupted." in output
        assert stored.summary["ending"] == "interrupted"
        numbers = [int(row["id"]) for row in rows_of(run / "evaluations.csv")]
        assert numbers == [entry.number for entry in stored.entries]
        assert "are in none of these runs" in refused(tmp_path, run)
        return
    assert stored.summary == {}
    assert "This run was cut short" in refused(tmp_path, run)
    assert tpm_design("report", run).code == 0
    report = (run / "report.md").read_text(encoding="utf-8")
    assert f"{len(stored.entries)} of the plan's 4500 designs are in the log" in report


def test_the_report_of_a_sweep_draws_metrics_against_what_was_swept(
    whole: tuple[Outcome, Path], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    shutil.copytree(whole[1], run)
    outcome = tpm_design("report", run)
    assert (outcome.code, outcome.errors) == (0, "")
    report = (run / "report.md").read_text(encoding="utf-8")
    assert "The plan is a grid of 5 × 5 over `f`, `r`." in report
    assert "| `total_link_length` | mm | 900 | 0 | 2400 | 24 | 0 |" in report
    for name in ("sweep.png", "sweep-map.png", "mechanism.png"):
        assert f"(figures/{name})" in report
        assert (run / "figures" / name).stat().st_size > 10_000
    assert "budget" not in report.split("## Caveats")[0]


def test_the_report_of_a_sweep_names_what_failed(tmp_path: Path) -> None:
    plan = "{type: list, points: [{azimuth2: 0}, {azimuth2: 0, f: 110}, {azimuth2: 180}]}"
    text = HUNDRED_FAIL[: HUNDRED_FAIL.index("sweep:")] + f"sweep: {plan}\n"
    outcome, run = swept(tmp_path, text=text)
    assert outcome.code == 6
    assert tpm_design("report", run).code == 0
    report = (run / "report.md").read_text(encoding="utf-8")
    assert "| 3 | 0 | crr\\: the axes" in report or "| 3 | 0 | crr: the axes" in report
    assert "The plan is a list over `azimuth2`, `f`." in report


BROKEN = """
from dataclasses import replace
from tpm_design.mechanisms.orthoglide import KIND as KNOWN, build as known


def build(parameters, limits):
    if parameters["L"] > 0.5:
        raise RuntimeError("no such link")
    return known(parameters, limits)


KIND = replace(KNOWN, name="broken", title="broken", build=build)
"""


FORGETFUL = """
from dataclasses import replace
from itertools import count
from tpm_design.mechanisms.orthoglide import KIND as KNOWN, build as known

CALLS = count()


def build(parameters, limits):
    return known({"L": parameters["L"] * (1.0 + next(CALLS) * 2.0**-40)}, limits)


KIND = replace(KNOWN, name="forgetful", title="forgetful", build=build)
"""

OWN_FILE = """\
version: 1
name: own
units: {length: mm, angle: deg}
mechanism: {file: own.py, parameters: {L: {min: 300, max: 600}}, mode: {carriages: "+++"}}
region: {type: box, size: [100, 100, 100], center: [0, 0, 0]}
objectives: [{metric: total_link_length, sense: minimize}]
sweep: {type: grid, parameters: {L: {num: 7}}}
"""


def test_a_hidden_state_is_told_after_the_rows_are_written(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(FORGETFUL, encoding="utf-8")
    written(tmp_path, OWN_FILE)
    done = process(["sweep", "study.yaml", "--allow-code", "--json", "--workers", "1"], tmp_path)
    data = json.loads(done.stdout)
    assert (done.returncode, data["feasible"], data["disagreements"]) == (1, 7, [0])
    assert "Point 0 is different when evaluated again" in data["status"]
    assert "depends on more than its design" in done.stderr
    assert summary_of(tmp_path / data["run"])["sweep"]["disagreements"] == [0]
    assert len(rows_of(tmp_path / data["run"] / "evaluations.csv")) == 7


def test_a_mechanisms_own_file_that_breaks_at_some_points_ends_after_the_rows_are_written(
    tmp_path: Path,
) -> None:
    (tmp_path / "own.py").write_text(BROKEN, encoding="utf-8")
    written(tmp_path, OWN_FILE)
    assert process(["sweep", "study.yaml"], tmp_path).returncode == 2
    assert not (tmp_path / "results").exists()
    done = process(["sweep", "study.yaml", "--allow-code", "--json"], tmp_path)
    data = json.loads(done.stdout)
    assert (data["feasible"], data["failed"]) == (5, 2)
    assert data["reasons"] == [{"reason": "RuntimeError: no such link", "points": 2, "first": 5}]
    assert done.returncode == 2
    assert "own.py:8" in done.stderr
    assert "no such link" in done.stderr
    rows = rows_of(tmp_path / data["run"] / "evaluations.csv")
    assert [row["status"] for row in rows] == ["feasible"] * 5 + ["failed"] * 2


def test_a_sweep_without_a_feasible_point_names_what_the_closest_misses(tmp_path: Path) -> None:
    assert "conditioning_min, min: 0.2" in STUDY
    text = STUDY.replace("conditioning_min, min: 0.2", "conditioning_min, min: 0.99")
    study = written(tmp_path, f"{text}sweep: {{type: list, points: [{{f: 250, r: 250}}]}}\n")
    outcome = tpm_design("sweep", study, "--output", tmp_path / "results")
    assert outcome.code == 0
    assert "No point is feasible; the closest, point 0, misses " in outcome.output
    assert "conditioning_min" in outcome.output.split("misses ")[1]
