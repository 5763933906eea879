"""Methods of NLopt (Johnson, The NLopt nonlinear-optimization package, 2007)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tpm_design.optimizers.base import Abilities, FloatArray, Optimizer, Stalled
from tpm_design.optimizers.watch import LOCAL_STEP, LOCAL_TOLERANCE, RESTART_DISTANCE, Watch, watched

AGS_CONSTRAINTS = 10
"""AGS keeps room for ten constraints and for ten variables."""

STOPS_SHORT = ("LD_MMA", "LD_CCSAQ", "LN_COBYLA")
"""MMA and CCSA may take the first bounds they touch for convergence; COBYLA halts at the kinks of metrics
that are the least of several. Begun again from there they go on."""

Method = Callable[[Watch, int], str]


def _bounded(algorithm: str, watch: Watch) -> Any:
    import nlopt

    opt = nlopt.opt(getattr(nlopt, algorithm), watch.dimension)
    opt.set_lower_bounds(np.zeros(watch.dimension))
    opt.set_upper_bounds(np.ones(watch.dimension))
    return opt


def _on_merit(opt: Any, watch: Watch) -> None:
    opt.set_min_objective(lambda x, gradient: watch.merit(x))


def _on_objective(opt: Any, watch: Watch) -> None:
    """Objective and constraints (NLopt's are met where ≤ 0), with gradients where NLopt asks for them."""

    def objective(x: FloatArray, gradient: FloatArray) -> float:
        if not gradient.size:
            return watch.objective(x)
        tangents = watch.tangents(x)
        gradient[:] = tangents.slopes.gradient
        return tangents.objective

    def constraints(result: FloatArray, x: FloatArray, jacobian: FloatArray) -> None:
        if jacobian.size:
            tangents = watch.tangents(x)
            jacobian[:] = -tangents.slopes.jacobian
            result[:] = -tangents.constraints
        else:
            result[:] = -watch.constraints(x)

    opt.set_min_objective(objective)
    if watch.constraint_count:
        opt.add_inequality_mconstraint(constraints, np.zeros(watch.constraint_count))


def _optimize(opt: Any, watch: Watch, *, again: bool = False) -> str:
    """Runs NLopt; roundoff is an ordinary end. Raises Stalled on a forced stop and on its plain failure.

    ``again``: from where it ended, as long as that leads elsewhere.
    """
    import nlopt

    ends = {
        nlopt.SUCCESS: "Converged.",
        nlopt.FTOL_REACHED: "Converged: the value changes no more.",
        nlopt.XTOL_REACHED: "Converged: the step has become negligible.",
        nlopt.ROUNDOFF_LIMITED: "Ended where roundoff hides any further progress.",
    }
    stalls = {
        nlopt.FORCED_STOP: "Stopped by the method itself.",
        nlopt.FAILURE: "NLopt could not continue from its best point.",
    }
    try:
        point = opt.optimize(watch.start)
        while again and np.abs((further := opt.optimize(point)) - point).max() > RESTART_DISTANCE:
            point = further
    except Exception:
        # NLopt raises on ends that are ordinary here, under names that differ between its versions.
        if opt.last_optimize_result() not in (nlopt.ROUNDOFF_LIMITED, *stalls):
            raise
    code = opt.last_optimize_result()
    if code in ends:
        return ends[code]
    raise Stalled(stalls.get(code, f"NLopt ended with its code {code}."))


def _sampling(algorithm: str, *, constraints: bool, population: Callable[[int], int] | None = None) -> Method:
    """A global method without an end of its own: it runs until the budget is spent.

    ``population``: members from the dimension alone, so that a larger budget continues a smaller one.
    """

    def run(watch: Watch, seed: int) -> str:
        import nlopt

        nlopt.srand(seed)  # the generator belongs to the calling thread
        opt = _bounded(algorithm, watch)
        if population is not None:
            opt.set_population(population(watch.dimension))
        (_on_objective if constraints else _on_merit)(opt, watch)
        return _optimize(opt, watch)

    return run


def _local(algorithm: str, *, constraints: bool) -> Method:
    def run(watch: Watch, seed: int) -> str:
        opt = _bounded(algorithm, watch)
        if algorithm.startswith("LN_"):  # MMA given a first step stops short of the optimum
            opt.set_initial_step(LOCAL_STEP)
        opt.set_xtol_abs(LOCAL_TOLERANCE)
        opt.set_xtol_rel(LOCAL_TOLERANCE)
        (_on_objective if constraints else _on_merit)(opt, watch)
        return _optimize(opt, watch, again=algorithm in STOPS_SHORT)

    return run


def mlsl(watch: Watch, seed: int) -> str:
    """Starts from a low-discrepancy sequence, each followed by COBYLA on the merit."""
    import nlopt

    nlopt.srand(seed)
    opt = _bounded("G_MLSL_LDS", watch)
    local = _bounded("LN_COBYLA", watch)
    local.set_initial_step(LOCAL_STEP)
    local.set_xtol_abs(1e-5)
    opt.set_local_optimizer(local)
    opt.set_population(4)
    _on_merit(opt, watch)
    return _optimize(opt, watch)


def ags(watch: Watch, seed: int) -> str:
    """AGS takes constraints one by one, ten at most: the surplus share the last place, the least counts."""
    opt = _bounded("GN_AGS", watch)
    opt.set_min_objective(lambda x, gradient: watch.objective(x))
    count = watch.constraint_count
    for place in range(min(count, AGS_CONSTRAINTS)):
        last = count if place == AGS_CONSTRAINTS - 1 else place + 1

        def constraint(x: FloatArray, gradient: FloatArray, part: slice = slice(place, last)) -> float:
            return float(-watch.constraints(x)[part].min())

        opt.add_inequality_constraint(constraint, 0.0)
    return _optimize(opt, watch)


def _global_abilities(
    *, constraints: bool, discrete: bool, random: bool, largest_dimension: int | None = None
) -> Abilities:
    return Abilities(
        constraints=constraints,
        discrete=discrete,
        derivatives=False,
        random=random,
        whole_space=True,
        batch=False,
        largest_dimension=largest_dimension,
    )


def _local_abilities(*, constraints: bool, derivatives: bool) -> Abilities:
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
        "nlopt.direct_l",
        "dividing rectangles, locally biased; deterministic",
        "Gablonsky and Kelley, 2001",
        _global_abilities(constraints=False, discrete=True, random=False),
        watched(_sampling("GN_DIRECT_L", constraints=False)),
    ),
    Optimizer(
        "nlopt.crs2_lm",
        "controlled random search with local mutation",
        "Kaelo and Ali, 2006",
        _global_abilities(constraints=False, discrete=True, random=True),
        watched(_sampling("GN_CRS2_LM", constraints=False, population=lambda n: 10 * (n + 1))),
    ),
    Optimizer(
        "nlopt.isres",
        "evolution strategy with stochastic ranking of constraints",
        "Runarsson and Yao, 2005",
        _global_abilities(constraints=True, discrete=True, random=True),
        watched(_sampling("GN_ISRES", constraints=True, population=lambda n: 20 * (n + 1))),
    ),
    Optimizer(
        "nlopt.esch",
        "evolutionary algorithm with Cauchy mutation",
        "da Silva Santos, Goncalves and Hernandez-Figueroa, 2010",
        _global_abilities(constraints=False, discrete=True, random=True),
        watched(_sampling("GN_ESCH", constraints=False, population=lambda n: 40)),
    ),
    Optimizer(
        "nlopt.ags",
        "Lipschitz search along a space-filling curve; constraints by index; few variables",
        "Strongin and Sergeyev, 2000",
        _global_abilities(constraints=True, discrete=False, random=False, largest_dimension=10),
        watched(ags),
    ),
    Optimizer(
        "nlopt.mlsl",
        "multi-level single linkage: local searches from a low-discrepancy sequence",
        "Rinnooy Kan and Timmer, 1987; Kucherenko and Sytsko, 2005",
        _global_abilities(constraints=False, discrete=False, random=False),
        watched(mlsl),
    ),
    Optimizer(
        "nlopt.bobyqa",
        "local: quadratic models within bounds; halts at kinks, so best without constraints",
        "Powell, 2009",
        _local_abilities(constraints=False, derivatives=False),
        watched(_local("LN_BOBYQA", constraints=False)),
    ),
    Optimizer(
        "nlopt.cobyla",
        "local: linear models of objective and constraints",
        "Powell, 1994",
        _local_abilities(constraints=True, derivatives=False),
        watched(_local("LN_COBYLA", constraints=True)),
    ),
    Optimizer(
        "nlopt.sbplx",
        "local: downhill simplex on a sequence of subspaces",
        "Rowan, 1990",
        _local_abilities(constraints=False, derivatives=False),
        watched(_local("LN_SBPLX", constraints=False)),
    ),
    Optimizer(
        "nlopt.slsqp",
        "local: sequential quadratic programming on difference quotients",
        "Kraft, 1988",
        _local_abilities(constraints=True, derivatives=True),
        watched(_local("LD_SLSQP", constraints=True)),
    ),
    Optimizer(
        "nlopt.mma",
        "local: method of moving asymptotes, globally convergent, on difference quotients",
        "Svanberg, 2002",
        _local_abilities(constraints=True, derivatives=True),
        watched(_local("LD_MMA", constraints=True)),
    ),
    Optimizer(
        "nlopt.ccsaq",
        "local: conservative convex separable quadratic models on difference quotients",
        "Svanberg, 2002",
        _local_abilities(constraints=True, derivatives=True),
        watched(_local("LD_CCSAQ", constraints=True)),
    ),
)
