"""What a problem's samples, machines within the tolerances, add to its constraints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tpm_design.evaluation.contexts import Pose, offset_context, pose_region
from tpm_design.evaluation.goals import UNDEFINED_VIOLATION, measure, slack_pieces, slacks_near
from tpm_design.metrics.base import FloatArray, Measurement
from tpm_design.metrics.context import Context
from tpm_design.metrics.neighbourhood import Neighbourhood
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


def samples_near(
    problem: Problem, designs: Neighbourhood, sampled: Sampled
) -> dict[str, list[FloatArray] | None]:
    """Of N designs next to the one that was ``sampled`` its pieces, (N, P) for each sample of a constraint;
    None where they are not known."""
    goals = {goal.label: goal for goal in problem.constraints}
    machines = _MachinesNear(problem, designs)
    found: dict[str, list[FloatArray] | None] = {}
    for sample, judged in zip(problem.samples, sampled.measured, strict=False):
        before = found.get(sample.label, [])
        slacks = _sample_near(goals[sample.label], sample, judged, machines)
        found[sample.label] = None if before is None or slacks is None else [*before, slacks]
    return found


def _sample_near(
    goal: Goal, sample: Sample, judged: Sequence[Measurement], machines: _MachinesNear
) -> FloatArray | None:
    if not judged:
        return np.full((machines.count, 1), -UNDEFINED_VIOLATION * goal.metric.scale)
    there = machines.of(sample)
    slacks = None if there is None else slacks_near(goal, judged[0], there)
    if there is None or slacks is None or sample.pose is None:
        return None if slacks is None else slacks - sample.margin
    at_pose = slacks_near(goal, judged[1], _at_pose(there, sample.pose))
    if at_pose is None:
        return None
    return np.hstack([slacks, at_pose.min(axis=1, keepdims=True)]) - sample.margin


def _at_pose(designs: Neighbourhood, pose: Pose) -> Neighbourhood:
    return Neighbourhood(tuple(replace(c, region=pose_region(c, pose)) for c in designs.contexts))


def _sample_slacks(goal: Goal, sample: Sample, judged: Sequence[Measurement]) -> tuple[float, ...]:
    """Over the region all slacks, at the sample's pose the least."""
    values = slack_pieces(goal, judged[0])
    for at_pose in judged[1:]:
        values = (*values, min(slack_pieces(goal, at_pose)))
    return tuple(value - sample.margin for value in values)


MachineKey = tuple[tuple[str, tuple[float, ...]], ...]


def _machine_key(sample: Sample) -> MachineKey:
    return tuple(sorted(sample.offsets.items()))


class _Machines:
    """The machines of a problem's samples in the place of one design; samples of the same machine share what
    their metrics need."""

    def __init__(self, problem: Problem, context: Context) -> None:
        self._problem, self._nominal = problem, context
        self._found: dict[MachineKey, Context | str] = {(): context}

    def of(self, sample: Sample) -> Context | str:
        """The machine's context, or why there is no such machine."""
        machine = _machine_key(sample)
        if machine not in self._found:
            self._found[machine] = offset_context(self._problem, self._nominal, sample.offsets)
        return self._found[machine]


class _MachinesNear:
    """As ``_Machines``, in the places of N designs next to one another."""

    def __init__(self, problem: Problem, designs: Neighbourhood) -> None:
        self._problem, self._nominal = problem, designs
        self.count = len(designs.contexts)
        self._found: dict[MachineKey, Neighbourhood | None] = {(): designs}

    def of(self, sample: Sample) -> Neighbourhood | None:
        """The machine's contexts, None where one of them cannot be."""
        machine = _machine_key(sample)
        if machine not in self._found:
            contexts = [offset_context(self._problem, c, sample.offsets) for c in self._nominal.contexts]
            possible = tuple(context for context in contexts if isinstance(context, Context))
            self._found[machine] = Neighbourhood(possible) if len(possible) == self.count else None
        return self._found[machine]
