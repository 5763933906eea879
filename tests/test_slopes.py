"""Slopes of whole searches: of the cube's coordinates, of samples, in the log, and what they save."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import tpm_design as tpm
from tpm_design.evaluation.result import Evaluation
from tpm_design.metrics.base import Measurement
from tpm_design.metrics.context import Context
from tpm_design.optimizers.base import BudgetSpent, Outcomes, Question, Slopes
from tpm_design.optimizers.watch import Watch
from tpm_design.problem import Problem, Sample
from tpm_design.runs.entry import Entry
from tpm_design.runs.executors import Threads
from tpm_design.runs.folder import entry_from_json, entry_to_json
from tpm_design.runs.log import EvaluationLog
from tpm_design.runs.optimize import SearchPlan, search, view_of
from tpm_design.runs.unit_search import UnitSearch

STUDY = """\
version: 1
name: slopes
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters:
    db: {ratio: f, min: 0.05, max: 0.4}
    dp: {ratio: db, min: 0.2, max: 0.9, scale: log}
    f: {min: 300, max: 700, scale: log}
    r: {equals: f}
    k: {values: [1, 2]}
  mode: best
region: {type: box, size: [60, 60, 60], center: free}
objectives: [{metric: total_link_length, sense: minimize}]
constraints:
  - {metric: coverage, min: 1}
  - {metric: conditioning_min, min: 0.2}
  - {metric: velocity_max, max: 2}
  - {metric: robot_size, max: 1400}
  - {metric: actuator_range, max: 90}
optimizer: {budget: 400, seed: 1}
"""


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    path = tmp_path_factory.mktemp("slopes") / "study.yaml"
    path.write_text(STUDY, encoding="utf-8")
    return tpm.load_study(path).problem


def view(problem: Problem) -> UnitSearch:
    log = EvaluationLog(problem, executor=Threads(1))
    whole = view_of(log, 10_000)
    # pieces are known as soon as a design in the log has them
    whole.evaluate(np.vstack([whole.start, np.random.default_rng(0).random((8, whole.dimension))]))
    return whole.in_pieces()


def with_slopes(seen: UnitSearch, point: np.ndarray) -> Outcomes:
    (found,) = seen.answers(deque([Question(point[None, :], sloped=True)]))
    return found


def slopes_at(seen: UnitSearch, point: np.ndarray) -> Slopes:
    (found,) = with_slopes(seen, point).slopes
    assert found is not None
    return found


def agree_where_smooth(seen: UnitSearch, points: Sequence[np.ndarray], *, least: float) -> None:
    """Slopes are the difference quotients wherever those to both sides agree, as ``least`` a share do."""
    step, smooth, all_of_them = 1e-5, 0, 0
    for point in points:
        here, slopes = seen.evaluate(point), slopes_at(seen, point)
        for number, count in enumerate(seen.levels):
            ways = [point + sign * step * np.eye(seen.dimension)[number] for sign in (-1.0, 1.0)]
            if count:
                assert not slopes.gradient[number]
                assert not slopes.jacobian[:, number].any()
                continue
            below, above = seen.evaluate(ways[0]), seen.evaluate(ways[1])
            for row in range(-1, seen.constraint_count):
                values = [
                    float(found.objective[0] if row < 0 else found.constraints[0, row])
                    for found in (below, here, above)
                ]
                before, after = (values[1] - values[0]) / step, (values[2] - values[1]) / step
                slope = slopes.gradient[number] if row < 0 else slopes.jacobian[row, number]
                if row >= 0 and not slopes.jacobian[row].any():
                    # determinants where a limb is stretched, in a region that is out of reach
                    assert here.constraints[0].min() < 0.0
                    continue
                all_of_them += 1
                if abs(after - before) <= 1e-3 * max(1.0, abs(after)):
                    smooth += 1
                    assert slope == pytest.approx(0.5 * (before + after), abs=2e-3 * max(1.0, abs(after)))
    assert smooth >= least * all_of_them


def inner_points(dimension: int, count: int, seed: int) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).uniform(0.01, 0.99, (count, dimension)))


def test_slopes_go_by_the_coordinates_of_the_cube(problem: Problem) -> None:
    """Through logarithms, ratios of ratios, ties, and centres on the side of the mode's octant."""
    seen = view(problem)
    agree_where_smooth(seen, inner_points(seen.dimension, 25, 1), least=0.95)


def test_slopes_that_are_known_serve_a_search_of_a_part_of_the_ranges(problem: Problem) -> None:
    """As a polish does: the same designs, other coordinates."""
    # of lengths alone, and halves, so that the design comes back from its coordinates with the same bits
    linear = tuple(
        replace(variable, ratio_of=None, scale="linear", lower=0.25, upper=0.5)
        if variable.name in ("db", "dp", "f")
        else variable
        for variable in problem.variables
    )
    seen = view(replace(problem, variables=linear))
    point = np.full(seen.dimension, 0.25)
    whole = slopes_at(seen, point)
    design = seen.space.design(point)
    (entry,) = [entry for entry in seen.log.entries if entry.evaluation.design == design]
    part = seen.continuous_near(entry, 0.125, 10_000)
    count = len(seen.log.entries)
    narrow = slopes_at(part, part.space.point(design))
    assert len(seen.log.entries) == count
    continuous = [number for number, levels in enumerate(seen.levels) if not levels]
    assert narrow.gradient == pytest.approx(0.25 * whole.gradient[continuous], rel=1e-5, abs=1e-9)
    assert narrow.jacobian == pytest.approx(0.25 * whole.jacobian[:, continuous], rel=1e-5, abs=1e-9)
    agree_where_smooth(part, inner_points(part.dimension, 4, 7), least=0.9)


def test_slopes_of_samples(problem: Problem) -> None:
    """Other machines than the nominal one, over the region and at a pose, judged with a margin."""
    offsets = {"f": (1e-3, 0.0, -1e-3)}
    samples = (
        Sample("coverage", offsets, None, 1e-3),
        Sample("conditioning_min", offsets, (0.03, -0.03, 0.03), 0.01),
        Sample("velocity_max", {}, (0.0, 0.03, 0.03), 0.01),
    )
    sampled = view(replace(problem, samples=samples))
    assert sampled.constraint_count > view(problem).constraint_count
    agree_where_smooth(sampled, inner_points(sampled.dimension, 12, 2), least=0.9)


def test_what_is_not_known_to_first_order_has_no_slopes(problem: Problem) -> None:
    *others, last = problem.constraints

    def measured(context: Context, options: Mapping[str, Any]) -> Measurement:
        return replace(last.metric.compute(context, options), near=None)

    kept_to_itself = replace(last, metric=replace(last.metric, compute=measured))
    seen = view(replace(problem, constraints=(*others, kept_to_itself)))
    point = inner_points(seen.dimension, 1, 3)[0]
    assert with_slopes(seen, point).slopes == (None,)


@pytest.mark.parametrize("workers", [1, 3])
def test_what_is_asked_between_answers_comes_in_its_turn(problem: Problem, workers: int) -> None:
    """New designs, known ones, slopes of known ones; what is beyond the budget ends it, after the rest."""
    seen = view(problem)
    first, *others, last = inner_points(seen.dimension, 5, 8)
    expected = {point.tobytes(): seen.evaluate(point) for point in (first, *others)}
    with closing(Threads(workers)) as threads:
        log = EvaluationLog(problem, executor=threads)
        asking = replace(seen, log=log, limit=4)
        later = [
            [Question(others[0][None, :]), Question(first[None, :], sloped=True)],
            [Question(np.array([first, others[0], others[1]]))],
            [Question(others[0][None, :], sloped=True)],
            [Question(others[2][None, :]), Question(last[None, :]), Question(first[None, :])],
        ]
        asked = [Question(first[None, :])]
        questions, found = deque(asked), []
        with closing(asking.answers(questions)) as answers, pytest.raises(BudgetSpent):
            for outcomes in answers:
                found.append(outcomes)
                more = later.pop(0) if later else []
                asked += more
                questions += more
    assert len(found) == len(asked) - 2
    assert len(log.entries) == 4
    for question, outcomes in zip(asked, found, strict=False):
        assert outcomes.objective.tolist() == [expected[p.tobytes()].objective[0] for p in question.points]
        assert all((slopes is not None) == question.sloped for slopes in outcomes.slopes)
    assert [seen.space.design(point) for point in (first, *others)] == [
        entry.evaluation.design for entry in log.entries
    ]


def timeless(evaluation: Evaluation) -> dict[str, Any]:
    return entry_to_json(Entry(0, evaluation)) | {"seconds": 0.0}


def test_slopes_are_no_evaluations_and_change_none(problem: Problem) -> None:
    seen = view(problem)
    point = inner_points(seen.dimension, 1, 4)[0]
    plain = seen.evaluate(point)
    count = len(seen.log.entries)
    before = seen.log.entries[-1].evaluation
    again = with_slopes(seen, point)
    after = seen.log.entries[-1].evaluation
    assert len(seen.log.entries) == count
    assert before.slopes is None
    assert after.slopes is not None
    assert timeless(replace(after, slopes=None)) == timeless(before)
    assert again.constraints.tolist() == plain.constraints.tolist()


def test_derivatives_of_libraries_come_without_evaluations(problem: Problem) -> None:
    watch = Watch(view(problem))
    log = watch.search.log  # type: ignore[attr-defined]
    for number, point in enumerate(inner_points(watch.dimension, 3, 5)):
        count = len(log.entries)
        tangents = watch.tangents(point)
        assert len(log.entries) == count + 1, number
        assert tangents.slopes.jacobian.shape == (watch.constraint_count, watch.dimension)


class Counting:
    """Evaluates what it is asked, and counts what is not screened: of that a log may hold more than a cutoff
    asks for."""

    def __init__(self) -> None:
        self.asked = 0
        self.workers = 1

    def as_they_end(
        self, task: partial[Any], problem: Problem, items: Sequence[Any]
    ) -> Generator[tuple[int, Any]]:
        return self.from_queue(task, problem, deque(items))

    def from_queue(
        self, task: partial[Any], problem: Problem, queue: deque[Any]
    ) -> Generator[tuple[int, Any]]:
        place = 0
        while queue:
            self.asked += task.keywords["cutoff"] is None
            yield place, task(problem, queue.popleft())
            place += 1

    def close(self) -> None: ...


def test_a_replay_finds_its_slopes_in_the_log(problem: Problem) -> None:
    """Nothing is evaluated again, and a search that was cut short goes on as if it had not been."""
    plan = SearchPlan("multistart", 400, 1, None)
    whole = search(problem, plan, executor=Threads(1), record=lambda entry: None).entries
    stored = [entry_from_json(entry_to_json(entry)) for entry in whole]
    assert [timeless(e.evaluation) for e in stored] == [timeless(e.evaluation) for e in whole]
    assert sum(entry.evaluation.slopes is not None for entry in stored) > 20
    for kept in (len(stored), len(stored) // 2):
        counting = Counting()
        resumed = search(
            problem, plan, executor=counting, record=lambda entry: None, stored=stored[:kept]
        ).entries
        assert [timeless(e.evaluation) for e in resumed] == [timeless(e.evaluation) for e in whole]
        assert (counting.asked == 0) == (kept == len(stored))
