"""Sweeps that were cut short go on and end as if nothing had happened; what does not belong is refused."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import command, process, tpm_design, written
from test_resume import cut, only_run
from test_sweep import BROKEN, OWN_FILE, SWEPT, run_in, summary_of, swept, timeless

from tpm_design.runs.folder import read_run
from tpm_design.runs.sweeps import REPEATED_EVERY

PLAN = SWEPT.replace("num: 5", "num: 10", 1)
"""Fifty points."""

posix = pytest.mark.skipif(os.name == "nt", reason="signals and forks are other ones there")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep that nothing interrupted."""
    return swept(tmp_path_factory.mktemp("whole"), "--workers", "1", text=PLAN)[1]


@pytest.fixture(scope="module")
def second(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The second of three shards of it."""
    return swept(tmp_path_factory.mktemp("second"), "--shard", "2/3", text=PLAN)[1]


@pytest.fixture
def run(whole: Path, tmp_path: Path) -> Path:
    """A copy of the sweep in a folder of runs, to be spoilt."""
    return shutil.copytree(whole, tmp_path / "results" / "small" / whole.name)


def without_resume(run: Path) -> tuple[object, ...]:
    """All of a finished run that may not depend on its interruptions."""
    rows, log, summary, *files = timeless(run)
    return (rows, log, {k: v for k, v in summary.items() if k != "resumed_after"}, *files)


def seconds(run: Path) -> dict[int, float]:
    return {entry.number: entry.evaluation.seconds for entry in read_run(run).entries}


@posix
@pytest.mark.parametrize("shard", ["1/1", "2/3"])
def test_a_sweep_killed_again_and_again_ends_as_if_it_had_not_been(
    shard: str, whole: Path, second: Path, tmp_path: Path
) -> None:
    program = Path(__file__).with_name("killed.py")
    words = [sys.executable, program, written(tmp_path, PLAN), tmp_path / "results", "6", "1", shard]
    subprocess.run([str(word) for word in words], check=True)
    again, expected = only_run(tmp_path), whole if shard == "1/1" else second
    assert without_resume(again) == without_resume(expected)
    assert {path.name for path in again.iterdir()} == {path.name for path in expected.iterdir()}
    assert summary_of(again)["resumed_after"] > 0


def test_points_of_the_log_are_not_evaluated_again(run: Path, whole: Path) -> None:
    cut(run, (run / "evaluations.jsonl").read_bytes().index(b'{"id":30,') + 40)
    kept = seconds(run)
    assert set(kept) == set(range(30))
    outcome = tpm_design("sweep", run / "study.yaml", "--resume", run, "--quiet")
    assert (outcome.code, outcome.errors) == (0, "")
    assert run_in(outcome) == run
    assert without_resume(run) == without_resume(whole)
    # a time is never measured twice the same
    assert {number: seconds(run)[number] for number in kept} == kept
    assert summary_of(run)["resumed_after"] == 30
    assert summary_of(run)["sweep"]["repeated"] == -(-50 // REPEATED_EVERY)


def test_a_finished_sweep_is_written_again_as_it_is(run: Path, whole: Path) -> None:
    assert tpm_design("sweep", run / "study.yaml", "--resume", run, "--quiet").code == 0
    for name in ("designs.csv", "evaluations.csv", "evaluations.jsonl", "study.yaml"):
        assert (run / name).read_bytes() == (whole / name).read_bytes()


def test_a_row_of_another_design_is_not_believed(run: Path, whole: Path) -> None:
    log = run / "evaluations.jsonl"
    text = log.read_text(encoding="utf-8")
    log.write_text(text.replace('"dp":0.06', '"dp":0.061', 1), encoding="utf-8")
    assert tpm_design("sweep", run / "study.yaml", "--resume", run, "--quiet").code == 0
    assert without_resume(run) == without_resume(whole)
    assert summary_of(run)["resumed_after"] == 49


def test_a_design_that_a_list_holds_twice_keeps_both_rows(tmp_path: Path) -> None:
    plan = "sweep: {type: list, points: [{f: 200}, {f: 210}, {f: 200}, {f: 220}]}\n"
    text = SWEPT[: SWEPT.index("sweep:")] + plan
    _, run = swept(tmp_path, text=text)
    expected = without_resume(run)
    cut(run, (run / "evaluations.jsonl").read_bytes().index(b'{"id":1,'))
    assert tpm_design("sweep", run / "study.yaml", "--resume", run, "--quiet").code == 0
    assert without_resume(run) == expected


def test_a_bug_that_was_seen_before_the_interruption_is_told_again(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(BROKEN, encoding="utf-8")
    written(tmp_path, OWN_FILE)
    first = process(["sweep", "study.yaml", "--allow-code", "--json"], tmp_path)
    run = tmp_path / json.loads(first.stdout)["run"]
    expected = without_resume(run)
    words = ["sweep", "study.yaml", "--allow-code", "--json", "--resume", str(run)]
    again = process(words, tmp_path)
    assert again.returncode == first.returncode == 2
    assert "no such link" in again.stderr
    assert without_resume(run) == expected


@posix
def test_after_ctrl_c_the_command_that_is_printed_goes_on(tmp_path: Path) -> None:
    text = SWEPT.replace("num: 5", "num: 200", 1)
    words = command("sweep", written(tmp_path, text), "--shard", "2/4", "--output", tmp_path / "results")
    running = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    logs: list[Path] = []
    while running.poll() is None and not (logs and logs[0].read_bytes().count(b"\n") >= 20):
        logs = list((tmp_path / "results").glob("*/*/evaluations.jsonl"))
        time.sleep(0.02)
    # one writer at a time
    outcome = tpm_design("sweep", tmp_path / "study.yaml", "--shard", "2/4", "--resume", logs[0].parent)
    assert outcome.code == 2
    assert f"being written already, by process {running.pid} on {socket.gethostname()}" in outcome.errors
    running.send_signal(signal.SIGINT)
    output, _ = running.communicate()
    assert running.returncode == 130
    (following,) = re.findall(r"^Next: tpm-design (sweep .*)$", output, re.MULTILINE)
    outcome = tpm_design(*shlex.split(following), "--quiet")
    assert outcome.code == 0
    assert "250 of 1000 points (shard 2/4) evaluated" in outcome.output
    assert [entry.number for entry in read_run(logs[0].parent).entries] == list(range(1, 1000, 4))


# ----------------------------------------------------------------------------------------- refusals


def refused(run: Path, *words: str | Path) -> str:
    """What is said; the run stays as it is."""
    before = timeless(run)
    outcome = tpm_design(*words)
    assert (outcome.code, outcome.output) == (2, "")
    assert timeless(run) == before
    return outcome.errors


@pytest.mark.parametrize(
    ("old", "new", "different"),
    [
        ("{min: 200, max: 300, num: 10}", "{min: 200, max: 310, num: 10}", "sweep.parameters.f.max"),
        ("budget: 60", "budget: 61", "optimizer.budget"),
        ("size: [70, 70, 70]", "size: [70, 70, 71]", "region.size[3]"),
    ],
)
def test_another_study_is_refused_and_the_difference_named(
    old: str, new: str, different: str, run: Path, tmp_path: Path
) -> None:
    assert PLAN.count(old) == 1
    told = refused(run, "sweep", written(tmp_path, PLAN.replace(old, new)), "--resume", run)
    assert f"The run belongs to another study; different: {different}" in told
    assert f"Nothing may change. Resume it with {run / 'study.yaml'}" in told


def test_another_shard_and_another_version_are_refused(run: Path, second: Path, tmp_path: Path) -> None:
    study = written(tmp_path, PLAN)
    told = refused(run, "sweep", study, "--shard", "1/3", "--resume", run)
    assert "This run is the whole plan.\n  Resume it with --shard 1/1." in told
    told = refused(second, "sweep", study, "--resume", second)
    assert "This run is shard 2/3 of the plan.\n  Resume it with --shard 2/3." in told
    data = summary_of(run)
    data["versions"]["tpm-design"] = "0.0.9"
    (run / "run.json").write_text(json.dumps(data), encoding="utf-8")
    assert "written by tpm-design 0.0.9" in refused(run, "sweep", study, "--resume", run)
    assert "not a run folder" in refused(run, "sweep", study, "--resume", tmp_path)


def test_a_search_and_a_sweep_are_not_taken_for_one_another(run: Path, tmp_path: Path) -> None:
    study = written(tmp_path, PLAN)
    told = refused(run, "optimize", study, "--resume", run)
    assert "This run is a sweep.\n  Resume it with `tpm-design sweep`." in told
    found = tpm_design("optimize", study, "--budget", "5", "--output", tmp_path / "search", "--quiet")
    assert found.code in (0, 3)
    search = next((tmp_path / "search").glob("*/*"))
    told = tpm_design("sweep", study, "--resume", search).errors
    assert "This run is a search.\n  Resume it with `tpm-design optimize`." in told


def test_latest_is_the_newest_run_of_the_same_shard(run: Path, second: Path, tmp_path: Path) -> None:
    study, results = written(tmp_path, PLAN), tmp_path / "results"
    shard = shutil.copytree(second, run.with_name("20990101T000000Z-aaaaaa"))
    for part, folder in (("1/1", run), ("2/3", shard)):
        outcome = tpm_design(
            "sweep", study, "--shard", part, "--resume", "latest", "--output", results, "--quiet"
        )
        assert (outcome.code, run_in(outcome)) == (0, folder)
    missing = tpm_design("sweep", study, "--shard", "1/3", "--resume", "latest", "--output", results)
    assert missing.code == 2
    assert "There is no run of small here" in missing.errors
    assert "There is no run of small here" in refused(
        run, "optimize", study, "--resume", "latest", "--output", results
    )


def test_resumed_shards_are_merged_as_others_are(whole: Path, second: Path, tmp_path: Path) -> None:
    others = [swept(tmp_path, "--shard", f"{index}/3", text=PLAN)[1] for index in (1, 3)]
    resumed = shutil.copytree(second, tmp_path / "resumed")
    cut(resumed, (resumed / "evaluations.jsonl").stat().st_size // 2)
    study = tmp_path / "study.yaml"
    assert tpm_design("sweep", study, "--shard", "2/3", "--resume", resumed, "--quiet").code == 0
    outcome = tpm_design("merge", *others, resumed, "--output", tmp_path / "merged")
    assert outcome.code == 0
    assert timeless(run_in(outcome)) == timeless(whole)
