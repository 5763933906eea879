"""Runs that were cut short, by whatever it was, end as if nothing had happened."""

from __future__ import annotations

import csv
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
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from command_line import STUDY, command, tpm_design, written

import tpm_design as tpm
from small_studies import CERTIFIED, SHORTEST
from tpm_design.errors import UsageError
from tpm_design.runs.folder import entry_to_json, read_run
from tpm_design.runs.lock import FILE as LOCK
from tpm_design.runs.lock import sole_writer
from tpm_design.runs.optimize import POLISH_SHARE

# quick to evaluate, and with rows that are not ASCII
POLISHED = STUDY
for old, new in (
    ("budget: 60, seed: 1", "budget: 160, seed: 1, polish: nlopt.cobyla"),
    ("{metric: conditioning_min, min", "{metric: conditioning_min, label: 1/κ of motors, min"),
    ("{metric: coverage, min: 1}", "{metric: singularity_margin_min, min: 0.01}"),
    ("{metric: rotation_singularity_distance, min: 20}", "{metric: robot_size, max: 700}"),
    ("record: [{metric: velocity_max}]", "accuracy: {region_samples: 5}"),
):
    assert old in POLISHED
    POLISHED = POLISHED.replace(old, new)

SLOPED = f"{SHORTEST}optimizer: {{budget: 200, seed: 1}}\n"
"""Local searches along slopes, which are kept in the log."""

ARCHITECTURES = (("a", 100), ("b", 120))
SECONDS = "seconds [s]"

posix = pytest.mark.skipif(os.name == "nt", reason="signals, limits and forks are other ones there")


def contents(run: Path) -> tuple[bytes, list[dict[str, str]], list[dict[str, Any]], str]:
    """All of a finished run that may not depend on its interruptions."""
    with (run / "evaluations.csv").open(encoding="utf-8", newline="") as file:
        rows = [{k: v for k, v in row.items() if k != SECONDS} for row in csv.DictReader(file)]
    log = [entry_to_json(entry) for entry in read_run(run).entries]
    entries = [{k: v for k, v in entry.items() if k != "seconds"} for entry in log]
    return (run / "designs.csv").read_bytes(), rows, entries, (run / "study.yaml").read_text(encoding="utf-8")


def finished_run(folder: Path, text: str) -> Path:
    run = tpm.load_study(written(folder, text)).optimize(output=folder / "results")
    assert run.folder is not None
    return run.folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that nothing interrupted."""
    return finished_run(tmp_path_factory.mktemp("whole"), POLISHED)


@pytest.fixture(scope="module")
def proved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with rounds that nothing interrupted."""
    return finished_run(tmp_path_factory.mktemp("proved"), CERTIFIED)


@pytest.fixture
def run(whole: Path, tmp_path: Path) -> Path:
    """A copy of it in a folder of runs, to be spoilt."""
    return shutil.copytree(whole, tmp_path / "results" / "small" / whole.name)


def only_run(folder: Path) -> Path:
    (found,) = (path.parent for path in folder.glob("results/*/*/evaluations.jsonl"))
    return found


def cut(run: Path, length: int) -> None:
    """Leave the first bytes of the log, and no result: what a crash leaves behind."""
    log = run / "evaluations.jsonl"
    log.write_bytes(log.read_bytes()[:length])
    (run / "designs.csv").unlink()


# -------------------------------------------------------------------------------- real processes


@posix
@pytest.mark.parametrize("text", [POLISHED, SLOPED], ids=["polished", "multistart"])
def test_a_search_killed_twenty_times_ends_as_if_it_had_not_been(text: str, tmp_path: Path) -> None:
    whole = finished_run(tmp_path, text)
    program = Path(__file__).with_name("killed.py")
    (tmp_path / "killed").mkdir()
    words = [
        sys.executable,
        program,
        written(tmp_path / "killed", text),
        tmp_path / "killed/results",
        "20",
        "1",
    ]
    subprocess.run([str(word) for word in words], check=True)
    again = only_run(tmp_path / "killed")
    assert contents(again) == contents(whole)
    assert {path.name for path in again.iterdir()} == {path.name for path in whole.iterdir()}
    assert any("slopes" in entry for entry in contents(whole)[2]) == (text == SLOPED)


def started(*words: str | Path, run: Callable[[], list[Path]], rows: int) -> subprocess.Popen[str]:
    """A search in a process of its own that has written some rows."""
    search = subprocess.Popen(
        command(*words), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8"
    )
    while search.poll() is None:
        if any(path.read_bytes().count(b"\n") >= rows for path in run()):
            return search
        time.sleep(0.01)
    raise AssertionError(search.communicate()[1])


@posix
def test_after_ctrl_c_the_command_that_is_printed_goes_on(tmp_path: Path) -> None:
    results, study = tmp_path / "results", written(tmp_path, STUDY)
    search = started(
        *("optimize", study, "--budget", "150", "--seed", "5", "--output", results),
        run=lambda: list(results.glob("*/*/evaluations.jsonl")),
        rows=20,
    )
    search.send_signal(signal.SIGINT)
    output, _ = search.communicate()
    assert search.returncode == 130
    (following,) = re.findall(r"^Next: tpm-design (optimize .*)$", output, re.MULTILINE)
    outcome = tpm_design(*shlex.split(following))
    assert (outcome.code, "Best feasible design of 150 evaluations" in outcome.output) == (0, True)
    whole = tpm.load_study(study).optimize(seed=5, budget=150, output=tmp_path)
    assert whole.folder is not None
    assert contents(only_run(tmp_path)) == contents(whole.folder)


@posix
def test_a_run_has_one_writer_and_the_second_hears_who_it_is(tmp_path: Path) -> None:
    study, results = (
        written(tmp_path, STUDY.replace("{values: [1, 2]}", "{min: 1, max: 2}")),
        tmp_path / "results",
    )
    words = ("optimize", study, "--budget", "1000000", "--output", results)
    search = started(*words, run=lambda: list(results.glob("*/*/evaluations.jsonl")), rows=5)
    try:
        outcome = tpm_design(*words, "--resume", "latest")
        assert outcome.code == 2
        who = f"process {search.pid} on {socket.gethostname()} since 20"
        assert f"This run is being written already, by {who}" in outcome.errors
        assert search.poll() is None
    finally:
        search.kill()
        search.communicate()
    # the lock of a process that is gone holds nobody up
    folder = only_run(tmp_path)
    assert (folder / LOCK).exists()
    with sole_writer(folder):
        pass
    assert not (folder / LOCK).exists()


DISK_FULL = """
import resource, sys
import tpm_design as tpm
from tpm_design.cli import main

tpm.load_study(sys.argv[2]).optimize(budget=2)  # what is compiled now is not compiled with the limit
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop()), resource.RLIM_INFINITY))
main()
"""


def check_stopped(done: subprocess.CompletedProcess[str], folder: Path, whole: Path) -> None:
    """The search told what happened, its log is whole, and it goes on once there is room."""
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    assert re.search(r"tpm-design: \S+evaluations\.\w+: The run had to stop", done.stderr)
    assert f"--resume {folder}" in done.stderr
    log = (folder / "evaluations.jsonl").read_bytes()
    assert log.endswith(b"\n")
    assert len(read_run(folder).entries) == log.count(b"\n") > 5


@posix
def test_a_file_that_cannot_grow_stops_the_search_which_can_be_resumed(whole: Path, tmp_path: Path) -> None:
    study = written(tmp_path, POLISHED)
    size = (whole / "evaluations.jsonl").stat().st_size // 2
    words = [sys.executable, "-c", DISK_FULL, "optimize", study, "--output", tmp_path / "results", size]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    run = only_run(tmp_path)
    check_stopped(done, run, whole)
    assert "File too large" in done.stderr
    assert tpm_design("optimize", study, "--resume", run, "--quiet").code == 0
    assert contents(run) == contents(whole)


def carried_out(*words: str | Path) -> bool:
    """Whether a command exists and went well."""
    return (
        shutil.which(str(words[0])) is not None
        and not subprocess.run(words, check=False, capture_output=True).returncode
    )


@contextmanager
def small_disk(folder: Path) -> Iterator[None]:
    """A file system of its own with room for half a run."""
    folder.mkdir()
    if os.name == "nt" or not carried_out("mount", "-t", "tmpfs", "-o", "size=96k", "tmpfs", folder):
        pytest.skip("no file system can be mounted here")
    try:
        yield
    finally:
        carried_out("umount", folder)


def test_a_full_disk_stops_the_search_which_can_be_resumed(whole: Path, tmp_path: Path) -> None:
    study = written(tmp_path, POLISHED)
    with small_disk(tmp_path / "results"):
        words = command("optimize", study, "--output", tmp_path / "results")
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        run = only_run(tmp_path)
        check_stopped(done, run, whole)
        assert "No space left on device" in done.stderr
        # as long as it is full, nothing gets worse
        before = read_run(run).entries
        outcome = tpm_design("optimize", study, "--resume", run, "--quiet")
        assert outcome.code == 130
        assert set(map(id_of, before)) <= set(map(id_of, read_run(run).entries))
        assert carried_out("mount", "-o", "remount,size=4m", tmp_path / "results")
        assert tpm_design("optimize", study, "--resume", run, "--quiet").code == 0
        assert contents(run) == contents(whole)


def id_of(entry: Any) -> str:
    return json.dumps(entry_to_json(entry), sort_keys=True)


# ------------------------------------------------------------------------------- what is in the folder


@pytest.mark.parametrize("end", ["in a row", "in a character", "in zeros", "at the start"])
def test_a_row_that_was_cut_short_is_written_again(end: str, run: Path, whole: Path) -> None:
    log = (run / "evaluations.jsonl").read_bytes()
    third = [match.end() for match in re.finditer(rb"\n", log)][69]
    lengths = {
        "in a row": third + 50,
        "in a character": log.index("κ".encode(), third) + 1,
        "in zeros": third,
        "at the start": 0,
    }
    cut(run, lengths[end])
    if end == "in zeros":
        # what some file systems leave behind when the power fails
        with (run / "evaluations.jsonl").open("ab") as file:
            file.write(bytes(4096))
    (run / "evaluations.csv").write_bytes((run / "evaluations.csv").read_bytes()[:1000])
    kept = [entry.evaluation.seconds for entry in read_run(run).entries]
    assert len(kept) == (0 if end == "at the start" else 70)
    result = tpm.load_study(run / "study.yaml").optimize(resume=run)
    assert result.folder == run
    assert contents(run) == contents(whole)
    # answered from the log, not evaluated anew: a time is never measured twice the same
    assert [entry.evaluation.seconds for entry in read_run(run).entries][: len(kept)] == kept
    assert json.loads((run / "run.json").read_text(encoding="utf-8"))["resumed_after"] == len(kept)


def test_a_damaged_row_can_be_removed_and_is_evaluated_again(run: Path, whole: Path) -> None:
    log = run / "evaluations.jsonl"
    lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
    log.write_text("".join([*lines[:3], lines[3][:40] + "\n", *lines[4:]]), encoding="utf-8")
    study = tpm.load_study(run / "study.yaml")
    with pytest.raises(UsageError, match=r"evaluations\.jsonl:4: .*\n  Remove the line"):
        study.optimize(resume=run)
    log.write_text("".join([*lines[:3], *lines[4:]]), encoding="utf-8")
    study.optimize(resume=run)
    assert contents(run) == contents(whole)


def test_a_finished_run_is_written_again_as_it_is(run: Path, whole: Path) -> None:
    for _ in range(2):
        tpm.load_study(run / "study.yaml").optimize(resume=run, workers=2)
        for name in ("designs.csv", "evaluations.csv", "evaluations.jsonl", "study.yaml"):
            assert (run / name).read_bytes() == (whole / name).read_bytes()


@pytest.mark.parametrize("share", [0.4, 0.95])
def test_rounds_are_resumed_with_their_samples_and_proofs(share: float, proved: Path, tmp_path: Path) -> None:
    run = shutil.copytree(proved, tmp_path / "run")
    entries = read_run(proved).entries
    assert {entry.round for entry in entries} == {1, 2}
    cut(run, int(share * (run / "evaluations.jsonl").stat().st_size))
    (run / "certificate.json").unlink()
    kept = [entry.evaluation.seconds for entry in read_run(run).entries]
    result = tpm.load_study(run / "study.yaml").optimize(resume=run)
    assert contents(run) == contents(proved)
    assert [entry.evaluation.seconds for entry in read_run(run).entries][: len(kept)] == kept
    mine, theirs = (json.loads((f / "run.json").read_text(encoding="utf-8")) for f in (run, proved))
    for name in ("status", "ending", "best_id", "rounds", "certificate"):
        assert mine[name] == theirs[name]
    assert result.result.ending == "proved"


def test_designs_of_one_round_do_not_answer_for_another(proved: Path) -> None:
    """The first ten of round 2 are designs of round 1, judged by a sample more: by another violation."""
    entries = read_run(proved).entries
    first = {json.dumps(e.evaluation.design): e for e in entries if e.round == 1}
    again = [e for e in entries if e.round == 2][:10]
    assert {e.judged_by for e in first.values()} == {""}
    assert len({e.judged_by for e in again} | {""}) == 2
    changed = [
        e.evaluation.violation - first[json.dumps(e.evaluation.design)].evaluation.violation for e in again
    ]
    assert all(change >= 0.0 for change in changed)
    assert max(changed) > 0.0


# ------------------------------------------------------------------------------------ larger budgets


def test_a_larger_budget_ends_as_if_it_had_been_there_from_the_start(tmp_path: Path) -> None:
    study = tpm.load_study(written(tmp_path, STUDY))
    small, large = (study.optimize(budget=n, output=tmp_path / str(n)) for n in (40, 90))
    assert small.folder is not None
    assert large.folder is not None
    longer = study.optimize(budget=90, resume=small.folder)
    assert contents(small.folder) == contents(large.folder)
    assert longer.status == large.status


def test_what_a_former_polish_found_is_not_lost_with_a_larger_budget(run: Path, whole: Path) -> None:
    study = tpm.load_study(run / "study.yaml").searched_with(budget=240)
    larger = study.optimize()
    resumed = study.optimize(resume=run)
    before, after = read_run(whole), read_run(run)
    designs = [e.evaluation.design for e in after.entries]
    assert designs[:240] == [e.evaluation.design for e in larger.result.entries]
    assert all(e.evaluation.design in designs for e in before.entries)
    assert len(designs) <= 240 + POLISH_SHARE * 160
    assert [e.number for e in after.entries] == list(range(len(designs)))
    assert resumed.best is not None
    for other in (larger.best, before.best.evaluation if before.best else None):
        assert other is not None
        assert resumed.best.metrics["total_link_length"] <= other.metrics["total_link_length"]
    # and once more it is the same
    content = contents(run)
    study.optimize(resume=run)
    assert contents(run) == content


# ----------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("old", "new", "different"),
    [
        ("max: 500, initial: 250}\n    r", "max: 510, initial: 250}\n    r", "mechanism.parameters.f.max"),
        ("seed: 1", "seed: 2", "optimizer.seed"),
        ("polish: nlopt.cobyla", "polish: nlopt.sbplx", "optimizer.polish"),
        (", polish: nlopt.cobyla", "", "optimizer.polish"),
        ("max: 700}", "max: 701}", "constraints[3].max"),
        ("size: [70, 70, 70]", "size: [70, 70, 71]", "region.size[3]"),
        ("region_samples: 5", "region_samples: 6", "accuracy.region_samples"),
        ("optimizer:", "record: [{metric: velocity_max}]\noptimizer:", "record"),
    ],
)
def test_another_study_is_refused_and_the_difference_named(
    old: str, new: str, different: str, run: Path, tmp_path: Path
) -> None:
    assert POLISHED.count(old) == 1
    before = contents(run)
    study = written(tmp_path, POLISHED.replace(old, new))
    outcome = tpm_design("optimize", study, "--resume", run)
    assert (outcome.code, outcome.output) == (2, "")
    assert f"The run belongs to another study; different: {different}." in outcome.errors
    assert f"Resume it with {run / 'study.yaml'}" in outcome.errors
    assert contents(run) == before


def test_another_version_and_a_smaller_budget_are_refused(run: Path, tmp_path: Path) -> None:
    study = written(tmp_path, POLISHED)
    outcome = tpm_design("optimize", study, "--budget", "159", "--resume", run)
    assert outcome.code == 2
    assert "--budget 160 or more" in outcome.errors
    summary = run / "run.json"
    data = json.loads(summary.read_text(encoding="utf-8"))
    data["versions"]["tpm-design"] = "0.0.9"
    summary.write_text(json.dumps(data), encoding="utf-8")
    outcome = tpm_design("optimize", study, "--resume", run)
    assert outcome.code == 2
    assert f"written by tpm-design 0.0.9, and this is {version('tpm-design')}" in outcome.errors
    summary.unlink()
    assert "an unknown version" in tpm_design("optimize", study, "--resume", run).errors


def test_latest_is_the_newest_run_of_this_study(run: Path, tmp_path: Path) -> None:
    study, results = written(tmp_path, POLISHED), tmp_path / "results"
    newer = shutil.copytree(run, run.with_name("20990101T000000Z-aaaaaa"))
    shutil.copytree(run, results / "other" / "20990202T000000Z-aaaaaa")
    run_json = (run / "run.json").read_bytes()
    outcome = tpm_design("optimize", study, "--resume", "latest", "--output", results)
    assert f"Run: {newer}\n" in outcome.output
    assert (run / "run.json").read_bytes() == run_json
    missing = tpm_design("optimize", study, "--resume", "latest", "--output", tmp_path / "elsewhere")
    assert missing.code == 2
    assert "There is no run of small here" in missing.errors
    assert "not a run folder" in tpm_design("optimize", study, "--resume", results).errors
    with pytest.raises(UsageError, match="output="):
        tpm.load_study(study).optimize(resume="latest")


def test_a_comparison_resumes_what_had_begun(tmp_path: Path) -> None:
    mechanism = re.search(r"(?<=^mechanism:\n)(?:  .*\n)+", STUDY, re.MULTILINE)
    assert mechanism is not None
    inner = mechanism[0].replace("\n ", "\n     ")
    parts = [
        f"  {x}:\n    mechanism:\n    {inner.replace('db: 100', f'db: {db}')}" for x, db in ARCHITECTURES
    ]
    text = STUDY.replace(f"mechanism:\n{mechanism[0]}", "architectures:\n" + "".join(parts))
    study = written(tmp_path, text)
    words = ("optimize", study, "--budget", "8", "--output", tmp_path / "results", "--quiet")
    assert tpm_design(*words).code in (0, 3)
    first, second = (next(tmp_path.glob(f"results/small-{label}/*")) for label in "ab")
    before = contents(second)
    shutil.rmtree(second)
    assert tpm_design(*words, "--resume", "latest").code in (0, 3)
    assert list(first.parent.iterdir()) == [first]
    assert json.loads((first / "run.json").read_text(encoding="utf-8"))["resumed_after"] == 8
    assert contents(next(second.parent.iterdir())) == before
    outcome = tpm_design(*words, "--resume", first)
    assert outcome.code == 2
    assert "--resume latest" in outcome.errors


# --------------------------------------------------------------------------------------------- lock


def test_the_lock_is_held_by_one_and_gone_afterwards(tmp_path: Path) -> None:
    (tmp_path / LOCK).write_text("left behind by a crash", encoding="utf-8")
    with sole_writer(tmp_path):
        with pytest.raises(UsageError, match=f"by process {os.getpid()} on "), sole_writer(tmp_path):
            pass
        assert (tmp_path / LOCK).exists()
    assert list(tmp_path.iterdir()) == []
