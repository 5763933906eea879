"""`--dask`: the files of a run on threads, whichever worker or scheduler dies, and what is refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from importlib.metadata import version
from pathlib import Path
from typing import Any

import dask
import distributed  # noqa: F401 - fills dask.config: within config.set it would be taken out again
import psutil
import pytest
from clusters import environment, evaluated_or_killed, scheduler, worker
from command_line import STUDY, command, tpm_design, written
from test_resume import POLISHED, contents, only_run
from test_sweep import OWN_FILE

import tpm_design as tpm
from small_studies import CERTIFIED
from tpm_design.errors import RunStoppedError
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.problem import Design
from tpm_design.runs import dask_workers
from tpm_design.runs.entry import Entry
from tpm_design.runs.folder import entry_to_json, read_run
from tpm_design.study.sweep_points import sweep_points
from tpm_design.worker_threads import in_order

GRID = (
    "sweep: {type: grid, parameters: {f: {min: 200, max: 300, num: 7}, r: {num: 6}, k: {values: [1, 2]}}}\n"
)
LONG = POLISHED.replace("budget: 160, seed: 1, polish: nlopt.cobyla", "budget: 100000, seed: 1")
LONG = LONG.replace("{values: [1, 2]}", "{min: 1, max: 2}")

# evaluations are aborted as soon as they are known to be worse than others
SCREENED = POLISHED.replace("scipy.differential_evolution", "multistart").replace(
    ", polish: nlopt.cobyla", ""
)

pytestmark = [
    pytest.mark.skipif(os.name == "nt", reason="processes are killed otherwise there"),
    pytest.mark.xdist_group("dask"),
]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A scheduler with two workers."""
    with ExitStack() as stack:
        _, found = stack.enter_context(scheduler(tmp_path_factory.mktemp("scheduler")))
        for _ in range(2):
            stack.enter_context(worker(found, tmp_path_factory.mktemp("worker"), {}))
        yield found


# ---------------------------------------------------------------------------------------- the same files


@pytest.mark.parametrize("text", [POLISHED, CERTIFIED, SCREENED], ids=["polished", "certified", "screened"])
def test_a_search_is_the_same_on_any_number_of_workers(text: str, address: str, tmp_path: Path) -> None:
    study = written(tmp_path, text)
    runs = []
    for name, options in {
        "one": ("--workers", "1"),
        "two": ("--workers", "2"),
        "four": ("--workers", "4"),
        "dask": ("--dask", address),
    }.items():
        outcome = tpm_design("optimize", study, "--quiet", "--output", tmp_path / name / "results", *options)
        assert (outcome.code, outcome.errors) == (0, "")
        runs.append(only_run(tmp_path / name))
    first = contents(runs[0])
    assert all(contents(run) == first for run in runs[1:])
    assert json.loads((runs[-1] / "run.json").read_text(encoding="utf-8"))["workers"] == 2


def test_a_sweep_is_the_same_on_any_number_of_workers(address: str, tmp_path: Path) -> None:
    study = written(tmp_path, STUDY + GRID)
    runs = []
    for name, options in {"one": ("--workers", "1"), "dask": ("--dask", address)}.items():
        outcome = tpm_design("sweep", study, "--quiet", "--output", tmp_path / name / "results", *options)
        assert (outcome.code, outcome.errors) == (0, "")
        runs.append(only_run(tmp_path / name))
    assert contents(runs[0]) == contents(runs[1])
    assert "5 evaluated again in reverse order: the same" in outcome.output


def test_local_workers_have_one_thread_each_and_end_with_the_run(tmp_path: Path) -> None:
    problem = tpm.load_study(written(tmp_path)).problem
    before = set(psutil.Process().children(recursive=True))
    with dask_workers.dask_workers("local", 2) as cluster:
        names = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"]
        found = dict(cluster.as_they_end(environment, problem, names))
        assert found == dict.fromkeys(range(4), "1")
        # an evaluation would take a tenth longer
        assert dict(cluster.as_they_end(environment, problem, ["MALLOC_TRIM_THRESHOLD_"])) == {0: None}
        assert cluster.workers == 2
        begun = set(psutil.Process().children(recursive=True)) - before
        started = [child for child in begun if "spawn_main" in " ".join(child.cmdline())]
        assert len(started) == 2
    assert psutil.wait_procs(started, timeout=20)[1] == []


# ------------------------------------------------------------------------------------------- what dies


def designs_of(folder: Path) -> tuple[Any, list[Design]]:
    study = tpm.load_study(written(folder, STUDY + GRID))
    return study.problem, [point.design for point in sweep_points(study)]


def timeless(evaluation: Any) -> dict[str, Any]:
    return entry_to_json(Entry(0, evaluation)) | {"seconds": 0.0}


def test_a_worker_killed_in_the_middle_of_a_batch_loses_nothing(tmp_path: Path) -> None:
    problem, designs = designs_of(tmp_path)
    alone = [timeless(evaluate(problem, design)) for design in designs]
    killer = tmp_path / "killed"
    items = [(dict(design), str(killer) if place == 31 else "") for place, design in enumerate(designs)]
    with dask_workers.dask_workers("local", 2) as cluster:
        found = list(in_order(cluster.as_they_end(evaluated_or_killed, problem, items)))
    assert killer.exists()
    assert [timeless(evaluation) for evaluation in found] == alone


def test_designs_that_kill_every_worker_stop_the_run(tmp_path: Path) -> None:
    problem, designs = designs_of(tmp_path)
    items = [(dict(design), "always" if place == 3 else "") for place, design in enumerate(designs)]
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        dask_workers.dask_workers("local", 2) as cluster,
        pytest.raises(RunStoppedError, match="lost with one Dask worker after the other"),
        closing(cluster.as_they_end(evaluated_or_killed, problem, items)) as results,
    ):
        list(results)


def running_search(folder: Path, *options: str | Path, rows: int) -> subprocess.Popen[str]:
    """A search in a session of its own that has written some rows."""
    words = command("optimize", written(folder, LONG), "--output", folder / "results", "--quiet", *options)
    search = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while search.poll() is None:
        logs = list(folder.glob("results/*/*/evaluations.jsonl"))
        if logs and logs[0].read_bytes().count(b"\n") >= rows:
            return search
        time.sleep(0.01)
    raise AssertionError(search.communicate()[1])


def check_resumable(folder: Path, *options: str) -> None:
    """The log is whole, and with a budget that is soon spent it ends as if nothing had happened."""
    run = only_run(folder)
    log = (run / "evaluations.jsonl").read_bytes()
    assert log.endswith(b"\n")
    count = len(read_run(run).entries)
    assert count == log.count(b"\n")
    study, shorter = run / "study.yaml", f"budget: {count + 30}"
    text = study.read_text(encoding="utf-8")
    assert text.count("budget: 100000") == 1
    study.write_text(text.replace("budget: 100000", shorter), encoding="utf-8")
    outcome = tpm_design("optimize", study, "--resume", run, "--quiet", *options)
    assert (outcome.code, outcome.errors) == (0, "")
    asked = tpm.load_study(written(folder, LONG.replace("budget: 100000", shorter)))
    whole = asked.optimize(output=folder / "whole", workers=2)
    assert whole.folder is not None
    assert contents(run) == contents(whole.folder)


def test_a_search_goes_on_after_its_scheduler_was_killed(tmp_path: Path, address: str) -> None:
    with ExitStack() as stack:
        killed, mine = stack.enter_context(scheduler(tmp_path))
        stack.enter_context(worker(mine, tmp_path, {}))
        search = running_search(tmp_path, "--dask", mine, rows=40)
        killed.send_signal(signal.SIGKILL)
        output, errors = search.communicate()
    assert (search.returncode, output) == (130, "")
    assert errors.startswith("tpm-design: The connection to the Dask scheduler is lost.\n  Start the cluster")
    assert errors.count("\n") == 2
    check_resumable(tmp_path, "--dask", address)


def test_ctrl_c_ends_a_search_and_its_local_workers(tmp_path: Path) -> None:
    search = running_search(tmp_path, "--dask", "local", "--workers", "2", rows=20)
    begun = psutil.Process(search.pid).children(recursive=True)
    # as a terminal does, to all of them
    os.killpg(search.pid, signal.SIGINT)
    output, errors = search.communicate()
    assert (search.returncode, errors) == (130, "")
    assert "The search was interrupted." in output
    assert f"--resume {only_run(tmp_path)}" in output
    assert psutil.wait_procs(begun, timeout=20)[1] == []


# ------------------------------------------------------------------------------------------- refusals


def refused(folder: Path, *options: str, text: str = STUDY) -> str:
    """What is said; nothing is written."""
    outcome = tpm_design("optimize", written(folder, text), "--output", folder / "out", *options)
    assert (outcome.code, outcome.output) == (2, "")
    assert not (folder / "out").exists()
    return outcome.errors


@pytest.mark.parametrize("wrong", ["here", "tcp://here", "http://here:8786", "tcp://here:port", ""])
def test_what_is_no_address_is_refused(wrong: str, tmp_path: Path) -> None:
    assert "is no address of a Dask scheduler.\n  Write tcp://HOST:PORT" in refused(
        tmp_path, f"--dask={wrong}"
    )


def test_a_scheduler_that_does_not_answer_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_workers, "SECONDS_TO_ANSWER", 0.3)
    told = refused(tmp_path, "--dask", "tcp://127.0.0.1:1")
    assert "No Dask scheduler answers at tcp://127.0.0.1:1: " in told
    assert "Check the address" in told


def test_a_scheduler_without_workers_or_with_others_is_refused(tmp_path: Path) -> None:
    with scheduler(tmp_path) as (_, address):
        assert "has no workers.\n  Start some" in refused(tmp_path, "--dask", address)
        elsewhere = tmp_path / "elsewhere" / "tpm_design-9.9.dist-info"
        elsewhere.mkdir(parents=True)
        (elsewhere / "METADATA").write_text("Name: tpm-design\nVersion: 9.9\n", encoding="utf-8")
        path = os.pathsep.join([str(elsewhere.parent), *sys.path])
        with worker(address, tmp_path, {"PYTHONPATH": path}):
            told = refused(tmp_path, "--dask", address)
    assert f"has tpm-design 9.9, and this is {version('tpm-design')}: numbers may differ." in told
    assert f"Install tpm-design {version('tpm-design')} on all workers" in told


def test_a_program_without_dask_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "Dask is not installed.\n  Install it with `pip install 'tpm-design[dask]'`" in refused(
        tmp_path, "--dask", "local"
    )


def test_workers_of_a_cluster_that_runs_cannot_be_chosen(tmp_path: Path) -> None:
    assert "--workers: The workers of a Dask cluster that runs already" in refused(
        tmp_path, "--dask", "tcp://127.0.0.1:8786", "--workers", "2"
    )


def test_a_mechanism_from_a_file_is_not_sent_anywhere(tmp_path: Path) -> None:
    known = "from tpm_design.mechanisms.orthoglide import KIND as KNOWN"
    source = f"from dataclasses import replace\n{known}\nKIND = replace(KNOWN, name='own', title='own')\n"
    (tmp_path / "own.py").write_text(source, encoding="utf-8")
    study = written(tmp_path, OWN_FILE)
    # in a process of its own: once a plug-in is loaded, kernels go elsewhere
    words = command("sweep", study, "--allow-code", "--dask", "local", "--output", tmp_path / "out")
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "--dask: The mechanism of own is a file of its own" in done.stderr
    assert not (tmp_path / "out").exists()
