"""Every registered optimiser on problems with known optima, through a real search: memo, budget, merit."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from counting_search import CountingSearch, run_to_its_end
from tpm_design.errors import RefusedError, UsageError
from tpm_design.optimizers import OPTIMIZERS, check_pair, optimizer
from tpm_design.optimizers.base import BudgetSpent, FloatArray, Optimizer, Outcomes
from tpm_design.optimizers.refusal import refusal
from tpm_design.optimizers.watch import DIFFERENCE_STEP, Watch

Function = Callable[[FloatArray], tuple[float, list[float]]]


@dataclass(frozen=True)
class Case:
    """A problem of the unit cube with its least feasible value."""

    function: Function
    start: tuple[float, ...]
    optimum: float
    constraints: int = 0
    levels: tuple[int, ...] = ()
    penalty: float = 10.0


@dataclass
class MemoSearch(CountingSearch[float]):
    """A search for the least feasible value."""

    case: Case

    def evaluate(self, points: FloatArray) -> Outcomes:
        objective, constraints = self.measured(points)
        violation = np.maximum(0.0, -constraints).sum(axis=1)
        return Outcomes(objective, constraints, objective + self.case.penalty * violation)

    def best(self) -> tuple[float, FloatArray]:
        """The least feasible value and its design, of several the first."""
        return min(self.feasible(), key=lambda found: found[0])


def searched(method: Optimizer, case: Case, budget: int, seed: int = 1) -> MemoSearch:
    return run_to_its_end(method, MemoSearch(case, budget), seed)


def bowl(x: FloatArray) -> tuple[float, list[float]]:
    return float(np.sum(np.array([1.0, 3.0, 10.0]) * (x - np.array([0.3, 0.7, 0.9])) ** 2)), []


def hyperbola(x: FloatArray) -> tuple[float, list[float]]:
    """x + y with x y ≥ 1/4: the least value, 1, at x = y = 1/2."""
    return float(x[0] + x[1]), [float(4 * x[0] * x[1] - 1)]


def branin(x: FloatArray) -> tuple[float, list[float]]:
    """Branin, 1972: three minima of 0.397887 in [-5, 10] × [0, 15]."""
    u, v = 15 * x[0] - 5, 15 * x[1]
    valley = v - 5.1 / (4 * np.pi**2) * u**2 + 5 / np.pi * u - 6
    return float(valley**2 + 10 * (1 - 1 / (8 * np.pi)) * np.cos(u) + 10), []


MIXED_COSTS = (0.3, 0.1, 0.2)


def mixed(x: FloatArray) -> tuple[float, list[float]]:
    """A bowl whose floor steps with the level: 0.1 at (0.3, 0.6) and the middle one of three."""
    return float((x[0] - 0.3) ** 2 + (x[1] - 0.6) ** 2 + MIXED_COSTS[int(x[2] * 3)]), []


def reducer(x: FloatArray) -> tuple[float, list[float]]:
    """Golinski's speed reducer, 1973: 2994.471 with 17 teeth, four constraints active; 12 tooth numbers."""
    lower = np.array([2.6, 0.7, 17.0, 7.3, 7.3, 2.9, 5.0])
    upper = np.array([3.6, 0.8, 28.0, 8.3, 8.3, 3.9, 5.5])
    b, m, _, l1, l2, d1, d2 = lower + x * (upper - lower)
    z = 17 + min(int(x[2] * 12), 11)
    weight = (
        0.7854 * b * m**2 * (3.3333 * z**2 + 14.9334 * z - 43.0934)
        - 1.508 * b * (d1**2 + d2**2)
        + 7.4777 * (d1**3 + d2**3)
        + 0.7854 * (l1 * d1**2 + l2 * d2**2)
    )
    used = [
        27 / (b * m**2 * z),
        397.5 / (b * m**2 * z**2),
        1.93 * l1**3 / (m * z * d1**4),
        1.93 * l2**3 / (m * z * d2**4),
        np.sqrt((745 * l1 / (m * z)) ** 2 + 16.9e6) / (110 * d1**3),
        np.sqrt((745 * l2 / (m * z)) ** 2 + 157.5e6) / (85 * d2**3),
        m * z / 40,
        5 * m / b,
        b / (12 * m),
        (1.5 * d1 + 1.9) / l1,
        (1.1 * d2 + 1.9) / l2,
    ]
    return float(weight), [float(1 - share) for share in used]


BOWL = Case(bowl, (0.45, 0.5, 0.55), 0.0)
HYPERBOLA = Case(hyperbola, (0.8, 0.65), 1.0, constraints=1)
BRANIN = Case(branin, (0.4, 0.6), 0.397887)
MIXED = Case(mixed, (0.5, 0.5, 0.9), 0.1, levels=(0, 0, 3))
REDUCER = Case(reducer, (0.5,) * 7, 2994.471, constraints=11, levels=(0, 0, 12, 0, 0, 0, 0), penalty=10_000.0)


def methods(wanted: Callable[[Optimizer], bool] = lambda method: True) -> pytest.MarkDecorator:
    # one that solves a relaxation needs a study, tests/test_convex.py; fronts: tests/test_front_methods.py
    one_objective = [m for m in OPTIMIZERS.values() if not (m.abilities.relaxation or m.abilities.front)]
    chosen = [method for method in one_objective if wanted(method)]
    return pytest.mark.parametrize("method", chosen, ids=lambda method: method.name)


def is_global(method: Optimizer) -> bool:
    return method.abilities.whole_space


def is_local(method: Optimizer) -> bool:
    return not method.abilities.whole_space


def test_the_registry_holds_every_method_under_its_name() -> None:
    assert all(name == method.name for name, method in OPTIMIZERS.items())
    assert {name.split(".")[0] for name in OPTIMIZERS} == {
        "multistart",
        "descent",
        "scipy",
        "nlopt",
        "convex",
        "pymoo",
    }
    assert all(method.description and method.source for method in OPTIMIZERS.values())


def test_an_unknown_name_meets_the_nearest_known_one() -> None:
    with pytest.raises(UsageError, match=r"Did you mean 'nlopt\.cobyla'"):
        optimizer("nlopt.cobila")


@methods(is_local)
def test_local_methods_reach_the_bottom_of_a_bowl(method: Optimizer) -> None:
    assert searched(method, BOWL, 3000).best()[0] == pytest.approx(0.0, abs=1e-8)


@methods(is_global)
def test_global_methods_come_near_the_bottom_of_a_bowl(method: Optimizer) -> None:
    assert searched(method, BOWL, 2000).best()[0] == pytest.approx(0.0, abs=5e-3)


@methods(lambda method: is_local(method) and method.abilities.constraints)
@pytest.mark.parametrize("start", [(0.8, 0.65), (0.2, 0.9), (0.45, 0.45), (0.1, 0.1)])
def test_local_methods_with_constraints_reach_the_constrained_optimum(
    method: Optimizer, start: tuple[float, float]
) -> None:
    case = Case(hyperbola, start, 1.0, constraints=1)
    assert searched(method, case, 3000).best()[0] == pytest.approx(1.0, abs=1e-5)


@methods(is_global)
def test_global_methods_come_near_the_constrained_optimum(method: Optimizer) -> None:
    """Through constraints of their own or through the merit."""
    assert searched(method, HYPERBOLA, 2000).best()[0] == pytest.approx(1.0, abs=1e-2)


@methods(lambda method: is_local(method) and not method.abilities.constraints)
def test_local_methods_descend_the_merit_from_1_45_to_its_kink(method: Optimizer) -> None:
    """The kink is the constraint; a method with smooth models halts beside the optimum on it."""
    assert searched(method, HYPERBOLA, 3000).best()[0] == pytest.approx(1.0, abs=0.03)


@methods(lambda method: method.abilities.constraints)
def test_methods_with_constraints_do_without_the_merit(method: Optimizer) -> None:
    """A penalty of the wrong sign would lure a method that looked at the merit out of the feasible set."""
    case = Case(hyperbola, (0.8, 0.65), 1.0, constraints=1, penalty=-1000.0)
    assert searched(method, case, 3000).best()[0] == pytest.approx(1.0, abs=1e-2)


@methods(is_global)
def test_global_methods_find_the_least_of_several_minima(method: Optimizer) -> None:
    assert searched(method, BRANIN, 2000).best()[0] == pytest.approx(0.397887, abs=0.02)


@methods(lambda method: method.abilities.discrete)
def test_discrete_variables_find_their_best_level(method: Optimizer) -> None:
    value, design = searched(method, MIXED, 1500).best()
    assert value == pytest.approx(0.1, abs=5e-3)
    assert design[2] == 0.5


@methods(lambda method: method.abilities.discrete)
def test_a_search_ends_when_every_design_is_known(method: Optimizer) -> None:
    """A method without an end of its own would otherwise go on for ever."""
    search = searched(method, Case(mixed, (0.5, 0.5, 0.9), 0.0, levels=(4, 4, 3)), 10**6)
    assert not search.spent
    assert len(search.log) <= 48


@methods()
def test_the_smallest_dimension_works(method: Optimizer) -> None:
    size = method.abilities.smallest_dimension
    search = searched(method, Case(lambda x: (float(np.sum((x - 0.3) ** 2)), []), (0.6,) * size, 0.0), 400)
    assert search.best()[0] == pytest.approx(0.0, abs=1e-4)


@methods(lambda method: method.abilities.largest_dimension is not None)
def test_the_largest_dimension_works(method: Optimizer) -> None:
    size = method.abilities.largest_dimension
    assert size is not None
    search = MemoSearch(Case(lambda x: (float(np.sum((x - 0.3) ** 2)), []), (0.6,) * size, 0.0), 200)
    with pytest.raises(BudgetSpent):
        method.run(search, 1)
    assert len(search.log) == 200


@methods(is_local)
@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.0, 1.0, 0.5)])
def test_local_methods_start_on_the_bounds(method: Optimizer, start: tuple[float, ...]) -> None:
    assert searched(method, Case(bowl, start, 0.0), 3000).best()[0] == pytest.approx(0.0, abs=1e-6)


@methods(is_local)
def test_local_methods_begin_at_the_start(method: Optimizer) -> None:
    """To the distance an interior-point method keeps from the bounds."""
    search = searched(method, BOWL, 3000)
    assert search.log[0] == pytest.approx(np.array(BOWL.start), abs=1e-6)


@methods()
def test_the_same_seed_gives_the_same_points(method: Optimizer) -> None:
    first, second = (searched(method, HYPERBOLA, 300, seed=7) for _ in range(2))
    assert np.array(first.log).tobytes() == np.array(second.log).tobytes()


@methods()
def test_another_seed_gives_other_points_where_chance_plays(method: Optimizer) -> None:
    first, second = (searched(method, HYPERBOLA, 300, seed=seed) for seed in (7, 8))
    same = np.array(first.log).tobytes() == np.array(second.log).tobytes()
    assert same != method.abilities.random


@methods()
def test_a_larger_budget_continues_a_smaller_one(method: Optimizer) -> None:
    """No population and no schedule depends on the budget: what makes replay resume a run."""
    small, large = (searched(method, HYPERBOLA, budget) for budget in (60, 240))
    assert np.array(small.log).tobytes() == np.array(large.log[: len(small.log)]).tobytes()


@methods()
@pytest.mark.parametrize("budget", [0, 1, 14])
def test_the_budget_is_never_exceeded(method: Optimizer, budget: int) -> None:
    search = MemoSearch(BOWL, budget)
    with pytest.raises(BudgetSpent):
        method.run(search, 1)
    assert len(search.log) == budget
    assert search.after_end == 0


@methods()
def test_an_interrupt_comes_out(method: Optimizer) -> None:
    def interrupted(x: FloatArray) -> tuple[float, list[float]]:
        if len(search.log) == 10:
            signal.raise_signal(signal.SIGINT)
        return bowl(x)

    search = MemoSearch(Case(interrupted, BOWL.start, 0.0), 1000)
    with pytest.raises(KeyboardInterrupt):
        method.run(search, 1)
    assert len(search.log) == 10


@methods()
@pytest.mark.parametrize("error", [ValueError, TypeError, ZeroDivisionError])
def test_an_error_of_the_problem_comes_out_as_it_was_raised(
    method: Optimizer, error: type[Exception]
) -> None:
    def faulty(x: FloatArray) -> tuple[float, list[float]]:
        if len(search.log) == 10:
            raise error("of the problem")
        return bowl(x)

    search = MemoSearch(Case(faulty, BOWL.start, 0.0), 1000)
    with pytest.raises(error, match="of the problem"):
        method.run(search, 1)


@methods(lambda method: method.abilities.constraints)
def test_more_constraints_than_a_library_keeps_room_for(method: Optimizer) -> None:
    """Twelve of which only the last is ever active."""

    def crowded(x: FloatArray) -> tuple[float, list[float]]:
        value, active = hyperbola(x)
        return value, [1.0 + 0.01 * i + 0.1 * float(x[0]) for i in range(11)] + active

    search = searched(method, Case(crowded, (0.8, 0.65), 1.0, constraints=12), 2000)
    assert search.best()[0] == pytest.approx(1.0, abs=1e-2)


def test_one_generation_of_differential_evolution_is_one_batch() -> None:
    """Objective and constraints of a generation are paid for together; SciPy tries its first member alone."""
    search = searched(optimizer("scipy.differential_evolution"), HYPERBOLA, 240)
    paid = [size for size in search.batches if size]
    assert paid == [1, 23] + [24] * 9


@pytest.mark.parametrize("seed", range(6))
def test_differential_evolution_and_polish_on_the_speed_reducer(seed: int) -> None:
    """3200 designs come within 1 % of the published optimum; COBYLA with the teeth held finishes it."""
    search = searched(optimizer("scipy.differential_evolution"), REDUCER, 3200, seed)
    value, design = search.best()
    assert value == pytest.approx(REDUCER.optimum, rel=0.01)
    held = design[2]

    def continuous(y: FloatArray) -> tuple[float, list[float]]:
        return reducer(np.insert(y, 2, held))

    polish = Case(continuous, tuple(np.delete(design, 2)), REDUCER.optimum, constraints=11)
    finished = searched(optimizer("nlopt.cobyla"), polish, 800)
    assert finished.best()[0] == pytest.approx(REDUCER.optimum, rel=1e-5)


@given(st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3))
@settings(max_examples=50, deadline=None)
def test_slopes_of_a_quadratic_are_exact_inside_and_near_at_the_bounds(point: list[float]) -> None:
    """Central quotients of a quadratic have no truncation error; one-sided ones half the step × curvature."""

    def quadratic(x: FloatArray) -> tuple[float, list[float]]:
        return bowl(x)[0], [float(x[0] * x[1] - 0.5 * x[2]), float(x[2])]

    x = np.array(point)
    tangents = Watch(MemoSearch(Case(quadratic, (0.5,) * 3, 0.0, constraints=2), 7)).tangents(x)
    slopes = tangents.slopes
    gradient = 2 * np.array([1.0, 3.0, 10.0]) * (x - np.array([0.3, 0.7, 0.9]))
    at_bound = np.minimum(x, 1 - x) < DIFFERENCE_STEP
    allowed = np.where(at_bound, DIFFERENCE_STEP * np.array([1.0, 3.0, 10.0]), 0.0) + 1e-9
    assert np.all(np.abs(slopes.gradient - gradient) <= allowed)
    assert slopes.jacobian == pytest.approx(np.array([[x[1], x[0], -0.5], [0.0, 0.0, 1.0]]), abs=1e-9)
    assert tangents.objective == bowl(x)[0]


@methods()
def test_refusals_follow_the_declared_abilities(method: Optimizer) -> None:
    able = method.abilities
    fits = {"dimension": 5, "discrete": [], "nondifferentiable": []}
    assert refusal(method, **fits) is None
    assert (refusal(method, **{**fits, "discrete": ["k"]}) is None) == able.discrete
    smooth_needed = refusal(method, **{**fits, "nondifferentiable": ["coverage"]})
    assert (smooth_needed is not None) == able.derivatives
    assert (refusal(method, **{**fits, "dimension": 40}) is None) == (able.largest_dimension is None)


def test_a_refusal_names_the_reason_and_what_would_suit() -> None:
    with pytest.raises(RefusedError) as refused:
        check_pair(optimizer("nlopt.ags"), dimension=11, discrete=["k"], nondifferentiable=[])
    assert "at most 10 variables; this study has 11" in refused.value.what
    remedy = refused.value.remedy or ""
    assert "scipy.differential_evolution" in remedy
    assert "nlopt.ags" not in remedy
    assert "shgo" not in remedy
    check_pair(optimizer("nlopt.ags"), dimension=10, discrete=[], nondifferentiable=[])


def test_a_refused_local_method_is_answered_with_local_ones() -> None:
    with pytest.raises(RefusedError, match="follows gradients; without one here: coverage") as refused:
        check_pair(optimizer("scipy.slsqp"), dimension=4, discrete=[], nondifferentiable=["coverage"])
    assert "nlopt.cobyla" in (refused.value.remedy or "")
    assert "differential_evolution" not in (refused.value.remedy or "")


def test_the_room_loads_no_library_before_a_search_runs() -> None:
    script = (
        "import sys, tpm_design; before = set(sys.modules); import tpm_design.optimizers;"
        "print(sorted({'scipy', 'nlopt', 'pymoo'} & (set(sys.modules) - before)))"
    )
    sources = str(Path(__file__).parents[1] / "src")
    answer = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": sources},
    )
    assert answer.stdout.strip() == "[]"
