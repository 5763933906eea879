"""Methods of scipy.optimize (Virtanen et al., Nature Methods 17, 2020, 261-272)."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from typing import Any

import numpy as np

from tpm_design.optimizers.base import Abilities, FloatArray, Optimizer, Stalled
from tpm_design.optimizers.watch import LOCAL_STEP, LOCAL_TOLERANCE, RESTART_DISTANCE, Watch, watched

# SciPy's own limits on evaluations and iterations are lifted: the budget belongs to the search. What remains
# is a number that no run reaches, since some of the methods count in C integers or keep room for it.
NO_LIMIT = 10**7
DIRECT_EVALUATIONS = 200_000
DIRECT_ITERATIONS = 30_000


def differential_evolution(watch: Watch, seed: int) -> str:
    """Deb's rules for constraints: least total violation first, then the objective.

    Seven members per variable, current-to-best with dithered mutation 0.4-0.9, crossover 0.9: on constrained
    problems in 5 to 7 variables with a discrete one, 3200 evaluations ended within 1 % of the optimum
    oftenest, and SciPy's defaults (best1bin, violations compared one by one) seldom became feasible.
    """
    from scipy.optimize import NonlinearConstraint
    from scipy.optimize import differential_evolution as minimize

    levels = watch.levels
    discrete = levels > 0
    values = np.maximum(levels, 1)

    def cube(members: FloatArray) -> FloatArray:
        """(n, N) or (n,) members, discrete ones as level numbers → (N, n) points of the cube."""
        points = np.asarray(members, dtype=np.float64).reshape(watch.dimension, -1).T
        return np.where(discrete, (points + 0.5) / values, points)

    def objective(members: FloatArray) -> FloatArray:
        return watch.evaluate(cube(members)).objective

    def violation(members: FloatArray) -> FloatArray:
        """Asked first for the whole generation: the objective of its feasible members is then known."""
        shortfalls = np.maximum(0.0, -watch.evaluate(cube(members)).constraints)
        return np.asarray(shortfalls.sum(axis=1)[None, :])

    first = np.where(discrete, np.minimum(np.floor(watch.start * values), values - 1), watch.start)
    result = minimize(
        objective,
        [(0, level - 1) if level else (0.0, 1.0) for level in levels.tolist()],
        strategy="currenttobest1bin",
        maxiter=NO_LIMIT,
        popsize=max(7, ceil(24 / watch.dimension)),
        tol=1e-10,
        mutation=(0.4, 0.9),
        recombination=0.9,
        rng=seed,
        polish=False,
        init="latinhypercube",
        updating="deferred",
        constraints=NonlinearConstraint(violation, -np.inf, 0.0) if watch.constraint_count else (),
        x0=first,
        integrality=discrete,
        vectorized=True,
    )
    return _sentence(result)


def dual_annealing(watch: Watch, seed: int) -> str:
    """The local search is by simplex: a merit with kinks and steps has no gradient to follow."""
    from scipy.optimize import dual_annealing as minimize

    result = minimize(
        watch.merit,
        _unit_bounds(watch),
        maxiter=NO_LIMIT,
        minimizer_kwargs={
            "method": "Nelder-Mead",
            "bounds": _unit_bounds(watch),
            "options": {"xatol": 1e-4, "fatol": np.inf, "adaptive": True, "maxfev": NO_LIMIT},
        },
        maxfun=NO_LIMIT,
        rng=seed,
        x0=watch.start,
    )
    return _sentence(result)


def shgo(watch: Watch, seed: int) -> str:
    """Simplicial sampling refined until the budget ends; minima by COBYQA within their neighbours."""
    from scipy.optimize import shgo as minimize

    result = minimize(
        watch.merit,
        _unit_bounds(watch),
        iters=NO_LIMIT,
        n=10 * watch.dimension,
        minimizer_kwargs={"method": "COBYQA"},
        sampling_method="simplicial",
    )
    return _sentence(result)


def direct(watch: Watch, seed: int) -> str:
    from scipy.optimize import direct as minimize

    result = minimize(
        watch.merit,
        _unit_bounds(watch),
        maxfun=DIRECT_EVALUATIONS,
        maxiter=DIRECT_ITERATIONS,
        locally_biased=True,
        vol_tol=0.0,
        len_tol=LOCAL_TOLERANCE,
    )
    return _sentence(result)


def slsqp(watch: Watch, seed: int) -> str:
    constraints: Any = ()
    if watch.constraint_count:
        constraints = {
            "type": "ineq",
            "fun": watch.constraints,
            "jac": lambda x: watch.tangents(x).slopes.jacobian,
        }
    return _minimize(
        watch,
        watch.objective,
        "SLSQP",
        {"ftol": 1e-12, "maxiter": NO_LIMIT},
        constraints=constraints,
        jac=lambda x: watch.tangents(x).slopes.gradient,
    )


def cobyla(watch: Watch, seed: int) -> str:
    options = {"rhobeg": LOCAL_STEP, "tol": LOCAL_TOLERANCE, "maxiter": NO_LIMIT, "catol": 1e-8}
    return _minimize(watch, watch.objective, "COBYLA", options, constraints=_inequalities(watch))


def cobyqa(watch: Watch, seed: int) -> str:
    options = {
        "initial_tr_radius": LOCAL_STEP,
        "final_tr_radius": 10 * LOCAL_TOLERANCE,  # with less it may go round in circles
        "maxiter": NO_LIMIT,
        "maxfev": NO_LIMIT,
    }
    return _minimize(watch, watch.objective, "COBYQA", options, constraints=_inequalities(watch))


def nelder_mead(watch: Watch, seed: int) -> str:
    """Begins anew where it ended until that leads nowhere: a simplex may collapse onto a bound or a kink."""
    from scipy.optimize import minimize

    point, distance = watch.start, np.inf
    while distance > RESTART_DISTANCE:
        # Steps point inwards, so that no corner of the first simplex is folded back onto another.
        steps = np.where(point > 0.5, -LOCAL_STEP, LOCAL_STEP)
        options = {
            "initial_simplex": np.vstack([point, point + np.diag(steps)]),
            "xatol": LOCAL_TOLERANCE,
            "fatol": np.inf,
            "adaptive": True,
            "maxfev": NO_LIMIT,
            "maxiter": NO_LIMIT,
        }
        result = minimize(
            watch.merit, point, method="Nelder-Mead", bounds=_unit_bounds(watch), options=options
        )
        distance = np.abs(result.x - point).max()
        point = result.x
    return _sentence(result)


def trust_constr(watch: Watch, seed: int) -> str:
    from scipy.optimize import BFGS, NonlinearConstraint

    class Curvature(BFGS):  # type: ignore[misc]
        """BFGS that keeps still where the gradient did not change, without a warning: linear constraints."""

        def update(self, delta_x: FloatArray, delta_grad: FloatArray) -> None:
            if np.any(delta_grad != 0.0):
                super().update(delta_x, delta_grad)

    constraints: Any = ()
    if watch.constraint_count:
        constraints = NonlinearConstraint(
            watch.constraints, 0.0, np.inf, jac=lambda x: watch.tangents(x).slopes.jacobian, hess=Curvature()
        )
    options = {
        "initial_tr_radius": LOCAL_STEP,
        "xtol": LOCAL_TOLERANCE,
        # The gradient of the barrier function may vanish while the barrier is still far too high.
        "gtol": 1e-14,
        "barrier_tol": 1e-9,
        "maxiter": NO_LIMIT,
    }
    return _minimize(
        watch,
        watch.objective,
        "trust-constr",
        options,
        constraints=constraints,
        jac=lambda x: watch.tangents(x).slopes.gradient,
        hess=Curvature(),
    )


def _minimize(
    watch: Watch,
    quantity: Callable[[FloatArray], float],
    method: str,
    options: dict[str, Any],
    *,
    constraints: Any = (),
    jac: Callable[[FloatArray], FloatArray] | None = None,
    hess: Any = None,
) -> str:
    """scipy.optimize.minimize from ``start`` within the cube."""
    from scipy.optimize import Bounds, minimize

    result = minimize(
        quantity,
        watch.start,
        method=method,
        jac=jac,
        hess=hess,
        bounds=Bounds(np.zeros(watch.dimension), np.ones(watch.dimension)),
        constraints=constraints,
        options=options,
    )
    return _sentence(result)


def _inequalities(watch: Watch) -> Any:
    """The constraints for methods without derivatives."""
    from scipy.optimize import NonlinearConstraint

    return NonlinearConstraint(watch.constraints, 0.0, np.inf) if watch.constraint_count else ()


def _unit_bounds(watch: Watch) -> list[tuple[float, float]]:
    return [(0.0, 1.0)] * watch.dimension


def _sentence(result: Any) -> str:
    """How SciPy says it ended, as one sentence. Raises Stalled with it where SciPy calls that no success."""
    message = result.message
    text = " ".join(str(message[-1] if isinstance(message, list) and message else message).split())
    sentence = text.rstrip(".") + "."
    if not result.success:
        raise Stalled(sentence)
    return sentence


def _local(*, constraints: bool, derivatives: bool) -> Abilities:
    return Abilities(
        constraints=constraints,
        discrete=False,
        derivatives=derivatives,
        random=False,
        whole_space=False,
        batch=derivatives,
    )


METHODS = (
    Optimizer(
        "scipy.differential_evolution",
        "population search; constraints by feasibility first, discrete variables as levels",
        "Storn and Price, 1997; Lampinen, 2002; Deb, 2000",
        Abilities(
            constraints=True, discrete=True, derivatives=False, random=True, whole_space=True, batch=True
        ),
        watched(differential_evolution),
    ),
    Optimizer(
        "scipy.dual_annealing",
        "generalised simulated annealing with a simplex search from its best points",
        "Xiang, Sun, Fan and Gong, 1997",
        Abilities(
            constraints=False, discrete=True, derivatives=False, random=True, whole_space=True, batch=False
        ),
        watched(dual_annealing),
    ),
    Optimizer(
        "scipy.shgo",
        "simplicial homology: a local search from every minimum of a refined triangulation",
        "Endres, Sandrock and Focke, 2018",
        Abilities(
            constraints=False,
            discrete=False,
            derivatives=False,
            random=False,
            whole_space=True,
            batch=False,
            largest_dimension=10,
        ),
        watched(shgo),
    ),
    Optimizer(
        "scipy.direct",
        "dividing rectangles, locally biased; deterministic",
        "Jones, Perttunen and Stuckman, 1993; Gablonsky and Kelley, 2001",
        Abilities(
            constraints=False, discrete=True, derivatives=False, random=False, whole_space=True, batch=False
        ),
        watched(direct),
    ),
    Optimizer(
        "scipy.slsqp",
        "local: sequential quadratic programming on difference quotients",
        "Kraft, 1988",
        _local(constraints=True, derivatives=True),
        watched(slsqp),
    ),
    Optimizer(
        "scipy.cobyla",
        "local: linear models of objective and constraints",
        "Powell, 1994; PRIMA, Zhang, 2023",
        _local(constraints=True, derivatives=False),
        watched(cobyla),
    ),
    Optimizer(
        "scipy.cobyqa",
        "local: quadratic models of objective and constraints",
        "Ragonneau, 2022",
        _local(constraints=True, derivatives=False),
        watched(cobyqa),
    ),
    Optimizer(
        "scipy.nelder_mead",
        "local: downhill simplex with coefficients adapted to the dimension",
        "Nelder and Mead, 1965; Gao and Han, 2012",
        _local(constraints=False, derivatives=False),
        watched(nelder_mead),
    ),
    Optimizer(
        "scipy.trust_constr",
        "local: interior-point trust region on difference quotients",
        "Byrd, Hribar and Nocedal, 1999",
        _local(constraints=True, derivatives=True),
        watched(trust_constr),
    ),
)
