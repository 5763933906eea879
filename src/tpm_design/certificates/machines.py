"""Machines within manufacturing tolerances, each limb by itself, and where they are worst."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tpm_design.certificates.demands import Demand
from tpm_design.errors import ParameterError
from tpm_design.evaluation.contexts import offset_mechanism
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.mechanisms.parameters import limb_tolerances
from tpm_design.metrics.context import Context
from tpm_design.problem import Problem
from tpm_design.workspace.indices import index_values

Parameters = Mapping[str, tuple[float, ...]]
Pose = tuple[float, float, float]
ROUNDS = 3


@dataclass(frozen=True)
class Worst:
    """Where a search found a demand to be met least: ``slack`` (in the demand's SI unit, negative where it
    is not met), ``pose`` (m, None where there is none), and the machine's parameters."""

    slack: float
    pose: Pose | None
    mechanism: Mechanism


def perturbed(problem: Problem, nominal: Mechanism, offsets: Parameters) -> Mechanism | None:
    """The machine whose limbs differ from ``nominal`` by ``offsets`` (name → one per limb, SI); None where
    there is no such machine."""
    try:
        return offset_mechanism(problem, nominal, offsets)
    except ParameterError:
        return None


def slack_of(demand: Demand, context: Context) -> tuple[float, Pose | None]:
    """Least slack of a demand over the region of one machine, by search, and where."""
    kind = context.mechanism.kind
    if demand.kind == "length":
        total = context.mechanism.total_link_length()
        return demand.sense * (total - demand.bound), None
    if demand.kind == "locus":
        found = context.locus_distance(kind.determinants.index(demand.name))
        return (math.inf, None) if found.pose is None else (found.value - demand.bound, found.pose)
    extreme = context.least(demand.index(kind))
    slack = demand.sense * (demand.sign * extreme.value - demand.bound)
    if demand.kind == "reach":
        inside = context.reach
        if inside.value < slack:
            return inside.value, inside.pose
    return slack, extreme.pose


def worst_machine(
    problem: Problem, demand: Demand, context: Context, tolerance: Mapping[str, float]
) -> Worst:
    """The machine within ``tolerance`` (SI, ±, each limb by itself) and the pose at which a search finds the
    demand met least: corners of the tolerances against the slopes of the slack, the pose searched again for
    each corner."""
    slack, pose = slack_of(demand, context)
    worst = Worst(slack, pose, context.mechanism)
    free = limb_tolerances(problem.kind, tolerance)
    if not any(map(any, free.values())) or (pose is None and demand.kind != "length"):
        return worst
    tried = set()
    for _ in range(ROUNDS):
        corner = worst_corner(problem, demand, context, worst.pose, free)
        mechanism = perturbed(problem, context.mechanism, corner)
        key = tuple(sorted(corner.items()))
        if mechanism is None or key in tried:
            break
        tried.add(key)
        slack, pose = slack_of(demand, replace(context, mechanism=mechanism))
        if slack >= worst.slack:
            break
        worst = Worst(slack, pose, mechanism)
    return worst


def worst_corner(
    problem: Problem,
    demand: Demand,
    context: Context,
    pose: Pose | None,
    tolerance: Parameters,
) -> Parameters:
    """The corner of the tolerances (name → ± per limb, SI) towards which the slack at one pose falls; for a
    locus the slack of its distance."""
    at_pose = _slack_at(demand, context, pose)
    offsets: dict[str, tuple[float, ...]] = {}
    for name, bounds in tolerance.items():
        signs = []
        for limb, bound in enumerate(bounds):
            values = []
            for side in (1.0, -1.0):
                step = tuple(side * bound if k == limb else 0.0 for k in range(len(bounds)))
                machine = perturbed(problem, context.mechanism, {name: step})
                values.append(0.0 if machine is None else at_pose(machine))
            signs.append(-bound if values[0] > values[1] else bound)
        offsets[name] = tuple(signs)
    return offsets


def _slack_at(demand: Demand, context: Context, pose: Pose | None) -> Callable[[Mechanism], float]:
    if demand.kind in ("locus", "length") or pose is None:
        return lambda machine: slack_of(demand, replace(context, mechanism=machine))[0]
    index = demand.index(context.mechanism.kind)

    def at(machine: Mechanism) -> float:
        value = index_values(machine.geometry, context.mode.signs, index, np.array([pose]))[0]
        # index values are signed so that less is worse
        return float(value)

    return at
