"""Methods that search fronts, on problems whose fronts are known, through a search with memo and budget."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Callable

import numpy as np
import pytest

from fronts import (
    BINH_KORN,
    CONVEX,
    MIXED,
    OCTANT,
    TANAKA,
    FrontCase,
    FrontMemo,
    Values,
    between_two_points,
    binh_korn_front,
    searched,
)
from tpm_design.errors import RefusedError
from tpm_design.optimizers import OPTIMIZERS, check_pair, default_method, optimizer
from tpm_design.optimizers.base import BudgetSpent, FloatArray, Optimizer, Outcomes, Stalled
from tpm_design.optimizers.refusal import refusal
from tpm_design.runs.front import FrontBox


def methods(wanted: Callable[[Optimizer], bool] = lambda method: True) -> pytest.MarkDecorator:
    chosen = [m for m in OPTIMIZERS.values() if m.abilities.front and wanted(m)]
    return pytest.mark.parametrize("method", chosen, ids=lambda method: method.name)


def is_random(method: Optimizer) -> bool:
    return method.abilities.random


def test_the_methods_there_are() -> None:
    found = {name for name, method in OPTIMIZERS.items() if method.abilities.front}
    assert found == {"pymoo.nsga2", "pymoo.nsga3", "nlopt.epsilon_constraint"}
    assert (default_method(2), default_method(3)) == ("pymoo.nsga2", "pymoo.nsga2")
    assert not optimizer(default_method(1)).abilities.front


# ------------------------------------------------------------------------------------- known fronts


@methods()
def test_a_convex_front_in_closed_form(method: Optimizer) -> None:
    """√f₁ + √f₂ = 1: below it lies a sixth of the unit square, the rest up to (1.1, 1.1) is dominated."""
    front, _ = searched(method, CONVEX, 3000).front()
    # least squared distances are quadratic: near an extreme a step of d costs d² of one objective
    assert np.all(np.sqrt(front).sum(axis=1) >= 1.0 - 1e-12)
    assert np.median(np.sqrt(front).sum(axis=1)) <= 1.01
    box = FrontBox(np.zeros(2), np.full(2, 1.1))
    whole = (1.21 - 1.0 / 6.0) / 1.21
    assert whole - 0.006 <= box.hypervolume(front) <= whole


@methods()
def test_a_constrained_front_in_closed_form(method: Optimizer) -> None:
    front, _ = searched(method, BINH_KORN, 2500).front()
    below = (front[:, 1] - binh_korn_front(front[:, 0])) / 50.0
    assert np.all(below >= -1e-7)
    assert np.median(below) <= 2e-3
    assert front[0, 0] <= 1.0
    assert front[-1, 1] <= 4.1  # the least is 4, at u = 5, v = 3


@methods()
def test_a_front_in_pieces_on_a_constraint(method: Optimizer) -> None:
    search = searched(method, TANAKA, 2500)
    front, designs = search.front()
    slack = np.array([search.values[design.tobytes()][1] for design in designs])
    assert np.median(slack[:, 0]) <= 0.02
    # the first bay of the constraint parts the front: nothing on it lies there
    across = np.sort(front[:, 0])
    assert np.diff(across).max() > 0.08
    assert across[0] <= 0.1
    assert across[-1] >= 0.95


@methods(lambda method: method.abilities.most_objectives is None)
def test_three_objectives_on_the_octant_of_a_sphere(method: Optimizer) -> None:
    front, _ = searched(method, OCTANT, 4000).front()
    radius = np.linalg.norm(front, axis=1)
    assert np.all(radius >= 1.0 - 1e-12)
    assert np.median(radius) <= 1.05
    box = FrontBox(np.zeros(3), np.full(3, 1.1))
    whole = 1.0 - np.pi / 6.0 / 1.1**3
    assert 0.9 * whole <= box.hypervolume(front) <= whole


@methods(lambda method: method.abilities.discrete)
def test_discrete_variables_find_their_level(method: Optimizer) -> None:
    _, designs = searched(method, MIXED, 800).front()
    assert np.all(designs[:, 1] == 0.375)


@methods(lambda method: method.abilities.discrete)
def test_a_search_ends_when_every_design_is_known(method: Optimizer) -> None:
    search = searched(method, FrontCase(MIXED.function, (0.5, 0.9), levels=(6, 4)), 10**6)
    assert not search.spent
    assert len(search.log) <= 24
    # of the centres 1/12, 3/12, … those between the two points
    assert search.front()[1][:, 0] == pytest.approx(np.array([3.0, 5.0, 7.0, 9.0]) / 12.0)


def test_the_ladder_ends_by_itself_and_leaves_no_wide_gap() -> None:
    search = FrontMemo(CONVEX, 10**5)
    said = optimizer("nlopt.epsilon_constraint").run(search, 1)
    front, _ = search.front()
    assert said.startswith("The ladder of bounds is complete")
    assert not search.spent
    assert np.abs(np.diff(front, axis=0)).max() <= 0.06
    # not near the front but on it: at every rung f₁ = (1 − √f₂)²
    missed = np.sqrt(front).sum(axis=1) - 1.0
    assert missed.max() <= 0.02
    assert np.mean(missed <= 1e-4) >= 0.5


def test_one_design_that_is_best_by_both_is_a_front_of_its_own() -> None:
    def agreed(x: FloatArray) -> Values:
        value = float(np.sum((x - 0.3) ** 2))
        return [value, 2.0 * value], []

    search = FrontMemo(FrontCase(agreed, (0.5, 0.5)), 10**5)
    said = optimizer("nlopt.epsilon_constraint").run(search, 1)
    assert said == "One design is best in every objective."
    assert search.front()[0] == pytest.approx(np.zeros((1, 2)), abs=1e-8)


def test_a_ladder_without_a_feasible_design_has_stalled() -> None:
    def impossible(x: FloatArray) -> Values:
        return between_two_points(x)[0], [-1.0 - float(x[0])]

    search = FrontMemo(FrontCase(impossible, (0.5, 0.5), constraints=1), 10**5)
    with pytest.raises(Stalled, match="No design that meets the constraints"):
        optimizer("nlopt.epsilon_constraint").run(search, 1)


# ------------------------------------------------------------------------------------- replay


@methods()
@pytest.mark.parametrize("case", [CONVEX, BINH_KORN, TANAKA], ids=["convex", "binh_korn", "tanaka"])
def test_the_same_seed_gives_the_same_points(method: Optimizer, case: FrontCase) -> None:
    np.random.seed(1)  # the global generator, which must play no part
    first = searched(method, case, 400, seed=7)
    np.random.seed(2)
    second = searched(method, case, 400, seed=7)
    assert np.array(first.log).tobytes() == np.array(second.log).tobytes()


@methods()
def test_ties_of_violation_are_drawn_by_the_seed(method: Optimizer) -> None:
    """pymoo 0.6.2 draws such ties of NSGA-III from a generator without a seed."""

    def tied(x: FloatArray) -> Values:
        return between_two_points(x)[0], [-1.0]

    case = FrontCase(tied, (0.5, 0.5), constraints=1)
    first, second = (searched(method, case, 300) for _ in range(2))
    assert np.array(first.log).tobytes() == np.array(second.log).tobytes()


@methods(is_random)
def test_another_seed_gives_other_points(method: Optimizer) -> None:
    first, second = (searched(method, BINH_KORN, 200, seed=seed) for seed in (7, 8))
    assert np.array(first.log).tobytes() != np.array(second.log).tobytes()


@methods()
def test_a_larger_budget_continues_a_smaller_one(method: Optimizer) -> None:
    small, large = (searched(method, BINH_KORN, budget) for budget in (130, 500))
    assert np.array(small.log).tobytes() == np.array(large.log[:130]).tobytes()


@methods()
@pytest.mark.parametrize("budget", [0, 1, 14, 95])
def test_the_budget_is_never_exceeded(method: Optimizer, budget: int) -> None:
    search = FrontMemo(CONVEX, budget)
    with pytest.raises(BudgetSpent):
        method.run(search, 1)
    assert len(search.log) == budget
    assert search.after_end == 0


@methods(is_random)
def test_a_generation_is_one_batch(method: Optimizer) -> None:
    search = searched(method, BINH_KORN, 600)
    paid = [size for size in search.batches if size]
    # all but the few members that were known before
    assert min(paid[:-1]) >= 36


@methods()
def test_an_interrupt_comes_out(method: Optimizer) -> None:
    def interrupted(x: FloatArray) -> Values:
        if len(search.log) == 50:
            signal.raise_signal(signal.SIGINT)
        return between_two_points(x)

    search = FrontMemo(FrontCase(interrupted, CONVEX.start), 1000)
    with pytest.raises(KeyboardInterrupt):
        method.run(search, 1)
    assert len(search.log) == 50


@methods()
@pytest.mark.parametrize("after", [10, 70])
def test_an_error_of_the_problem_comes_out_as_it_was_raised(method: Optimizer, after: int) -> None:
    def faulty(x: FloatArray) -> Values:
        if len(search.log) == after:
            raise ZeroDivisionError("of the problem")
        return between_two_points(x)

    search = FrontMemo(FrontCase(faulty, CONVEX.start), 1000)
    with pytest.raises(ZeroDivisionError, match="of the problem"):
        method.run(search, 1)


@methods()
def test_nothing_is_printed_and_no_warning_filter_is_changed(
    method: Optimizer, capfd: pytest.CaptureFixture[str]
) -> None:
    filters = list(warnings.filters)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        searched(method, BINH_KORN, 300)
    assert warnings.filters == filters
    assert capfd.readouterr() == ("", "")


# ------------------------------------------------------------------------------------- refusals


@methods()
def test_a_front_method_is_refused_for_one_objective(method: Optimizer) -> None:
    fits = {"dimension": 5, "discrete": [], "nondifferentiable": []}
    with pytest.raises(RefusedError, match="searches the front of several objectives") as refused:
        check_pair(method, dimension=5, discrete=[], nondifferentiable=[], objectives=1)
    assert "scipy.differential_evolution" in (refused.value.remedy or "")
    assert refusal(method, **fits, objectives=2) is None  # type: ignore[arg-type]
    most = method.abilities.most_objectives
    assert (refusal(method, **fits, objectives=3) is None) == (most is None)  # type: ignore[arg-type]


def test_a_method_for_one_objective_is_answered_with_those_for_fronts() -> None:
    for name, discrete in (("scipy.differential_evolution", ["k"]), ("nlopt.cobyla", [])):
        with pytest.raises(RefusedError, match="takes one objective; this study has 2") as refused:
            check_pair(optimizer(name), dimension=5, discrete=discrete, nondifferentiable=[], objectives=2)
        remedy = refused.value.remedy or ""
        assert "pymoo.nsga2, pymoo.nsga3" in remedy
        assert ("nlopt.epsilon_constraint" in remedy) == (not discrete)
        assert "scipy" not in remedy


@methods()
def test_a_search_that_tells_one_objective_is_refused(method: Optimizer) -> None:
    class Plain:
        dimension, levels, constraint_count = 2, (0, 0), 0
        start = np.full(2, 0.5)

        def evaluate(self, points: FloatArray) -> Outcomes:
            raise AssertionError

    with pytest.raises(RefusedError, match="one objective"):
        method.run(Plain(), 1)
