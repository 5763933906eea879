"""The method `multistart`: known optima, every local optimum listed, the same run however it is made."""

from __future__ import annotations

import csv
import itertools
import json
import shutil
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tpm_design as tpm
from small_studies import SHORTEST
from test_optimizers import BRANIN, HYPERBOLA, REDUCER, Case, MemoSearch
from tpm_design.baselines.reproduction import reproduce
from tpm_design.optimizers import optimizer
from tpm_design.optimizers.base import BudgetSpent, FloatArray, Outcomes, Search
from tpm_design.optimizers.descent import Walk, descend
from tpm_design.optimizers.places import looked_at
from tpm_design.optimizers.quadratic import Program, elastic_step
from tpm_design.optimizers.starts import SAME
from tpm_design.report.local_optima import optima_lines, other_optima_text
from tpm_design.report.reported import read_reported
from tpm_design.runs.entry import Entry
from tpm_design.runs.executors import Threads
from tpm_design.runs.folder import entry_to_json, read_run
from tpm_design.runs.optima import distinct_optima
from tpm_design.runs.optimize import SearchPlan, search, space_of
from tpm_design.study import load_study

STUDY = (
    SHORTEST
    + """\
optimizer: {method: multistart, budget: 300, seed: 1}
accuracy: {region_samples: 5}
"""
)


@dataclass
class NotingSearch(MemoSearch):
    """A search that keeps what its method calls optima."""

    optima: list[FloatArray] = field(default_factory=list)

    def in_growing_pieces(self) -> Search:
        return self

    def note_optima(self, points: FloatArray) -> None:
        self.optima = list(points)


def searched(case: Case, budget: int = 2000, seed: int = 1) -> NotingSearch:
    found = NotingSearch(case, budget)
    try:
        assert optimizer("multistart").run(found, seed).startswith("Converged")
    except BudgetSpent:
        assert found.spent
    return found


def scaled(x: FloatArray, lower: list[float], upper: list[float]) -> FloatArray:
    low = np.array(lower)
    place: FloatArray = low + x * (np.array(upper) - low)
    return place


def welded_beam(x: FloatArray) -> tuple[float, list[float]]:
    """Ragsdell and Phillips, 1976, as in Coello, 2000: 1.724852."""
    h, length, t, b = scaled(x, [0.1] * 4, [2.0, 10.0, 10.0, 2.0])
    radius = np.hypot(length / 2, (h + t) / 2)
    polar = 2 * np.sqrt(2) * h * length * (length**2 / 12 + ((h + t) / 2) ** 2)
    direct, bent = 6000 / (np.sqrt(2) * h * length), 6000 * (14 + length / 2) * radius / polar
    shear = np.sqrt(direct**2 + direct * bent * length / radius + bent**2)
    buckling = 4.013 * 30e6 * np.sqrt(t**2 * b**6 / 36) / 14**2 * (1 - t / 28 * np.sqrt(30 / 48))
    cost = 1.10471 * h**2 * length + 0.04811 * t * b * (14 + length)
    slacks = [13600 - shear, 30000 - 504_000 / (b * t**2), b - h, 5 - cost, h - 0.125]
    return cost, [float(s) for s in [*slacks, 0.25 - 2.1952 / (t**3 * b), buckling - 6000]]


def spring(x: FloatArray) -> tuple[float, list[float]]:
    """Arora, 1989: 0.012665233."""
    d, coil, n = scaled(x, [0.05, 0.25, 2.0], [2.0, 1.3, 15.0])
    curved = (4 * coil**2 - d * coil) / (12566 * (coil * d**3 - d**4)) if coil > d else 1e6
    return (n + 2) * coil * d**2, [
        coil**3 * n / (71785 * d**4) - 1,
        1 - curved - 1 / (5108 * d**2),
        140.45 * d / (coil**2 * n) - 1,
        1 - (d + coil) / 1.5,
    ]


PLATES = 99


def vessel(x: FloatArray) -> tuple[float, list[float]]:
    """Sandgren, 1990, plates in sixteenths of an inch: 6059.714 at 13 and 7 of them."""
    shell, head = (0.0625 * (1 + min(int(x[i] * PLATES), PLATES - 1)) for i in (0, 1))
    radius, length = scaled(x[2:], [10.0, 10.0], [200.0, 200.0])
    cost = 0.6224 * shell * radius * length + 1.7781 * head * radius**2
    cost += 3.1661 * shell**2 * length + 19.84 * shell**2 * radius
    volume = np.pi * radius**2 * length + 4 / 3 * np.pi * radius**3
    stress = [shell - 0.0193 * radius, head - 0.00954 * radius]
    return float(cost), [*map(float, stress), float(volume / 1_296_000 - 1), float(1 - length / 240)]


def heat_exchanger(x: FloatArray) -> tuple[float, list[float]]:
    """Avriel and Williams, 1971 (G10 of Michalewicz): 7049.248, six constraints of very unlike size."""
    a, b, c, d, e, f, g, h = scaled(x, [100.0, 1000.0, 1000.0] + [10.0] * 5, [10_000.0] * 3 + [1000.0] * 5)
    slacks = [1 - 0.0025 * (d + f), 1 - 0.0025 * (e + g - d), 1 - 0.01 * (h - e)]
    slacks += [a * f - 833.33252 * d - 100 * a + 83333.333, b * g - 1250 * e - b * d + 1250 * d]
    return float(a + b + c), [*map(float, slacks), float(c * h - 1_250_000 - c * e + 2500 * e)]


def kinked(x: FloatArray) -> tuple[float, list[float]]:
    """x + y where the least of three functions is ≥ 0, in one constraint: two lines, whose sum says
    x + y ≥ 1, and a hyperbola meet at x = y = 1/2."""
    a, b = float(x[0]), float(x[1])
    return a + b, [min(a * b - 0.25, a + 0.5 * b - 0.75, 0.5 * a + b - 0.75)]


BEAM = Case(welded_beam, (0.5,) * 4, 1.724852, constraints=7)
SPRING = Case(spring, (0.5,) * 3, 0.012665233, constraints=4)
VESSEL = Case(vessel, (0.5,) * 4, 6059.714, constraints=4, levels=(PLATES, PLATES, 0, 0))
EXCHANGER = Case(heat_exchanger, (0.5,) * 8, 7049.248, constraints=6)
KINKED = Case(kinked, (0.9, 0.2), 1.0, constraints=1)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "case", [BEAM, SPRING, VESSEL, EXCHANGER, REDUCER, KINKED], ids=lambda case: case.function.__name__
)
def test_published_optima_are_reached_within_the_default_budget(case: Case, seed: int) -> None:
    best, _ = searched(case, seed=seed).best()
    assert best == pytest.approx(case.optimum, rel=1e-4)


def test_an_easy_problem_ends_early_with_the_reason() -> None:
    found = NotingSearch(HYPERBOLA, 2000)
    said = optimizer("multistart").run(found, 1)
    assert said.endswith("independent local searches ended at the best objective.")
    assert len(found.log) < 400
    assert found.best()[0] == pytest.approx(1.0, rel=1e-6)


def test_every_minimum_is_noted_once_best_first() -> None:
    """Branin's three are equally good; tilted a little, they are in order."""

    def tilted(x: FloatArray) -> tuple[float, list[float]]:
        return BRANIN.function(x)[0] + 0.5 * float(x[0]), []

    noted = np.array(searched(Case(tilted, BRANIN.start, 0.0)).optima)
    assert noted == pytest.approx(np.array([[0.1239, 0.8183], [0.5428, 0.1517], [0.9617, 0.165]]), abs=2e-3)


def test_every_optimum_under_constraints_is_noted() -> None:
    """g24 of Floudas and Pardalos, 1990: its feasible set has two parts; −5.508 at (2.3295, 3.1785). Three
    more are local: two at corners, and (3, 0), where y ≤ 4 (x − 1)² (x − 3)² leaves nothing beside it."""

    def parted(x: FloatArray) -> tuple[float, list[float]]:
        a, b = 3.0 * float(x[0]), 4.0 * float(x[1])
        first = 2 * a**4 - 8 * a**3 + 8 * a**2 + 2 - b
        return -a - b, [first, 4 * a**4 - 32 * a**3 + 88 * a**2 - 96 * a + 36 - b]

    noted = searched(Case(parted, (0.5, 0.5), 0.0, constraints=2)).optima
    values = [parted(point)[0] for point in noted]
    assert values == pytest.approx([-5.508013, -4.41999, -4.05369, -3.0], rel=1e-4)
    assert noted[0] == pytest.approx([2.32952 / 3.0, 3.17849 / 4.0], abs=1e-4)


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(1, 6), min_size=1, max_size=4))
@settings(max_examples=20, deadline=None)
def test_what_is_discrete_alone_ends_at_the_enumerated_optimum(seed: int, levels: list[int]) -> None:
    table = np.random.default_rng(seed).random(levels)

    def looked_up(x: FloatArray) -> tuple[float, list[float]]:
        return float(table[tuple((x * np.array(levels)).astype(int))]), []

    case = Case(looked_up, (0.5,) * len(levels), 0.0, levels=tuple(levels))
    found = searched(case, budget=10**6, seed=1)
    assert found.best()[0] == table.min()
    assert len(found.log) <= table.size


@pytest.mark.parametrize("seed", range(3))
def test_mixed_problems_end_at_the_optimum_of_the_best_choice(seed: int) -> None:
    """A valley for each of 5 × 9 choices, its floor and its place drawn at random."""
    random = np.random.default_rng(seed)
    floors, places = random.random((5, 9)), random.random((5, 9, 2))

    def valleys(x: FloatArray) -> tuple[float, list[float]]:
        i, j = int(x[0] * 5), int(x[1] * 9)
        floor = floors[i, j] + 0.1 * (abs(i - 2) + abs(j - 5))
        return floor + float(np.sum((x[2:] - places[i, j]) ** 2)), []

    least = min(floors[i, j] + 0.1 * (abs(i - 2) + abs(j - 5)) for i, j in np.ndindex(5, 9))
    case = Case(valleys, (0.5,) * 4, 0.0, levels=(5, 9, 0, 0))
    assert searched(case, budget=4000, seed=seed).best()[0] == pytest.approx(least, abs=1e-6)


# ----------------------------------------------------------------------------------- one local search


def walked(case: Case, start: tuple[float, ...]) -> tuple[MemoSearch, FloatArray]:
    found = MemoSearch(case, 5000)

    def whole() -> Walk:
        here = yield from looked_at(np.array(start))
        landing = yield from descend(here, np.arange(len(start)), 0.2)
        ends.append(landing.place.point)

    ends: list[FloatArray] = []
    walk = whole()
    asked = next(walk)
    while not ends:
        try:
            asked = walk.send(found.evaluate(asked.points))  # type: ignore[attr-defined]
        except StopIteration:
            break
    return found, ends[0]


@given(st.lists(st.floats(0.1, 1.0), min_size=2, max_size=2))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_a_descent_ends_at_the_constrained_optimum_from_anywhere(start: list[float]) -> None:
    found, end = walked(HYPERBOLA, (start[0], start[1]))
    assert end == pytest.approx(np.array([0.5, 0.5]), abs=1e-4)
    assert min(found.values[end.tobytes()][1]) >= 0.0


def test_a_descent_does_not_halt_at_the_kinks_of_a_constraint() -> None:
    """Two lines and a hyperbola meet at the optimum. (On the diagonal slopes show one line alone.)"""
    random = np.random.default_rng(0)
    for start in random.uniform(0.05, 1.0, (40, 2)):
        found, end = walked(KINKED, (float(start[0]), float(start[1])))
        assert found.values[end.tobytes()][0] == pytest.approx(1.0, abs=1e-5)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=100, deadline=None)
def test_steps_of_quadratic_programs_are_optimal(seed: int) -> None:
    """Nothing nearby, and no other step at random, does better than the step by more than rounding."""
    random = np.random.default_rng(seed)
    size, count = int(random.integers(1, 8)), int(random.integers(0, 30))
    root = random.normal(size=(size, size))
    program = Program(
        root @ root.T + 10 ** random.uniform(-3, 0) * np.eye(size),
        random.normal(size=size),
        random.normal(size=count),
        random.normal(size=(count, size)),
        -random.random(size),
        random.random(size),
    )
    penalty = 10 ** random.uniform(0, 3)
    found = elastic_step(program, penalty)

    def price(step: FloatArray) -> float:
        missed = max(0.0, float(-(program.constraints + program.jacobian @ step).min(initial=0.0)))
        bowl = program.gradient @ step + 0.5 * step @ program.curvature @ step
        return float(bowl + penalty * missed + 0.5 * missed**2)

    least = price(found.step)
    assert np.all((found.step >= program.lower) & (found.step <= program.upper))
    assert np.all(found.multipliers >= 0.0)
    for radius in (1.0, 1e-2, 1e-4):
        for other in found.step + radius * random.normal(size=(30, size)):
            assert price(np.clip(other, program.lower, program.upper)) >= least - 1e-7 * (1.0 + abs(least))


# ------------------------------------------------------------------------------------- whole searches


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "small.yaml"
    path.write_text(STUDY, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def whole(study: Path) -> Path:
    run = tpm.load_study(study).optimize(output=study.parent / "results")
    assert run.folder is not None
    return run.folder


def contents(run: Path) -> tuple[bytes, list[dict[str, object]]]:
    """All of a finished run that may not depend on how it was made."""
    log = [entry_to_json(entry) for entry in read_run(run).entries]
    return (run / "designs.csv").read_bytes(), [{k: v for k, v in e.items() if k != "seconds"} for e in log]


@pytest.mark.parametrize("workers", [2, 4])
def test_any_number_of_workers_gives_the_same_run(
    workers: int, study: Path, whole: Path, tmp_path: Path
) -> None:
    again = tpm.load_study(study).optimize(workers=workers, output=tmp_path).folder
    assert again is not None
    assert contents(again) == contents(whole)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_a_run_that_was_cut_short_goes_on_to_the_same_end(
    share: float, study: Path, whole: Path, tmp_path: Path
) -> None:
    run = shutil.copytree(whole, tmp_path / "results" / "small" / whole.name)
    log = run / "evaluations.jsonl"
    text = log.read_bytes()
    log.write_bytes(text[: int(share * len(text))])
    (run / "designs.csv").unlink()
    tpm.load_study(study).optimize(resume=run)
    assert contents(run) == contents(whole)


def test_the_result_lists_an_optimum_for_each_choice(whole: Path) -> None:
    with (whole / "designs.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["rank"] for row in rows] == [str(n) for n in range(1, len(rows) + 1)]
    assert {row["k [-]"] for row in rows} == {"1.0", "2.0"}
    assert {row["status"] for row in rows} == {"feasible"}
    lengths = [float(row["total_link_length [mm]"]) for row in rows]
    assert lengths == sorted(lengths)
    summary = json.loads((whole / "run.json").read_text(encoding="utf-8"))
    assert summary["optima_ids"] == [int(row["id"]) for row in rows]
    assert summary["best_id"] == summary["optima_ids"][0]


def test_the_report_has_a_row_for_every_optimum(whole: Path) -> None:
    numbers = json.loads((whole / "run.json").read_text(encoding="utf-8"))["optima_ids"]
    reported = read_reported(whole)
    heading, *lines = optima_lines(reported)
    assert heading == f"## Local optima ({len(numbers)})"
    rows = [line.split(" | ")[:2] for line in lines if line.startswith("| ")][2:]
    assert rows == [[f"| {place}", str(number)] for place, number in enumerate(numbers, start=1)]


def test_what_the_command_says_of_the_other_optima(whole: Path) -> None:
    reported = read_reported(whole)
    entries = {entry.number: entry for entry in reported.run.entries}
    optima = [entries[n] for n in json.loads((whole / "run.json").read_text(encoding="utf-8"))["optima_ids"]]
    problem, units = reported.problem, reported.study.units
    lengths = [units.written(entry.evaluation.metrics["total_link_length"], "m") for entry in optima]
    assert other_optima_text(problem, units, optima[:1]) is None
    one = other_optima_text(problem, units, optima[:2])
    assert one == f"Another local optimum is in designs.csv: total_link_length {lengths[1]}."
    several = other_optima_text(problem, units, [*optima, optima[-1]])
    assert several is not None
    assert several.startswith(f"{len(optima)} other local optima are in designs.csv: total_link_length ")
    assert lengths[-1] in several


def test_reproducing_a_run_evaluates_every_optimum(whole: Path) -> None:
    found = reproduce(whole, allow_code=False)
    assert found.rows == len(json.loads((whole / "run.json").read_text(encoding="utf-8"))["optima_ids"])
    assert not found.exceedances


@given(st.lists(st.integers(0, 149), max_size=40), st.floats(0.0, 0.02))
@settings(max_examples=50, deadline=None)
def test_duplicates_are_merged(whole: Path, numbers: list[int], shift: float) -> None:
    problem, entries = load_study(whole / "study.yaml").problem, list(read_run(whole).entries)
    near = [
        replace(
            entries[n].evaluation,
            design={
                **entries[n].evaluation.design,
                "f": float(entries[n].evaluation.design["f"]) + 0.4 * shift,
            },
        )
        for n in numbers
    ]
    entries += [Entry(len(entries) + place, evaluation) for place, evaluation in enumerate(near)]
    best = min(
        (e for e in entries if e.evaluation.status == "feasible"),
        key=lambda e: (e.evaluation.metrics["total_link_length"], e.number),
    )
    noted = [entries[n].evaluation.design for n in numbers] + [e.design for e in near]
    space = space_of(problem)
    listed = distinct_optima(problem, space, best, entries, noted)
    assert listed[0] is best
    assert all(entry.evaluation.status == "feasible" for entry in listed)

    def same(one: Entry, other: Entry) -> bool:
        first, second = one.evaluation.design, other.evaluation.design
        return first["k"] == second["k"] and bool(
            np.abs(space.point(first) - space.point(second)).max() < SAME
        )

    assert not any(same(one, other) for one, other in itertools.combinations(listed, 2))
    feasible = [e for e in entries if e.evaluation.status == "feasible" and e.evaluation.design in noted]
    assert all(any(same(entry, known) for known in listed) for entry in feasible)


def test_other_methods_leave_their_best_design_alone(study: Path) -> None:
    problem = load_study(study).problem
    plan = SearchPlan("scipy.differential_evolution", 60, 1, None)
    result = search(problem, plan, executor=Threads(1), record=lambda entry: None)
    assert result.optima == (result.best,)


def test_a_batch_holds_the_points_of_several_local_searches() -> None:
    """So that workers help: more points abreast than one search asks for at a time."""
    found = searched(BEAM)
    assert max(found.batches[1:]) > 4
    assert np.mean([size for size in found.batches[1:] if size]) > 4


def test_outcomes_of_a_joint_batch_reach_those_who_asked() -> None:
    """An evaluator that takes points one by one gives the same path."""

    @dataclass
    class OneByOne(NotingSearch):
        def evaluate(self, points: FloatArray) -> Outcomes:
            parts = [super(OneByOne, self).evaluate(point[None, :]) for point in points]
            return Outcomes(
                np.concatenate([part.objective for part in parts]),
                np.concatenate([part.constraints for part in parts]),
                np.concatenate([part.merit for part in parts]),
            )

    together, apart = NotingSearch(BEAM, 300), OneByOne(BEAM, 300)
    for found in (together, apart):
        with pytest.raises(BudgetSpent):
            optimizer("multistart").run(found, 3)
    assert np.array(together.log).tobytes() == np.array(apart.log).tobytes()
