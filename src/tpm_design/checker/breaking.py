"""Whether a requirement fails at the pose and machine that are said to break it."""

from __future__ import annotations

from collections.abc import Sequence

from flint import arb

from tpm_design.checker.claims import Machine, Requirement
from tpm_design.checker.mechanisms import Mechanism
from tpm_design.checker.mechanisms.configuration import LIMBS, Configuration, Machines
from tpm_design.checker.proof import natural, spans_of, sum_of_links
from tpm_design.checker.regions import Domain, Point, Region
from tpm_design.checker.requirements import DISTANCE, rule_of
from tpm_design.checker.spectrum import Vector, singular_pairs
from tpm_design.checker.statements import (
    Frobenius,
    Goal,
    Serial,
    Transmission,
    outside_goals,
)

ROUNDING = 1e-12
"""What a pose on the surface of a region, a size at the end of its tolerance and a determinant on its locus
may be off by."""
INSIDE = 1e-10
"""Share of the way from a region's middle to a pose that must be left to its surface."""


def not_broken(requirement: Requirement, machine: Machine, region: Region | None) -> str | None:
    """Why a requirement is not refuted by its breaking pose; None where it is."""
    breaking = requirement.breaking
    if breaking is None:
        return "nothing that breaks it is given"
    mechanism, tolerances = machine.mechanism, machine.tolerances()
    for name, nominals in machine.parameters.items():
        for value, nominal, tolerance in zip(
            breaking.parameters[name], nominals, tolerances[name], strict=True
        ):
            if not abs(value - nominal) <= tolerance + ROUNDING * max(abs(nominal), tolerance):
                return f"the machine that breaks it has a {name} outside its tolerance"
    machines = machine.exactly(breaking.parameters)
    if requirement.metric == "total_link_length":
        broken = _length_broken(requirement, machines, mechanism.links)
        return None if broken else "the links are as long as is asked"
    pose = breaking.pose
    if pose is None:
        return "no pose that breaks it is given"
    rule = rule_of(requirement, mechanism)
    bound = None if rule is None else requirement.least if rule.bound == "min" else requirement.greatest
    if region is None or bound is None:
        return "no pose alone can break it"
    if requirement.metric == "coverage" and bound < 1.0:
        return "no pose alone can break a coverage of less than 1"
    at = _configuration(machines, pose)
    inside = _within(region, pose, 0.0)
    if inside and (_unreachable(at, pose) or _folded(at, region, pose)):
        return None
    if requirement.metric.endswith(DISTANCE):
        name = requirement.metric.removesuffix(DISTANCE)
        if name not in mechanism.determinants:
            return f"{mechanism.name} has no {name} singularity, and the pose that breaks it is in reach"
        if not _within(region, pose, bound):
            return "the pose that breaks it is not within the distance of the region"
        if _out_of_reach(at, pose):
            return "the pose that breaks it is not in reach"
        crossed = _crossed(at, machines, region, (name,))
        return None if crossed else "the determinant has the region's sign at the pose that breaks it"
    if not inside:
        return "the pose that breaks it is not in the region"
    if _crossed(at, machines, region, _sides(requirement, mechanism)) or _short(
        requirement, mechanism, bound, at
    ):
        return None
    return "the pose that is said to break it meets it"


def _length_broken(requirement: Requirement, machines: Machines, links: Sequence[str]) -> bool:
    least, greatest = requirement.least, requirement.greatest
    return (least is not None and sum_of_links(machines, links, False) < least) or (
        greatest is not None and sum_of_links(machines, links, True) > greatest
    )


def _configuration(machines: Machines, pose: Point) -> Configuration:
    x, y, z = pose
    return natural(machines, spans_of(machines, ((x, x), (y, y), (z, z))))


def _within(region: Region, pose: Point, distance: float) -> bool:
    size = max(map(abs, (*pose, *region.half, *region.reference)))
    return any(Domain(body, distance).holds(pose, ROUNDING * size) for body in region.parts)


def _wrong_side(at: Configuration, pose: Point, slack: float) -> bool:
    return any(side * value < -slack for side, value in zip(at.setting.sides, pose, strict=True))


def _unreachable(at: Configuration, pose: Point) -> bool:
    """Proved to be out of reach or out of the mode."""
    return _wrong_side(at, pose, 0.0) or any(goal(at).value > 0 for goal in outside_goals(at))


def _folded(at: Configuration, region: Region, pose: Point) -> bool:
    """A limb is folded, to rounding, and the pose is not on the region's surface: farther from its middle it
    is still inside."""
    farther = tuple(c + (1.0 + INSIDE) * (p - c) for p, c in zip(pose, region.centre, strict=True))
    if region.form == "points" or not Domain(region, 0.0).holds((farther[0], farther[1], farther[2]), 0.0):
        return False
    return any(at.margin(which).value.abs_upper() <= ROUNDING for which in at.setting.folds)


def _out_of_reach(at: Configuration, pose: Point) -> bool:
    """Out of closed reach by more than rounding."""
    return _wrong_side(at, pose, ROUNDING) or any(goal(at).value > ROUNDING for goal in outside_goals(at))


def _sides(requirement: Requirement, mechanism: Mechanism) -> Sequence[str]:
    if requirement.metric in ("coverage", "singularity_margin_min"):
        return mechanism.determinants
    if requirement.metric in ("conditioning_min", "velocity_max", "position_sensitivity"):
        return (mechanism.drives[str(requirement.options["drive"])],)
    return ()


def _crossed(at: Configuration, machines: Machines, region: Region, names: Sequence[str]) -> bool:
    """Whether one determinant is 0, or of the opposite sign to that in the region's middle."""
    middle = _configuration(machines, region.reference)
    for name in names:
        here, there = at.unit_determinant(name).value, middle.unit_determinant(name).value
        if here.abs_upper() <= ROUNDING or here * there < 0:
            return True
    return False


def _short(requirement: Requirement, mechanism: Mechanism, bound: float, at: Configuration) -> bool:
    """Whether the metric's value at one pose is proved to be on the wrong side of the bound."""
    metric = requirement.metric
    drive = str(requirement.options.get("drive", ""))
    if metric == "boundary_distance":
        return any(at.margin(which).value < bound for which in at.setting.reach)
    if metric == "singularity_margin_min":
        missed = _missed(Serial(bound).goals(at).quantities, at)
        return missed or any(abs(at.unit_determinant(name).value) < bound for name in mechanism.determinants)
    if metric == "transmission_min":
        return _missed(Transmission(bound).goals(at).quantities, at)
    if metric == "conditioning_min" and requirement.options["norm"] == "frobenius":
        return _missed(Frobenius(drive, bound).goals(at).quantities, at)
    if metric == "coverage":
        return False
    # in the directions of least and greatest gain: B² u against σ² A Aᵀ u
    limit = arb(bound) ** 2
    slow, fast = _gains(at, drive, sensitivity=metric == "position_sensitivity")
    if metric == "conditioning_min":
        return bool(slow < limit * fast)
    return bool(slow < limit) if metric == "velocity_min" else bool(fast > limit)


def _missed(goals: Sequence[Goal], at: Configuration) -> bool:
    return any(goal(at).value < 0 for goal in goals)


def _gains(at: Configuration, drive: str, *, sensitivity: bool) -> tuple[arb, arb]:
    """Upper bound of σ_min² and lower bound of σ_max² of A⁻¹ diag(b): squared gains in two directions."""
    rows, _, b = at.velocity(drive)
    squares = [entry.value * entry.value for entry in b]
    if sensitivity:
        squares = [at.length_error_gain_squared(limb).value for limb in LIMBS]
    matrix = [[float(entry.value) for entry in row] for row in rows]
    try:
        pairs = singular_pairs(matrix, [abs(float(value)) ** 0.5 for value in squares])
    except ZeroDivisionError:
        return arb.nan(), arb.nan()

    def gain(u: Vector) -> arb:
        driven = sum((arb(part) ** 2 * square for part, square in zip(u, squares, strict=True)), arb(0))
        columns = zip(*rows, strict=True)
        moved = [
            sum((entry.value * arb(part) for entry, part in zip(column, u, strict=True)), arb(0))
            for column in columns
        ]
        return driven / sum((part * part for part in moved), arb(0))

    return gain(pairs[0][1]), gain(pairs[2][1])
