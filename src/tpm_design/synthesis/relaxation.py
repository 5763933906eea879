"""A study's question about link lengths as a convex program: outer reach, octant, ranges and ties.

Everything that reaches the region satisfies it, so that its least value is a lower bound. Inner reach,
elbows, singularities and all that is asked besides are not in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tpm_design.design_space import octant_signs, spans
from tpm_design.errors import RefusedError
from tpm_design.mechanisms.outer_reach import Affine, OuterReach
from tpm_design.optimizers.conic import ConicProgram
from tpm_design.problem import CENTRE, Goal, Problem, Variable
from tpm_design.synthesis.bodies import Body, body
from tpm_design.synthesis.forms import Draft, Form, combined
from tpm_design.workspace.regions import Box

Octant = tuple[float, float, float]

REMEDY = "Choose a method that searches, such as scipy.differential_evolution."


@dataclass(frozen=True)
class Relaxation:
    """``program`` in lengths of ``unit`` (m), its first variables the design's ``names``; ``constant``: what
    its cost leaves out (m): lengths that are fixed."""

    program: ConicProgram
    names: tuple[str, ...]
    unit: float
    constant: float


def refusal(problem: Problem) -> str | None:
    """Why a problem has no convex relaxation, None where it has one."""
    reach = problem.kind.outer_reach
    if reach is None:
        return f"{problem.kind.name} declares no convex bounds of its reach."
    if problem.region is None or body(problem.region) is None:
        return "There is no region to reach."
    goals = problem.objectives
    if len(goals) != 1 or goals[0].metric.name != "total_link_length" or goals[0].sense != "minimize":
        return "The objective is not the least total_link_length, the one size that is convex."
    if not any(map(demands_reach, problem.constraints)):
        return "No constraint asks for the whole region to be reached, as coverage of 1 does."
    for name in reach.angles:
        for limb in range(problem.kind.limb_count):
            if length_form(problem, name, limb).shares:
                return f"{name} is free: directions of limbs are not convex."
    return None


def checked_relaxation(problem: Problem) -> None:
    """Raises RefusedError where the problem has no convex relaxation."""
    reason = refusal(problem)
    if reason is not None:
        raise RefusedError(f"The study has no convex relaxation. {reason}", remedy=REMEDY)


def demands_reach(goal: Goal) -> bool:
    """Whether the constraint can only be met where the whole region is reachable."""
    name, least = goal.metric.name, goal.minimum
    if least is None:
        return False
    if name == "coverage":
        return least >= 1.0
    if name in ("conditioning_min", "singularity_margin_min"):
        return least > 0.0 and goal.options.get("over", "region") == "region"
    return name.endswith(("_singularity_distance", "boundary_distance")) and least >= 0.0


def octants(problem: Problem) -> tuple[Octant, ...]:
    """The octants of the working modes, each once; 0: either side."""
    return tuple(dict.fromkeys(octant_signs(problem.modes).values()))


def length_form(problem: Problem, name: str, limb: int) -> Form:
    """One parameter of one limb: a number, or the study's free quantity that sets it."""
    parameter = problem.kind.parameter(name)
    own = f"{name}{limb + 1}"
    variables = {variable.name for variable in problem.variables}
    for given in (own, name):
        source = problem.ties.get(given, given)
        if source in variables:
            return Form({source: 1.0})
        if source in problem.fixed:
            return Form({}, float(problem.fixed[source]))
    default = () if parameter is None or parameter.default is None else parameter.default
    return Form({}, default[limb % len(default)])


def relaxation(problem: Problem, octant: Octant, *, inward: float = 0.0) -> Relaxation:
    """The convex program of a problem that ``refusal`` finds nothing against, for working modes of one
    octant.

    Discrete lengths may take every value between their ends. ``inward``: every constraint is to be met by so
    much, as a share of the unit.
    """
    reach, region = problem.kind.outer_reach, body(problem.region) if problem.region is not None else None
    if reach is None or region is None:
        raise RefusedError("The study has no convex relaxation.", remedy=REMEDY)
    ranges = _ranges(problem, octant)
    unit = max(region.extent, *(max(abs(low), abs(high)) for low, high in ranges.values()), 1e-300)
    draft = Draft(inward * unit, dict(ranges))
    centre = [_centre_form(problem, name, side) for name, side in zip(CENTRE, octant, strict=True)]
    _state_ratios(draft, problem)
    _state_reach(draft, problem, reach, region, centre)
    _state_octant(draft, problem, reach, region, centre, octant)
    cost = _cost(problem)
    program = draft.program(Form(cost.shares), unit)
    return Relaxation(program, tuple(ranges), unit, cost.constant)


def _ranges(problem: Problem, octant: Octant) -> dict[str, tuple[float, float]]:
    """Ranges (m) of the free quantities that the program is about."""
    lengths = {p.name for p in problem.kind.parameters if p.dimension == "length"}
    known = spans(_quantities(problem))
    found: dict[str, tuple[float, float]] = {}
    for variable in problem.variables:
        parameter = problem.kind.parameter(variable.name)
        if variable.name not in CENTRE and (parameter is None or parameter.name not in lengths):
            continue
        ends = list(known[variable.name])
        if variable.mirrored:
            side = octant[CENTRE.index(variable.name)] or 1.0
            ends = [side * end for end in ends]
        found[variable.name] = (min(ends), max(ends))
    return found


def _quantities(problem: Problem) -> dict[str, float | Variable]:
    """Fixed and free quantities that are numbers."""
    fixed = {name: float(value) for name, value in problem.fixed.items() if not isinstance(value, str)}
    return {**fixed, **{variable.name: variable for variable in problem.variables if variable.name != "mode"}}


def _state_ratios(draft: Draft, problem: Problem) -> None:
    """lower · source ≤ length ≤ upper · source for every length that is a ratio of another one."""
    for variable in problem.variables:
        source = variable.ratio_of
        if source is None or variable.name not in draft.ranges:
            continue
        own = Form({variable.name: 1.0})
        other = Form({source: 1.0}) if source in draft.ranges else Form({}, float(problem.fixed[source]))
        for room in (own + other.times(-variable.lower), other.times(variable.upper) + own.times(-1.0)):
            # ranges are met, not kept off
            draft.at_least_zero(room + draft.inward)


def _centre_form(problem: Problem, name: str, side: float) -> Form:
    if name in problem.fixed:
        return Form({}, float(problem.fixed[name]))
    return Form({name: 1.0})


def _cost(problem: Problem) -> Form:
    """The sum of the moving links."""
    links = [
        length_form(problem, parameter.name, limb)
        for parameter in problem.kind.parameters
        if parameter.moving_link
        for limb in range(problem.kind.limb_count)
    ]
    return combined(links, [1.0] * len(links))


def _state_reach(
    draft: Draft, problem: Problem, reach: OuterReach, region: Body, centre: Sequence[Form]
) -> None:
    """The mechanism's cones over the whole region."""
    values = {
        name: tuple(length_form(problem, name, limb).constant for limb in range(problem.kind.limb_count))
        for name in reach.angles
    }
    for cone in reach.cones(values, problem.limits):
        within = _form(problem, cone.within, centre)
        if not cone.across:
            draft.at_least_zero(within + region.lowest(np.array(cone.within.pose)))
            continue
        across = [_form(problem, side, centre) for side in cone.across]
        of_pose = np.array([side.pose for side in cone.across])
        if len(region.points):
            draft.norm_at_points(across, within, region.points @ of_pose.T)
        for middle, axes in region.ellipsoids:
            moved = [form + float(shift) for form, shift in zip(across, of_pose @ middle, strict=True)]
            draft.norm_over_ellipsoid(moved, within, of_pose @ axes)


def _form(problem: Problem, affine: Affine, centre: Sequence[Form]) -> Form:
    """An affine form of the mechanism, at the region's centre."""
    lengths = [length_form(problem, name, limb) for name, limb in affine.lengths]
    return combined([*lengths, *centre], [*affine.lengths.values(), *affine.pose]) + affine.constant


def _state_octant(
    draft: Draft, problem: Problem, reach: OuterReach, region: Body, centre: Sequence[Form], octant: Octant
) -> None:
    """The region on its side of each coordinate plane, as far away as the study's distance to singularities
    asks where that is sure to be the distance to the planes."""
    distance = _plane_distance(problem, reach, draft.ranges) if all(octant) else 0.0
    for axis, side in enumerate(octant):
        if side != 0.0:
            nearest = region.lowest(side * np.eye(3)[axis])
            draft.at_least_zero(centre[axis].times(side) + (nearest - distance))


def _plane_distance(problem: Problem, reach: OuterReach, ranges: Mapping[str, tuple[float, float]]) -> float:
    asked = [
        goal.minimum
        for goal in problem.constraints
        if goal.metric.name == "rotation_singularity_distance" and goal.minimum is not None
    ]
    distance = max(asked, default=0.0)
    if distance <= 0.0 or reach.planes_are_singular is None or not isinstance(problem.region, Box):
        return 0.0
    lengths = {
        (parameter.name, limb): _interval(length_form(problem, parameter.name, limb), ranges)
        for parameter in problem.kind.parameters
        if parameter.dimension == "length"
        for limb in range(problem.kind.limb_count)
    }
    sure = reach.planes_are_singular(lengths, problem.limits, problem.region.size, distance)
    return distance if sure else 0.0


def _interval(form: Form, ranges: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
    low = high = form.constant
    for name in form.shares:
        low, high = low + ranges[name][0], high + ranges[name][1]
    return low, high
