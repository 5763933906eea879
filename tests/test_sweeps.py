"""Sweeps: which designs a plan stands for, and what is promised of their evaluation."""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tpm_design.errors import UsageError
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import Measurement
from tpm_design.metrics.context import Context
from tpm_design.problem import Goal, Problem
from tpm_design.runs.entry import Entry
from tpm_design.runs.executors import Threads
from tpm_design.runs.folder import entry_to_json
from tpm_design.runs.sweeps import REPEATED_EVERY, Failure, Shard, SweepResult, failures, sweep
from tpm_design.study import Study, load_study
from tpm_design.study.sweep_points import held_values, plan_size, sweep_points

TEXT = """\
version: 1
name: swept
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters:
    db: {min: 80, max: 120}
    dp: 60
    f: {min: 100, max: 500, initial: 250.1}
    r: {equals: f}
    k: {values: [2, 1]}
  mode: MODE
region: {type: box, size: [70, 70, 70], center: CENTER}
objectives:
  - {metric: total_link_length, sense: minimize}
sweep: PLAN
"""
GRID = "{type: grid, parameters: {k: {values: [1, 2]}, f: {num: 3}}}"


def study_of(
    folder: Path, plan: str, mode: str = '{octant: "+++", elbows: "+++"}', center: str = "[150, 150, 150]"
) -> Study:
    path = folder / "study.yaml"
    text = TEXT.replace("PLAN", plan).replace("MODE", mode).replace("CENTER", center)
    path.write_text(text, encoding="utf-8")
    return load_study(path)


def test_the_last_axis_of_a_grid_runs_fastest_and_the_rest_is_held(tmp_path: Path) -> None:
    study = study_of(tmp_path, GRID)
    points = sweep_points(study)
    # in the order of the mechanism's parameters
    assert [(p.design["f"], p.design["k"]) for p in points] == [
        (0.1, 1.0),
        (0.1, 2.0),
        (0.3, 1.0),
        (0.3, 2.0),
        (0.5, 1.0),
        (0.5, 2.0),
    ]
    assert [p.number for p in points] == list(range(6))
    for point in points:
        assert point.design["db"] == 0.1
        assert point.design["r"] == point.design["f"]
    assert held_values(study) == ("db = 100 mm (the middle of its range)",)


def test_a_list_holds_what_a_point_does_not_name(tmp_path: Path) -> None:
    study = study_of(tmp_path, "{type: list, points: [{f: 200}, {dp: 50, k: 1}, {f: 200}]}")
    first, second, third = (point.design for point in sweep_points(study))
    assert (first["f"], first["r"], first["dp"], first["k"]) == (0.2, 0.2, 0.06, 2.0)
    assert (second["f"], second["r"], second["dp"], second["k"]) == (0.2501, 0.2501, 0.05, 1.0)
    assert third == first


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
def test_samples_fill_every_interval_of_every_range_once(method: str, tmp_path: Path) -> None:
    """Of 2ᵐ points each of 2ᵐ equal intervals holds one: a net's property, and a Latin hypercube's."""
    study = study_of(tmp_path, f"{{type: {method}, samples: 64, parameters: [f, db, k]}}")
    designs = [point.design for point in sweep_points(study)]
    for name, low, high in (("f", 0.1, 0.5), ("db", 0.08, 0.12)):
        shares = [(float(d[name]) - low) / (high - low) for d in designs]
        assert sorted(math.floor(64 * share) for share in shares) == list(range(64))
    assert sum(d["k"] == 1.0 for d in designs) == 32
    links, bases = (np.array([float(d[name]) for d in designs]) for name in ("f", "db"))
    assert abs(np.mean((links - links.mean()) * (bases - bases.mean()))) < 0.3 * links.std() * bases.std()


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
def test_samples_follow_from_the_plans_seed_alone(method: str, tmp_path: Path) -> None:
    one, same, other = (
        sweep_points(study_of(tmp_path, f"{{type: {method}, samples: 11, seed: {seed}}}"))
        for seed in (3, 3, 4)
    )
    assert one == same
    assert len(one) == 11
    assert {p.design["f"] for p in one}.isdisjoint(p.design["f"] for p in other)


def test_a_longer_sobol_plan_goes_on_where_a_shorter_one_ends(tmp_path: Path) -> None:
    short, long = (
        sweep_points(study_of(tmp_path, f"{{type: sobol, samples: {count}}}")) for count in (5, 64)
    )
    assert long[:5] == short


def test_a_mirrored_centre_lies_in_the_octant_of_the_mode(tmp_path: Path) -> None:
    plan = "{type: sobol, samples: 64, parameters: [center_x, mode]}"
    for point in sweep_points(study_of(tmp_path, plan, mode="best", center="free")):
        signs = str(point.design["mode"]).split()[0]
        for sign, axis in zip(signs, "xyz", strict=True):
            assert (float(point.design[f"center_{axis}"]) > 0.0) == (sign == "+")


@pytest.mark.parametrize("count", [1, 2, 3, 7, 80])
def test_shards_are_a_partition_of_the_plan(count: int, tmp_path: Path) -> None:
    study = study_of(tmp_path, "{type: latin_hypercube, samples: 50}")
    assert study.sweep is not None
    assert plan_size(study.sweep) == 50
    shards = [sweep_points(study, Shard(index + 1, count)) for index in range(count)]
    joined = sorted(itertools.chain(*shards), key=lambda point: point.number)
    assert tuple(joined) == sweep_points(study)
    assert {len(shard) for shard in shards} <= {50 // count, -(-50 // count)}


@pytest.mark.parametrize(("index", "count"), [(0, 3), (4, 3), (1, 0)])
def test_shards_that_cannot_be(index: int, count: int) -> None:
    with pytest.raises(UsageError, match=f"no shard {index}/{count}"):
        Shard(index, count)


def run(problem: Problem, study: Study, workers: int) -> tuple[SweepResult, list[Entry]]:
    recorded: list[Entry] = []
    with closing(Threads(workers)) as threads:
        result = sweep(problem, sweep_points(study), executor=threads, record=recorded.append)
    return result, recorded


def timeless(entry: Entry) -> dict[str, Any]:
    return entry_to_json(entry) | {"seconds": 0.0}


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_every_point_is_evaluated_whatever_the_number_of_workers(workers: int, tmp_path: Path) -> None:
    study = study_of(tmp_path, "{type: sobol, samples: 60}")
    result, recorded = run(study.problem, study, workers)
    alone = [Entry(p.number, evaluate(study.problem, p.design)) for p in sweep_points(study)]
    assert [timeless(entry) for entry in result.entries] == [timeless(entry) for entry in alone]
    assert sorted(recorded, key=lambda entry: entry.number) == list(result.entries)
    assert (result.ending, result.disagreements, dict(result.faults)) == ("finished", (), {})
    assert result.repeated == -(-60 // REPEATED_EVERY)


def measured_by(problem: Problem, function: Any) -> Problem:
    """The problem with another measure of its objective."""
    metric = replace(METRICS["total_link_length"], compute=function)
    return replace(problem, objectives=(Goal(metric, "total", sense="minimize"),))


@pytest.mark.parametrize("workers", [1, 2])
def test_a_bug_at_some_points_hides_no_row(workers: int, tmp_path: Path) -> None:
    def breaks(context: Context, options: Mapping[str, Any]) -> Measurement:
        if context.mechanism.parameters["f"][0] > 0.4:
            raise ZeroDivisionError("no such\nlength")
        if context.mechanism.parameters["f"][0] > 0.3:
            raise KeyError("x" * 1000)
        return Measurement(1.0, 0.0)

    study = study_of(tmp_path, "{type: grid, parameters: {f: {min: 100, max: 500, num: 41}}}")
    result, recorded = run(measured_by(study.problem, breaks), study, workers)
    assert len(recorded) == len(result.entries) == 41
    assert [e.evaluation.status for e in result.entries] == ["feasible"] * 21 + ["failed"] * 20
    # an impossible number is the design's fault, any other exception the program's
    long, short = failures(result.entries)
    assert short == Failure("no such\nlength", 10, 31)
    assert long.reason.startswith("KeyError: 'xxx")
    assert (long.count, long.first, len(long.reason)) == (10, 21, 300)
    assert sorted(result.faults) == list(range(21, 31))
    assert isinstance(result.faults[21], KeyError)
    assert result.disagreements == ()


@pytest.mark.parametrize("workers", [1, 2])
def test_an_evaluation_that_depends_on_what_came_before_is_found_out(workers: int, tmp_path: Path) -> None:
    calls, lock = itertools.count(), threading.Lock()

    def forgetful(context: Context, options: Mapping[str, Any]) -> Measurement:
        with lock:
            drift = next(calls)
        return Measurement(1.0 + drift * 2.0**-52, 0.0)

    study = study_of(tmp_path, "{type: grid, parameters: {f: {num: 40}}}")
    result, _ = run(measured_by(study.problem, forgetful), study, workers)
    assert result.disagreements == (0, 19, 38)


@pytest.mark.parametrize("workers", [1, 2])
def test_an_interruption_leaves_what_was_evaluated(workers: int, tmp_path: Path) -> None:
    study = study_of(tmp_path, "{type: grid, parameters: {f: {num: 40}}}")
    recorded: list[Entry] = []

    def record(entry: Entry) -> None:
        recorded.append(entry)
        if len(recorded) == 10:
            raise KeyboardInterrupt

    with closing(Threads(workers)) as threads:
        result = sweep(study.problem, sweep_points(study), executor=threads, record=record)
    assert result.ending == "interrupted"
    assert list(result.entries) == sorted(recorded, key=lambda entry: entry.number)
    assert (len(recorded), result.repeated) == (10, 0)
