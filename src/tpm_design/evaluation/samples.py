"""What a problem's samples, machines within the tolerances, add to its constraints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from tpm_design.evaluation.contexts import offset_context, pose_region
from tpm_design.evaluation.goals import UNDEFINED_VIOLATION, measure, slack_pieces
from tpm_design.metrics.base import Measurement
from tpm_design.metrics.context import Context
from tpm_design.problem import Goal, Problem, Sample


@dataclass(frozen=True)
class Sampled:
    """``pieces``: slacks of the samples by constraint, less their margins; ``reasons``: why one is missed.
    ``measured``: what each sample was judged by, over the region and at its pose; nothing where its machine
    cannot be."""

    pieces: Mapping[str, tuple[float, ...]]
    reasons: Mapping[str, str]
    measured: tuple[tuple[Measurement, ...], ...] = ()

    def why(self, label: str) -> str:
        return f" {self.reasons[label]}" if label in self.reasons else ""


def sampled_machines(problem: Problem, context: Context, nominal: Mapping[str, Measurement]) -> Sampled:
    """The problem's samples around one design, of whose exact machine ``nominal`` was measured."""
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
            over = measure(machine, goal) if sample.offsets else nominal[sample.label]
            judged = [over]
            if sample.pose is not None:
                judged.append(measure(replace(machine, region=pose_region(machine, sample.pose)), goal))
            measured.append(tuple(judged))
            found = _sample_slacks(goal, sample, judged)
            why = "within the tolerances" if sample.offsets else "by the margin that its proof needs"
        pieces[sample.label] = pieces.get(sample.label, ()) + found
        if min(found) < 0.0:
            reasons.setdefault(sample.label, why)
    return Sampled(pieces, reasons, tuple(measured))


def samples_near(problem: Problem, context: Context, sampled: Sampled) -> dict[str, tuple[float, ...] | None]:
    """As ``Sampled.pieces`` next to the design; None where it is not known."""
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
        region = pose_region(machine, sample.pose) if seen and sample.pose is not None else machine.region
        if measurement.near is not None:
            seen.append(measurement.near(replace(machine, region=region)))
    return _sample_slacks(goal, sample, seen)


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
            self._found[machine] = offset_context(self._problem, self._nominal, sample.offsets)
        return self._found[machine]
