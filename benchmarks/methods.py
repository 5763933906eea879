"""Methods × problems with known optima: how often and how soon each comes within 0.1 %.

    python benchmarks/methods.py                              # every method, 20 seeds (hours)
    python benchmarks/methods.py --methods default optuna.tpe --problems spring --seeds 5

`optuna.tpe`, `pymoo.ga` and `pymoo.de` are these libraries with the settings they come with, on the same
evaluator (`pip install optuna pymoo`).
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from known_optima import KnownOptimum, known_optima
from tpm_design.design_space import DesignSpace, octant_signs
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.result import Evaluation
from tpm_design.optimizers import OPTIMIZERS, default_method
from tpm_design.problem import Problem
from tpm_design.runs.executors import Threads
from tpm_design.runs.optimize import SearchPlan, search
from tpm_design.runs.outcomes import outcomes
from tpm_design.runs.ranking import minimised
from tpm_design.study.model import OptimizerModel

WITHIN = 1e-3
DEFAULT = "default"


@dataclass(frozen=True)
class Outcome:
    """``reached``: evaluations until within 0.1 % of the optimum; None: never. ``excess``: how far the best
    feasible design is from it at the end, relative; None: none was feasible."""

    problem: str
    method: str
    seed: int
    reached: int | None
    evaluations: int
    excess: float | None
    seconds: float


def ours(problem: Problem, method: str, polish: str | None, budget: int, seed: int) -> Sequence[Evaluation]:
    """One search by a method of the package."""
    plan = SearchPlan(method, budget, seed, polish)
    return [
        e.evaluation for e in search(problem, plan, executor=Threads(1), record=lambda entry: None).entries
    ]


def by_default(problem: Problem, budget: int, seed: int) -> Sequence[Evaluation]:
    """What a study without ``optimizer:`` gets."""
    return ours(problem, default_method(1), OptimizerModel().polish, budget, seed)


def space_of(problem: Problem) -> DesignSpace:
    return DesignSpace(problem.variables, problem.fixed, octant_signs(problem.modes), problem.ties)


def optuna_tpe(problem: Problem, budget: int, seed: int) -> Sequence[Evaluation]:
    """Optuna's default sampler with its constraints."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    space, done = space_of(problem), []

    def objective(trial: Any) -> float:
        values: dict[str, float | str] = {
            v.name: trial.suggest_categorical(v.name, list(v.values))
            if v.values
            else trial.suggest_float(v.name, v.lower, v.upper)
            for v in problem.variables
        }
        done.append(evaluate(problem, space.completed(values)))
        for goal, constraint in zip(problem.constraints, seen(problem, done[-1:])[1][0], strict=True):
            trial.set_constraint(goal.label, -float(constraint))
        return minimised(problem, done[-1])

    sampler = optuna.samplers.TPESampler(seed=seed)
    optuna.create_study(sampler=sampler).optimize(objective, n_trials=budget)
    return done


def seen(problem: Problem, results: Sequence[Evaluation]) -> tuple[np.ndarray, np.ndarray]:
    """Objective (N,) and constraints (N, m), met where ≥ 0."""
    values = outcomes(problem, results, (1,) * len(problem.constraints))
    return values.objective, values.constraints


def pymoo_default(algorithm: str) -> Callable[[Problem, int, int], Sequence[Evaluation]]:
    """A single-objective method of pymoo on the unit cube."""

    def run(problem: Problem, budget: int, seed: int) -> Sequence[Evaluation]:
        from pymoo.algorithms.soo.nonconvex.de import DE
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.core.problem import Problem as PymooProblem
        from pymoo.optimize import minimize

        space: DesignSpace = space_of(problem)
        done: list[Evaluation] = []

        class Cube(PymooProblem):  # type: ignore[misc]
            def _evaluate(self, points: Any, out: Any, *args: Any, **kwargs: Any) -> None:
                results = [evaluate(problem, space.design(point)) for point in points]
                done.extend(results)
                objective, constraints = seen(problem, results)
                out["F"], out["G"] = objective[:, None], -constraints

        cube = Cube(
            n_var=len(space.variables), n_obj=1, n_ieq_constr=len(problem.constraints), xl=0.0, xu=1.0
        )
        minimize(cube, {"ga": GA, "de": DE}[algorithm](), ("n_eval", budget), seed=seed)
        return done[:budget]

    return run


def methods() -> dict[str, Callable[[Problem, int, int], Sequence[Evaluation]]]:
    """All methods by name."""

    def of_package(name: str) -> Callable[[Problem, int, int], Sequence[Evaluation]]:
        return lambda problem, budget, seed: ours(problem, name, None, budget, seed)

    able = {
        name: of_package(name)
        for name, method in OPTIMIZERS.items()
        if method.abilities.whole_space and not (method.abilities.relaxation or method.abilities.front)
    }
    return {
        DEFAULT: by_default,
        **able,
        "optuna.tpe": optuna_tpe,
        "pymoo.ga": pymoo_default("ga"),
        "pymoo.de": pymoo_default("de"),
    }


def one(task: tuple[str, str, int, int]) -> Outcome | None:
    """One method on one problem with one seed; None where it cannot search such a problem."""
    from tpm_design.errors import RefusedError

    name, method, seed, budget = task
    case: KnownOptimum = next(case for case in known_optima() if case.name == name)
    began = time.perf_counter()
    try:
        done = methods()[method](case.problem, budget, seed)
    except RefusedError:
        return None
    seconds = time.perf_counter() - began
    goal = case.problem.objectives[0]
    sense = 1.0 if goal.sense == "minimize" else -1.0
    best, reached = float("inf"), None
    for count, evaluation in enumerate(done, start=1):
        if evaluation.status == "feasible":
            best = min(best, sense * (evaluation.metrics[goal.label] - case.optimum) / abs(case.optimum))
            if reached is None and best <= WITHIN:
                reached = count
    return Outcome(name, method, seed, reached, len(done), None if best == float("inf") else best, seconds)


def main() -> None:
    names, able = [case.name for case in known_optima()], list(methods())
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--methods", nargs="*", default=able, choices=able, metavar="NAME")
    parser.add_argument("--problems", nargs="*", default=names, choices=names, metavar="NAME")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--budget", type=int, help="evaluations of each run; default: the problem's")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--json", type=Path, help="also write every run here")
    arguments = parser.parse_args()
    budgets = {case.name: arguments.budget or case.budget for case in known_optima()}
    tasks = [
        (problem, method, seed, budgets[problem])
        for problem in arguments.problems
        for method in arguments.methods
        for seed in range(1, arguments.seeds + 1)
    ]
    with multiprocessing.get_context("spawn").Pool(arguments.processes, maxtasksperchild=50) as pool:
        found = [outcome for outcome in pool.imap(one, tasks) if outcome is not None]
    if arguments.json is not None:
        arguments.json.write_text(json.dumps([asdict(o) for o in found], indent=1) + "\n", encoding="utf-8")
    print("| problem | budget | method | within 0.1 % | after, median | excess, median | worst | s per run |")
    print("|---|---:|---|---:|---:|---:|---:|---:|")
    for problem in arguments.problems:
        for method in arguments.methods:
            runs = [o for o in found if (o.problem, o.method) == (problem, method)]
            if runs:
                print(f"| {problem} | {budgets[problem]} | {method} | {summary(runs)} |")


def summary(runs: Sequence[Outcome]) -> str:
    """The cells of one row."""
    reached = [o.reached for o in runs if o.reached is not None]
    excess = sorted(float("inf") if o.excess is None else o.excess for o in runs)
    cells = [
        f"{len(reached)}/{len(runs)}",
        f"{median(reached):.0f}" if reached else "-",
        percent(median(excess)),
        percent(excess[-1]),
        f"{median(o.seconds for o in runs):.1f}",
    ]
    return " | ".join(cells)


def percent(excess: float) -> str:
    return f"{100 * excess:.3g} %" if excess < float("inf") else "none feasible"


if __name__ == "__main__":
    main()
