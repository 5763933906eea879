"""Design space + metrics + constraints → Evaluation: the only place that evaluates a design."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from tpm_design.errors import ParameterError
from tpm_design.mechanisms.base import Dimension, MechanismKind
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.metrics.base import COSTS, UNDEFINED, Measurement, Metric, Sense
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
    octants keeps one range. ``scale``: "log" is searched by its logarithm, ``lower`` > 0. ``ratio_of``: the
    parameter that it is searched as a multiple of; ``lower``, ``upper`` and ``initial`` are multiples then,
    its value in a design is SI like any other.
    """

    name: str
    dimension: Dimension | Literal["mode"]
    lower: float = 0.0
    upper: float = 0.0
    values: tuple[float, ...] | tuple[str, ...] = ()
    initial: float | str | None = None
    mirrored: bool = False
    scale: Literal["linear", "log"] = "linear"
    ratio_of: str | None = None


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
class Cutoff:
    """What a design must not be worse than to be worth measuring: a ``violation`` and, where that is 0, a
    value of the objective as ``scaled_objective`` gives it."""

    violation: float
    objective: float


@dataclass(frozen=True)
class Neighbour:
    """A design next to another one: ``step`` away from it along one continuous variable, in the variable's
    SI unit, or of the multiple where it is a ratio; not 0."""

    design: Design
    step: float


Neighbours = Sequence[Neighbour]

Slopes = Mapping[str, tuple[tuple[float, ...], ...]]
"""Label → of each of its pieces (constraints: of the slacks; an objective without pieces: of its value) the
derivative along each neighbour's variable, SI. Missing: not known to first order."""


@dataclass(frozen=True)
class Evaluation:
    """One evaluated design, SI units. ``slacks``: constraint label → signed distance to its bound, the
    least of its ``pieces``: one number, or a fixed number of them, smoother in the design; those of the
    problem's samples included. Of several objectives ``pieces`` has the values of which each is the least or
    the greatest, none where it is one by itself.

    "aborted": found to be worse than ``cutoff`` before everything was measured. What was not measured is
    missing; ``violation`` is what it is at least. ``slopes``: None where they were not asked for.
    """

    design: Design
    metrics: Mapping[str, float]
    errors: Mapping[str, float]
    slacks: Mapping[str, float]
    pieces: Mapping[str, tuple[float, ...]]
    notes: Mapping[str, str]
    violation: float
    status: Literal["feasible", "infeasible", "failed", "aborted"]
    reason: str
    seconds: float
    cutoff: Cutoff | None = None
    slopes: Slopes | None = None


def with_ties(ties: Mapping[str, str], design: Design) -> Design:
    """The design with every tied parameter at the value of the one it names."""
    return {**design, **{name: design[source] for name, source in ties.items()}}


def evaluate(
    problem: Problem,
    design: Design,
    cutoff: Cutoff | None = None,
    neighbours: Neighbours | None = None,
) -> Evaluation:
    """Every objective, constraint and recorded metric of one design, the cheap ones first.

    A constraint is met only on the unfavourable side of its metric's numeric error, and where the problem's
    samples meet it too. A design that cannot be built or measured gets status "failed" and its reason;
    nothing is raised. With a ``cutoff`` the evaluation ends as "aborted" as soon as the design is sure to be
    worse: measured to the end it would be. With ``neighbours`` come slopes.
    """
    began = time.perf_counter()
    measured: dict[str, Measurement] = {}
    try:
        context = design_context(problem, design)
        for goal in _by_cost(problem):
            why = _why_worse(problem, measured, cutoff)
            if why:
                return _judged(problem, design, measured, began, cutoff=cutoff, why=why)
            measured[goal.label] = _measure(context, goal)
        if problem.samples:
            why = _why_worse(problem, measured, cutoff)
            if why:
                return _judged(problem, design, measured, began, cutoff=cutoff, why=why)
        sampled = _sampled(problem, context, measured)
        slopes = None if neighbours is None else _slopes(problem, context, measured, sampled, neighbours)
    except (ParameterError, ArithmeticError) as error:
        reason = error.what if isinstance(error, ParameterError) else str(error)
        return Evaluation(
            design=dict(design),
            metrics={},
            errors={},
            slacks={},
            pieces={},
            notes={},
            violation=math.inf,
            status="failed",
            reason=reason,
            seconds=time.perf_counter() - began,
            slopes=None if neighbours is None else {},
        )
    return _judged(problem, design, measured, began, sampled=sampled, slopes=slopes)


def is_worse(problem: Problem, evaluation: Evaluation, cutoff: Cutoff) -> bool:
    """Whether what was measured of a design is enough to be worse than a cutoff."""
    value = evaluation.metrics.get(problem.objectives[0].label, math.nan)
    return bool(_worse(problem, evaluation.violation, value, cutoff))


def scaled_objective(goal: Goal, value: float) -> float:
    """An objective's value (SI) over its scale, turned so that less is better."""
    return (value if goal.sense == "minimize" else -value) / goal.metric.scale


def _by_cost(problem: Problem) -> list[Goal]:
    """What decides on a design, cheap metrics first, then what is only recorded."""
    deciding = (*problem.objectives, *problem.constraints)
    return [*sorted(deciding, key=lambda goal: COSTS.index(goal.metric.cost)), *problem.record]


def _why_worse(problem: Problem, measured: Mapping[str, Measurement], cutoff: Cutoff | None) -> str:
    """Why a design is worse than a cutoff, empty where that is not sure yet."""
    if cutoff is None:
        return ""
    short = _shortfalls(problem, measured, {})
    first = measured.get(problem.objectives[0].label)
    value = math.nan if first is None else first.value
    worse = _worse(problem, sum(short.values()), value, cutoff)
    if worse == "violation" and cutoff.violation == 0.0:
        return f"{', '.join(label for label, value in short.items() if value > 0.0)} missed"
    return problem.objectives[0].label if worse == "objective" else worse


def _worse(
    problem: Problem, violation: float, objective: float, cutoff: Cutoff
) -> Literal["", "violation", "objective"]:
    """In what a design with at least this ``violation`` is worse; ``objective`` (SI): NaN if not known."""
    if violation > cutoff.violation:
        return "violation"
    goal = problem.objectives[0]
    if cutoff.violation == 0.0 and len(problem.objectives) == 1 and math.isfinite(objective):
        return "objective" if scaled_objective(goal, objective) > cutoff.objective else ""
    return ""


def _slack_pieces(
    problem: Problem, measured: Mapping[str, Measurement], sampled: Mapping[str, tuple[float, ...]]
) -> dict[str, tuple[float, ...]]:
    """Of each constraint that was measured, those of the samples included."""
    return {
        goal.label: slack_pieces(goal, measured[goal.label]) + sampled.get(goal.label, ())
        for goal in problem.constraints
        if goal.label in measured
    }


def _objective_pieces(problem: Problem, measured: Mapping[str, Measurement]) -> dict[str, tuple[float, ...]]:
    """Of each of several objectives that was measured: a search for a front bounds objectives too."""
    if len(problem.objectives) == 1:
        return {}
    return {g.label: measured[g.label].pieces for g in problem.objectives if g.label in measured}


def _shortfalls(
    problem: Problem, measured: Mapping[str, Measurement], sampled: Mapping[str, tuple[float, ...]]
) -> dict[str, float]:
    """What each goal that was measured adds to the violation."""
    pieces = _slack_pieces(problem, measured, sampled)
    scales = {goal.label: goal.metric.scale for goal in problem.constraints}
    short = {label: max(0.0, -min(values)) / scales[label] for label, values in pieces.items()}
    for goal in problem.objectives:
        if goal.label in measured and UNDEFINED in measured[goal.label].notes:
            short[goal.label] = UNDEFINED_VIOLATION
    return short


def _judged(
    problem: Problem,
    design: Design,
    measured: Mapping[str, Measurement],
    began: float,
    *,
    sampled: _Sampled | None = None,
    cutoff: Cutoff | None = None,
    why: str = "",
    slopes: Slopes | None = None,
) -> Evaluation:
    """The evaluation of what was measured: everything, or enough to be worse than a cutoff."""
    sampled = sampled or _Sampled({}, {})
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    found = {goal.label: measured[goal.label] for goal in goals if goal.label in measured}
    pieces = _slack_pieces(problem, measured, sampled.pieces)
    short = _shortfalls(problem, measured, sampled.pieces)
    missed = [label for label, value in short.items() if value > 0.0]
    status: Literal["feasible", "infeasible", "aborted"] = "infeasible" if missed else "feasible"
    if cutoff is not None:
        status = "aborted"
        left = ", ".join(goal.label for goal in goals if goal.label not in measured) or "samples"
        reason = f"not measured further: {left}; already worse than the best known ({why})"
    else:
        reason = "; ".join(_why_missed(label, problem, measured, sampled) for label in missed)
    return Evaluation(
        design=dict(design),
        metrics={label: m.value for label, m in found.items()},
        errors={label: m.error for label, m in found.items()},
        slacks={label: min(values) for label, values in pieces.items()},
        pieces={**pieces, **_objective_pieces(problem, measured)},
        notes={
            f"{label}_{key}": note
            for label, m in found.items()
            for key, note in m.notes.items()
            if key != UNDEFINED
        },
        violation=sum(short.values()),
        status=status,
        reason=reason,
        seconds=time.perf_counter() - began,
        cutoff=cutoff,
        slopes=slopes,
    )


def _why_missed(label: str, problem: Problem, measured: Mapping[str, Measurement], sampled: _Sampled) -> str:
    if UNDEFINED in measured[label].notes:
        return f"{label}: {measured[label].notes[UNDEFINED]}"
    goal = next(goal for goal in problem.constraints if goal.label == label)
    by_itself = min(slack_pieces(goal, measured[label])) >= 0.0
    return f"{label} missed{sampled.why(label) if by_itself else ''}"


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
    """``pieces``: slacks of the samples by constraint, less their margins; ``reasons``: why one is missed.
    ``measured``: what each sample was judged by, over the region and at its pose; nothing where its machine
    cannot be."""

    pieces: Mapping[str, tuple[float, ...]]
    reasons: Mapping[str, str]
    measured: tuple[tuple[Measurement, ...], ...] = ()

    def why(self, label: str) -> str:
        return f" {self.reasons[label]}" if label in self.reasons else ""


def _sampled(problem: Problem, context: Context, nominal: Mapping[str, Measurement]) -> _Sampled:
    goals = {goal.label: goal for goal in problem.constraints}
    machines = _Machines(problem, context)
    pieces: dict[str, tuple[float, ...]] = {}
    reasons: dict[str, str] = {}
    measured: list[tuple[Measurement, ...]] = []
    for sample in problem.samples:
        goal, machine = goals[sample.label], machines.of(sample)
        if isinstance(machine, str):
            measured.append(())
            found: tuple[float, ...] = (-UNDEFINED_VIOLATION * goal.metric.scale,)
            why = f"within the tolerances: {machine}"
        else:
            over = _measure(machine, goal) if sample.offsets else nominal[sample.label]
            judged = [over]
            if sample.pose is not None:
                judged.append(_measure(replace(machine, region=_pose_region(machine, sample.pose)), goal))
            measured.append(tuple(judged))
            found = _sample_slacks(goal, sample, judged)
            why = "within the tolerances" if sample.offsets else "by the margin that its proof needs"
        pieces[sample.label] = pieces.get(sample.label, ()) + found
        if min(found) < 0.0:
            reasons.setdefault(sample.label, why)
    return _Sampled(pieces, reasons, tuple(measured))


def _sample_slacks(goal: Goal, sample: Sample, judged: Sequence[Measurement]) -> tuple[float, ...]:
    """Over the region all slacks, at the sample's pose the least."""
    values = slack_pieces(goal, judged[0])
    for at_pose in judged[1:]:
        values = (*values, min(slack_pieces(goal, at_pose)))
    return tuple(value - sample.margin for value in values)


class _Machines:
    """The machines of a problem's samples in the place of one design; samples of the same machine share what
    their metrics need."""

    def __init__(self, problem: Problem, context: Context) -> None:
        self._problem, self._nominal = problem, context
        self._found: dict[tuple[tuple[str, tuple[float, ...]], ...], Context | str] = {(): context}

    def of(self, sample: Sample) -> Context | str:
        """The machine's context, or why there is no such machine."""
        machine = tuple(sorted(sample.offsets.items()))
        if machine not in self._found:
            self._found[machine] = _offset_context(self._problem, self._nominal, sample.offsets)
        return self._found[machine]


def _slopes(
    problem: Problem,
    context: Context,
    measured: Mapping[str, Measurement],
    sampled: _Sampled,
    neighbours: Neighbours,
) -> Slopes:
    """Difference quotients of what a design's measurements say of its neighbours."""
    here = _seen_near(problem, context, measured, sampled)
    there = []
    for neighbour in neighbours:
        try:
            there.append(_seen_near(problem, design_context(problem, neighbour.design), measured, sampled))
        except ParameterError:
            return {}
    slopes = {}
    for label, values in here.items():
        found = [
            [(after - before) / neighbour.step for before, after in zip(values, seen[label], strict=True)]
            for neighbour, seen in zip(neighbours, there, strict=True)
        ]
        rows = tuple(zip(*found, strict=True)) if found else ((),) * len(values)
        if all(math.isfinite(slope) for row in rows for slope in row):
            slopes[label] = rows
    return slopes


def _seen_near(
    problem: Problem, context: Context, measured: Mapping[str, Measurement], sampled: _Sampled
) -> dict[str, tuple[float, ...]]:
    """Pieces of objectives and constraints as the measurements of a design next to this one tell them."""
    found: dict[str, tuple[float, ...]] = {}
    for goal in problem.objectives:
        near = measured[goal.label].near
        if near is not None:
            there = near(context)
            in_pieces = there.pieces if len(problem.objectives) > 1 else ()
            # what is undefined is level
            found[goal.label] = (0.0,) if UNDEFINED in there.notes else in_pieces or (there.value,)
    of_samples = _samples_near(problem, context, sampled)
    for goal in problem.constraints:
        near, more = measured[goal.label].near, of_samples.get(goal.label, ())
        if near is not None and more is not None:
            found[goal.label] = slack_pieces(goal, near(context)) + more
    return found


def _samples_near(
    problem: Problem, context: Context, sampled: _Sampled
) -> dict[str, tuple[float, ...] | None]:
    """As ``_Sampled.pieces`` next to the design; None where it is not known."""
    goals = {goal.label: goal for goal in problem.constraints}
    machines = _Machines(problem, context)
    found: dict[str, tuple[float, ...] | None] = {}
    for sample, judged in zip(problem.samples, sampled.measured, strict=False):
        goal, before = goals[sample.label], found.get(sample.label, ())
        slacks: tuple[float, ...] | None = (-UNDEFINED_VIOLATION * goal.metric.scale,)
        if judged:
            slacks = _sample_near(goal, sample, judged, machines.of(sample))
        found[sample.label] = None if before is None or slacks is None else before + slacks
    return found


def _sample_near(
    goal: Goal, sample: Sample, judged: Sequence[Measurement], machine: Context | str
) -> tuple[float, ...] | None:
    if isinstance(machine, str) or any(measurement.near is None for measurement in judged):
        return None
    seen: list[Measurement] = []
    for measurement in judged:
        region = _pose_region(machine, sample.pose) if seen and sample.pose is not None else machine.region
        if measurement.near is not None:
            seen.append(measurement.near(replace(machine, region=region)))
    return _sample_slacks(goal, sample, seen)


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
