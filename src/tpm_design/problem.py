"""Design space + metrics + constraints → Evaluation: the only place that evaluates a design."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from tpm_design.errors import ParameterError
from tpm_design.mechanisms.base import Dimension, MechanismKind
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.metrics.base import UNDEFINED, Measurement, Metric, Sense
from tpm_design.metrics.context import Context
from tpm_design.workspace.region_geometry import PlacedRegion, place
from tpm_design.workspace.regions import Points, Shape

CENTRE = ("center_x", "center_y", "center_z")
UNDEFINED_VIOLATION = 1.0

Design = Mapping[str, float | str]
"""Parameter names → SI values, ``center_x`` … → metres, ``mode`` → the mode's label."""


@dataclass(frozen=True)
class Variable:
    """One free quantity. Continuous: ``lower``..``upper``. Otherwise one of ``values`` (SI or mode labels).

    ``mirrored``: the value takes the sign of the mode's octant along that axis, so that a search over
    octants keeps one range.
    """

    name: str
    dimension: Dimension | Literal["mode"]
    lower: float = 0.0
    upper: float = 0.0
    values: tuple[float, ...] | tuple[str, ...] = ()
    initial: float | str | None = None
    mirrored: bool = False


@dataclass(frozen=True)
class Goal:
    """One metric with its options, as an objective, a constraint or a recorded figure.

    Objective: ``sense``. Constraint: ``minimum`` and/or ``maximum`` in SI. Recorded: none of them.
    """

    metric: Metric
    label: str
    options: Mapping[str, Any] = field(default_factory=dict)
    sense: Sense | None = None
    minimum: float | None = None
    maximum: float | None = None


@dataclass(frozen=True)
class Accuracy:
    """``volume``: relative error wanted of volumes and averages. ``region_samples``: samples along the
    longest edge of the region from which its extremes are polished."""

    volume: float = 1e-3
    region_samples: int = 9


@dataclass(frozen=True)
class Sample:
    """The constraint ``label`` must also hold, with ``margin`` (its metric's SI unit) to spare, for the
    machine whose parameters differ from the design's by ``offsets`` (name → one per limb, SI; empty: the
    exact one), over the whole region and at ``pose`` (m, about the region's centre; None: at none alone)."""

    label: str
    offsets: Mapping[str, tuple[float, ...]]
    pose: tuple[float, float, float] | None
    margin: float


@dataclass(frozen=True)
class Problem:
    """What a study asks. ``modes``: label → sign strings, ``{"+++ +-+": {"octant": …, "elbows": …}}``.
    ``samples``: what every design must hold besides; a design's metrics are those of its exact machine.
    ``ties``: parameters that take the value of another one, by name: neither fixed nor free."""

    kind: MechanismKind
    fixed: Mapping[str, float | str]
    variables: tuple[Variable, ...]
    modes: Mapping[str, Mapping[str, str]]
    limits: Mapping[str, Any]
    region: Shape | None
    objectives: tuple[Goal, ...]
    constraints: tuple[Goal, ...]
    record: tuple[Goal, ...]
    accuracy: Accuracy = Accuracy()
    samples: tuple[Sample, ...] = ()
    ties: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Evaluation:
    """One evaluated design, SI units. ``slacks``: constraint label → signed distance to its bound, the
    least of its ``pieces``: one number, or a fixed number of them, smoother in the design; those of the
    problem's samples included. Of several objectives ``pieces`` has the values of which each is the least or
    the greatest, none where it is one by itself."""

    design: Design
    metrics: Mapping[str, float]
    errors: Mapping[str, float]
    slacks: Mapping[str, float]
    pieces: Mapping[str, tuple[float, ...]]
    notes: Mapping[str, str]
    violation: float
    status: Literal["feasible", "infeasible", "failed"]
    reason: str
    seconds: float


def with_ties(ties: Mapping[str, str], design: Design) -> Design:
    """The design with every tied parameter at the value of the one it names."""
    return {**design, **{name: design[source] for name, source in ties.items()}}


def evaluate(problem: Problem, design: Design) -> Evaluation:
    """Every objective, constraint and recorded metric of one design.

    A constraint is met only on the unfavourable side of its metric's numeric error, and where the problem's
    samples meet it too. A design that cannot be built or measured gets status "failed" and its reason;
    nothing is raised.
    """
    began = time.perf_counter()
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    try:
        context = design_context(problem, design)
        measurements = {goal.label: _measure(context, goal) for goal in goals}
        sampled = _sampled(problem, context, measurements)
    except (ParameterError, ArithmeticError) as error:
        reason = error.what if isinstance(error, ParameterError) else str(error)
        return Evaluation(
            dict(design), {}, {}, {}, {}, {}, math.inf, "failed", reason, time.perf_counter() - began
        )
    undefined = {label: m.notes[UNDEFINED] for label, m in measurements.items() if UNDEFINED in m.notes}
    own = {goal.label: slack_pieces(goal, measurements[goal.label]) for goal in problem.constraints}
    pieces = {label: values + sampled.pieces.get(label, ()) for label, values in own.items()}
    slacks = {label: min(values) for label, values in pieces.items()}
    if len(problem.objectives) > 1:
        # a search for a front bounds objectives too
        pieces |= {goal.label: measurements[goal.label].pieces for goal in problem.objectives}
    short = {goal.label: max(0.0, -slacks[goal.label]) / goal.metric.scale for goal in problem.constraints}
    for goal in problem.objectives:
        if goal.label in undefined:
            short[goal.label] = UNDEFINED_VIOLATION
    violation = sum(short.values())
    missed = [label for label, value in short.items() if value > 0.0]
    return Evaluation(
        design=dict(design),
        metrics={label: m.value for label, m in measurements.items()},
        errors={label: m.error for label, m in measurements.items()},
        slacks=slacks,
        pieces=pieces,
        notes={
            f"{label}_{key}": note
            for label, m in measurements.items()
            for key, note in m.notes.items()
            if key != UNDEFINED
        },
        violation=violation,
        status="infeasible" if missed else "feasible",
        reason="; ".join(
            f"{label}: {undefined[label]}"
            if label in undefined
            else f"{label} missed{sampled.why(label) if min(own[label]) >= 0.0 else ''}"
            for label in missed
        ),
        seconds=time.perf_counter() - began,
    )


def design_context(problem: Problem, design: Design) -> Context:
    """The mechanism, mode and placed region of one design. Raises ParameterError where it cannot be."""
    names = set(problem.kind.parameter_names())
    values = {name: value for name, value in design.items() if name in names}
    mechanism = problem.kind.build(values, problem.limits)
    mode = mechanism.mode_of(problem.modes[str(design["mode"])])
    region = None
    if problem.region is not None:
        region = place(problem.region, problem.kind.centre(design))
    return Context(mechanism, mode, region, problem.accuracy.volume, problem.accuracy.region_samples)


@dataclass(frozen=True)
class _Sampled:
    """``pieces``: slacks of the samples by constraint, less their margins; ``reasons``: why one is missed."""

    pieces: Mapping[str, tuple[float, ...]]
    reasons: Mapping[str, str]

    def why(self, label: str) -> str:
        return f" {self.reasons[label]}" if label in self.reasons else ""


def _sampled(problem: Problem, context: Context, nominal: Mapping[str, Measurement]) -> _Sampled:
    goals = {goal.label: goal for goal in problem.constraints}
    # samples of the same machine share what their metrics need
    contexts: dict[tuple[tuple[str, tuple[float, ...]], ...], Context | str] = {(): context}
    pieces: dict[str, tuple[float, ...]] = {}
    reasons: dict[str, str] = {}
    for sample in problem.samples:
        goal, machine = goals[sample.label], tuple(sorted(sample.offsets.items()))
        if machine not in contexts:
            contexts[machine] = _offset_context(problem, context, sample.offsets)
        of_machine = contexts[machine]
        if isinstance(of_machine, str):
            found: tuple[float, ...] = (-UNDEFINED_VIOLATION * goal.metric.scale,)
            why = f"within the tolerances: {of_machine}"
        else:
            over = nominal[sample.label] if not machine else _measure(of_machine, goal)
            values = slack_pieces(goal, over)
            if sample.pose is not None:
                at_pose = replace(of_machine, region=_pose_region(of_machine, sample.pose))
                values = (*values, min(slack_pieces(goal, _measure(at_pose, goal))))
            found = tuple(value - sample.margin for value in values)
            why = "within the tolerances" if machine else "by the margin that its proof needs"
        pieces[sample.label] = pieces.get(sample.label, ()) + found
        if min(found) < 0.0:
            reasons.setdefault(sample.label, why)
    return _Sampled(pieces, reasons)


def _offset_context(
    problem: Problem, context: Context, offsets: Mapping[str, tuple[float, ...]]
) -> Context | str:
    """The same place with another machine, or why there is none."""
    try:
        return replace(context, mechanism=offset_mechanism(problem, context.mechanism, offsets))
    except ParameterError as error:
        return error.what


def offset_mechanism(
    problem: Problem, nominal: Mechanism, offsets: Mapping[str, tuple[float, ...]]
) -> Mechanism:
    """The machine whose limbs differ from ``nominal`` by ``offsets`` (name → one per limb, SI). Raises
    ParameterError where there is no such machine."""
    values = {
        name: tuple(v + o for v, o in zip(per_limb, offsets.get(name, (0.0,) * len(per_limb)), strict=True))
        for name, per_limb in nominal.parameters.items()
    }
    return problem.kind.build(values, problem.limits)


def _pose_region(context: Context, pose: tuple[float, float, float]) -> PlacedRegion:
    """One pose of the context's region, given about its centre."""
    return place(Points((pose,)), context.placed.centre)


def slack_pieces(goal: Goal, measurement: Measurement) -> tuple[float, ...]:
    """Signed distances of a constraint to its bound, less the numeric error: met where all are ≥ 0. In the
    metric's unit, or as the metric defines them where its value is flat."""
    if UNDEFINED in measurement.notes:
        return (-UNDEFINED_VIOLATION * goal.metric.scale,)
    if measurement.full_slack is not None and goal.minimum is not None and goal.minimum >= 1.0:
        return measurement.pieces or (measurement.full_slack,)
    return tuple(_slack(goal, measurement, value) for value in measurement.pieces or (measurement.value,))


def _slack(goal: Goal, measurement: Measurement, value: float) -> float:
    below = math.inf if goal.minimum is None else value - measurement.error - goal.minimum
    above = math.inf if goal.maximum is None else goal.maximum - value - measurement.error
    least = min(below, above)
    return least + measurement.depth if least < 0.0 else least


def _measure(context: Context, goal: Goal) -> Measurement:
    options = {option.name: goal.options.get(option.name, option.default) for option in goal.metric.options}
    measurement = goal.metric.compute(context, options)
    value, error = measurement.value, measurement.error
    if UNDEFINED not in measurement.notes and not (math.isfinite(value) and math.isfinite(error)):
        raise ArithmeticError(f"{goal.label} is {value!r} with error {error!r}")
    return measurement
