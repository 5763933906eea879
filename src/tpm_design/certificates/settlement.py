"""One demand settled: proved with a slack, refuted at a pose, or left undecided with the reason."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from tpm_design.certificates.demands import Demand
from tpm_design.certificates.machines import Pose, Worst, perturbed, worst_corner, worst_machine
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.mechanisms.parameters import limb_tolerances
from tpm_design.metrics.context import Context
from tpm_design.problem import Problem
from tpm_design.workspace.covers import Cover, Proof, prove
from tpm_design.workspace.refutation import fails_at, folded_inside, singular_near
from tpm_design.workspace.region_geometry import nearest_pose, place
from tpm_design.workspace.regions import Points

Outcome = Literal["proved", "refuted", "undecided"]

# shares of the slack found by a search that are tried before the bound alone, so that a slack can be stated;
# a distance that is nearly the true one takes few boxes more
SLACK_SHARES = (0.5, 0.25, 0.1)
DISTANCE_SHARES = (0.98, 0.5)
# a bound of 0 on a determinant asks for a sign: some margin, however small, is needed
LEAST_MARGIN = 1e-9


@dataclass(frozen=True)
class Breaking:
    """A pose (m) and a machine within tolerance (parameters by name, SI) that break a demand."""

    pose: Pose | None
    parameters: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class Settlement:
    """``level`` (SI): what was proved, at least (at most) the demand's bound; ``covers``: its proof.
    ``boxes``: how many were looked at in all. ``found``: the least slack that a search found (SI), and
    ``worst``: where. ``open_box``: sides (m) of a box of poses on which an undecided demand is not proved."""

    demand: Demand
    outcome: Outcome
    level: float
    covers: tuple[Cover, ...]
    breaking: Breaking | None
    reason: str
    boxes: int
    found: float
    worst: Breaking
    open_box: tuple[tuple[float, float], ...] | None = None

    @property
    def slack(self) -> float:
        """Proved distance from the bound (SI), ≥ 0."""
        return self.demand.sense * (self.level - self.demand.bound)


def settle(
    problem: Problem,
    demand: Demand,
    context: Context,
    tolerance: Mapping[str, float],
    *,
    boxes: int,
    with_slack: bool = True,
) -> Settlement:
    """Prove or refute a demand for every pose of the context's region and every machine within
    ``tolerance``, with at most ``boxes`` boxes a proof. Without ``with_slack`` the bound alone is tried."""
    worst = worst_machine(problem, demand, context, tolerance)
    undecided = Settlement(demand, "undecided", demand.bound, (), None, "", 0, worst.slack, _breaking(worst))
    if demand.kind == "length":
        return _settled_length(undecided, worst.mechanism, context.mechanism, tolerance)
    breaking = _refuted_at(demand, context, worst.mechanism, worst.pose) if worst.slack < 0.0 else None
    if breaking is not None:
        return replace(undecided, outcome="refuted", breaking=breaking, reason="a pose breaks it")
    proof: Proof | None = None
    used = 0
    *ambitious, least = _levels(demand, worst, with_slack=with_slack)
    hopeful = [level for level in ambitious if _provable_at_worst(demand, level, context, tolerance, worst)]
    for level in (*hopeful, least):
        proof = _proof(demand, level, context, tolerance, boxes)
        used += proof.boxes
        if proof.proved:
            return replace(undecided, outcome="proved", level=level, covers=proof.covers, boxes=used)
    assert proof is not None
    breaking = _broken_in(problem, demand, context, tolerance, proof)
    if breaking is not None:
        return replace(undecided, outcome="refuted", breaking=breaking, reason="a pose breaks it", boxes=used)
    sides = None if proof.open_box is None else tuple((float(lo), float(hi)) for lo, hi in proof.open_box)
    reason = _reason(demand, worst, proof, boxes)
    return replace(undecided, reason=reason, boxes=used, open_box=sides)


def _levels(demand: Demand, worst: Worst, *, with_slack: bool) -> list[float]:
    """Levels to prove, the most ambitious first."""
    needed = LEAST_MARGIN if demand.kind == "determinant" and demand.bound == 0.0 else 0.0
    levels = [demand.bound + demand.sense * needed]
    slack = min(worst.slack, abs(demand.bound) + 1.0) if math.isinf(worst.slack) else worst.slack
    if demand.kind == "locus" and math.isinf(worst.slack):
        # no locus within reach: any distance would do
        slack = demand.bound
    shares = DISTANCE_SHARES if demand.kind == "locus" else SLACK_SHARES
    if with_slack and slack > needed:
        return [*(demand.bound + demand.sense * share * slack for share in shares), *levels]
    return levels


def _provable_at_worst(
    demand: Demand, level: float, context: Context, tolerance: Mapping[str, float], worst: Worst
) -> bool:
    """Whether the level is proved at the worst pose alone: where it is not, the region need not be tried."""
    if demand.kind == "locus" or worst.pose is None:
        return True
    region = place(Points((worst.pose,)), (0.0, 0.0, 0.0))
    statement = demand.statement(level, context.mechanism.kind)
    return prove(
        statement, context.mechanism, context.mode, region, tolerance=tolerance, distance=0.0, boxes=1
    ).proved


def _proof(
    demand: Demand, level: float, context: Context, tolerance: Mapping[str, float], boxes: int
) -> Proof:
    return prove(
        demand.statement(level, context.mechanism.kind),
        context.mechanism,
        context.mode,
        context.placed,
        tolerance=tolerance,
        distance=level if demand.kind == "locus" else 0.0,
        boxes=boxes,
    )


def _refuted_at(demand: Demand, context: Context, mechanism: Mechanism, pose: Pose | None) -> Breaking | None:
    """The pose and machine if they are proved to break the demand."""
    if pose is None:
        return None
    at = tuple(float(value) for value in pose)
    here = (at[0], at[1], at[2])
    if demand.kind == "locus":
        part = mechanism.kind.determinants.index(demand.name)
        singular = singular_near(mechanism, context.mode, part, here, context.placed, demand.bound)
        return None if singular is None else Breaking(singular, mechanism.parameters)
    statement = demand.statement(demand.bound, mechanism.kind)
    if fails_at(statement, mechanism, context.mode, here):
        return Breaking(here, mechanism.parameters)
    folded = folded_inside(mechanism, context.placed) if demand.kind == "reach" else None
    return None if folded is None else Breaking(folded, mechanism.parameters)


def _broken_in(
    problem: Problem, demand: Demand, context: Context, tolerance: Mapping[str, float], proof: Proof
) -> Breaking | None:
    """Whether the box that was given up holds a pose that breaks the demand, for the worst machine there."""
    if proof.open_box is None or proof.ending != "small" or demand.kind == "locus":
        return None
    middle = proof.open_box.mean(axis=1)
    # the middle of a box on a rounded face may be outside
    pose = nearest_pose(context.placed, (float(middle[0]), float(middle[1]), float(middle[2])))
    free = limb_tolerances(problem.kind, tolerance)
    machine: Mechanism | None = context.mechanism
    if any(map(any, free.values())):
        machine = perturbed(problem, context.mechanism, worst_corner(problem, demand, context, pose, free))
    return None if machine is None else _refuted_at(demand, context, machine, pose)


def _settled_length(
    undecided: Settlement, worst: Mechanism, mechanism: Mechanism, tolerance: Mapping[str, float]
) -> Settlement:
    demand = undecided.demand
    total = mechanism.enclosed_link_length(tolerance)
    level = total.hi if demand.ceiling else total.lo
    if demand.sense * (level - demand.bound) >= 0.0:
        return replace(undecided, outcome="proved", level=level)
    if undecided.found < 0.0 and _too_long_or_short(demand, worst):
        return replace(undecided, outcome="refuted", breaking=undecided.worst, reason="a machine breaks it")
    return replace(undecided, reason="the bound is attained to rounding")


def _too_long_or_short(demand: Demand, machine: Mechanism) -> bool:
    """Whether one machine is proved to break the bound: sums of lengths are rounded."""
    total = machine.enclosed_link_length({})
    return total.lo > demand.bound if demand.ceiling else total.hi < demand.bound


def _breaking(worst: Worst) -> Breaking:
    return Breaking(worst.pose, worst.mechanism.parameters)


def _reason(demand: Demand, worst: Worst, proof: Proof, boxes: int) -> str:
    if proof.ending == "limit":
        return f"{boxes} boxes were not enough"
    if abs(worst.slack) <= 1e-7 * max(1.0, abs(demand.bound)):
        return "the bound is attained, exactly or nearly, so that no box around the pose can be proved"
    if worst.slack < 0.0:
        return "a search finds it broken, and no single pose proves that"
    return "the bounds over the smallest boxes are wider than the slack that is left within the tolerances"


def breaking_data(breaking: Breaking | None) -> dict[str, Any] | None:
    """A breaking pose and machine as a certificate writes them."""
    if breaking is None:
        return None
    pose = None if breaking.pose is None else list(breaking.pose)
    return {"pose": pose, "parameters": {name: list(v) for name, v in breaking.parameters.items()}}
