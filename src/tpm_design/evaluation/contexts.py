"""Where a design is measured: its machine in its mode and place, and other machines there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tpm_design.errors import ParameterError
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.metrics.context import Context
from tpm_design.problem import Design, Problem
from tpm_design.workspace.region_geometry import PlacedRegion, place
from tpm_design.workspace.regions import Points


def design_context(problem: Problem, design: Design) -> Context:
    """The mechanism, mode and placed region of one design. Raises ParameterError where it cannot be."""
    mechanism = problem.kind.build(_parameters(problem, design), problem.limits)
    mode = mechanism.mode_of(problem.modes[str(design["mode"])])
    region = None
    if problem.region is not None:
        region = place(problem.region, problem.kind.centre(design))
    return Context(mechanism, mode, region, problem.accuracy.volume, problem.accuracy.region_samples)


def neighbouring_context(problem: Problem, context: Context, design: Design, neighbour: Design) -> Context:
    """As ``design_context``, of another design in the same mode: what it has in common with ``design``, whose
    ``context`` there is, is not made again."""
    mechanism, region = context.mechanism, context.region
    values = _parameters(problem, neighbour)
    if values != _parameters(problem, design):
        mechanism = problem.kind.build(values, problem.limits)
    if problem.region is not None:
        centre = problem.kind.centre(neighbour)
        if centre != problem.kind.centre(design):
            region = place(problem.region, centre)
    return Context(mechanism, context.mode, region, context.volume_rtol, context.region_samples)


def _parameters(problem: Problem, design: Design) -> dict[str, float | str]:
    """The design without mode and place."""
    names = problem.kind.parameter_names()
    return {name: design[name] for name in names if name in design}


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


def pose_region(context: Context, pose: tuple[float, float, float]) -> PlacedRegion:
    """One pose of the context's region, given about its centre."""
    return place(Points((pose,)), context.placed.centre)
