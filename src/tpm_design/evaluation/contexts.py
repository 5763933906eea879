"""Where a design is measured: its machine in its mode and place, and other machines there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from tpm_design.errors import ParameterError
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.metrics.context import Context
from tpm_design.problem import Design, Problem
from tpm_design.workspace.region_geometry import PlacedRegion, place
from tpm_design.workspace.regions import Points

Pose = tuple[float, float, float]


def design_context(problem: Problem, design: Design) -> Context:
    """The mechanism, mode and placed region of one design. Raises ParameterError where it cannot be."""
    mechanism = problem.kind.build(_parameters(problem, design), problem.limits)
    mode = mechanism.mode_of(problem.modes[str(design["mode"])])
    return Context(
        mechanism, mode, _region(problem, design), problem.accuracy.volume, problem.accuracy.region_samples
    )


def neighbouring_contexts(
    problem: Problem, context: Context, design: Design, neighbours: Sequence[Design]
) -> list[Context]:
    """As ``design_context``, of other designs in the same mode: what they have in common with ``design``,
    whose ``context`` there is, is not made again."""
    own = _parameters(problem, design)
    found = []
    for neighbour in neighbours:
        values = {name: neighbour[name] for name in own}
        machine = context.mechanism if values == own else problem.kind.build(values, problem.limits)
        region = _region(problem, neighbour)
        found.append(Context(machine, context.mode, region, context.volume_rtol, context.region_samples))
    return found


def _region(problem: Problem, design: Design) -> PlacedRegion | None:
    return None if problem.region is None else place(problem.region, problem.kind.centre(design))


def _parameters(problem: Problem, design: Design) -> dict[str, float | str]:
    """The design without mode and place."""
    return {name: value for name, value in design.items() if problem.kind.parameter(name) is not None}


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


def offset_context(
    problem: Problem, context: Context, offsets: Mapping[str, tuple[float, ...]]
) -> Context | str:
    """The same place with another machine, or why there is none."""
    try:
        return replace(context, mechanism=offset_mechanism(problem, context.mechanism, offsets))
    except ParameterError as error:
        return error.what


def pose_region(context: Context, pose: Pose) -> PlacedRegion:
    """One pose of the context's region, given about its centre."""
    return place(Points((pose,)), context.placed.centre)
