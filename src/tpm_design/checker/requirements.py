"""Which statements prove a requirement."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from tpm_design.checker.claims import Requirement
from tpm_design.checker.mechanisms import Mechanism
from tpm_design.checker.statements import (
    Condition,
    Determinant,
    Fastest,
    Floored,
    Frobenius,
    Length,
    Locus,
    Reach,
    Sensitivity,
    Serial,
    Slowest,
    Statement,
    Transmission,
)

Stated = Statement | Length
SINGULARITIES = ("translation", "actuation", "rotation")


class Need(NamedTuple):
    """One statement that must be among the proved ones."""

    what: str
    met_by: Callable[[Stated], bool]


class Rule(NamedTuple):
    """The only bound a metric can be proved to keep (``min`` or ``max``) and what that needs, the statement
    that bounds the metric last. ``options``: those that the rule is for."""

    bound: str
    needs: Callable[[float, Mapping[str, Any]], list[Need]]
    options: Mapping[str, tuple[str, ...]] = {}


def reach(floor: float) -> Need:
    return Need(f"reach with floor {floor}", lambda s: isinstance(s, Reach) and s.floor >= floor)


def side(name: str, floor: float = 0.0) -> Need:
    return Need(
        f"determinant {name} with floor {floor}",
        lambda s: isinstance(s, Determinant) and s.name == name and s.floor > 0.0 and s.floor >= floor,
    )


def at_least(kind: type[Floored], floor: float, drive: str | None = None) -> Need:
    return Need(
        f"{kind.__name__.lower()} with floor {floor}",
        lambda s: isinstance(s, kind) and s.floor >= floor and getattr(s, "drive", None) == drive,
    )


def at_most(kind: type[Fastest | Sensitivity], ceiling: float, drive: str) -> Need:
    return Need(
        f"{kind.__name__.lower()} with ceiling {ceiling}",
        lambda s: isinstance(s, kind) and s.ceiling <= ceiling and s.drive == drive,
    )


def rules(mechanism: Mechanism) -> dict[str, Rule]:
    """How each metric is proved for a mechanism."""

    def drive(given: Mapping[str, Any]) -> str:
        return str(given["drive"])

    def guarded(given: Mapping[str, Any]) -> Need:
        return side(mechanism.drives[drive(given)])

    def conditioning(least: float, given: Mapping[str, Any]) -> list[Need]:
        kind = Frobenius if given["norm"] == "frobenius" else Condition
        return [reach(0.0), guarded(given), at_least(kind, least, drive(given))]

    def sides(floor: float = 0.0) -> list[Need]:
        return [side(name, floor) for name in mechanism.determinants]

    either = {"drive": tuple(mechanism.drives)}
    return {
        "coverage": Rule("min", lambda least, _: [reach(0.0), *sides()]),
        "conditioning_min": Rule(
            "min", conditioning, {"norm": ("2", "frobenius"), "over": ("region",), **either}
        ),
        **{
            f"{name}{DISTANCE}": _singularity_distance(name, name in mechanism.determinants)
            for name in SINGULARITIES
        },
        "boundary_distance": Rule("min", lambda least, _: [reach(max(0.0, least))]),
        "singularity_margin_min": Rule(
            "min", lambda least, _: [reach(0.0), at_least(Serial, least), *sides(least)]
        ),
        "velocity_min": Rule(
            "min", lambda least, given: [reach(0.0), at_least(Slowest, least, drive(given))], either
        ),
        "velocity_max": Rule(
            "max",
            lambda most, given: [reach(0.0), guarded(given), at_most(Fastest, most, drive(given))],
            either,
        ),
        "transmission_min": Rule(
            "min",
            lambda least, _: [reach(0.0), at_least(Transmission, least)],
            {"drive": (mechanism.transmission_drive,)},
        ),
        "position_sensitivity": Rule(
            "max",
            lambda most, given: [reach(0.0), guarded(given), at_most(Sensitivity, most, drive(given))],
            either,
        ),
    }


DISTANCE = "_singularity_distance"


def _singularity_distance(name: str, has_it: bool) -> Rule:
    """Without such a singularity what is in reach is as far from it as is asked."""

    def needs(least: float, _: Mapping[str, Any]) -> list[Need]:
        far = Need(
            f"locus {name} with distance {least}",
            lambda s: isinstance(s, Locus) and s.name == name and s.distance >= least,
        )
        return [reach(0.0), far] if has_it else [reach(0.0)]

    return Rule("min", needs)


def unproved(
    requirement: Requirement, mechanism: Mechanism, proved: Sequence[Stated], separate_poses: bool
) -> str | None:
    """What a requirement still lacks to be proved by statements; None where they suffice."""
    if requirement.metric == "total_link_length":
        return _length_unproved(requirement, proved)
    rule = rule_of(requirement, mechanism)
    if rule is None:
        return "no statement of this format proves it"
    bound = requirement.least if rule.bound == "min" else requirement.greatest
    other = requirement.greatest if rule.bound == "min" else requirement.least
    if bound is None or other is not None:
        return f"only a {rule.bound} of this metric can be proved"
    if requirement.metric == "coverage" and bound > 1.0:
        return "coverage is never more than 1"
    if requirement.metric == "coverage" and separate_poses:
        return "no statement of this format proves that separate poses lie in one aspect"
    for need in rule.needs(bound, requirement.options):
        if not any(need.met_by(statement) for statement in proved):
            return f"there is no proved statement {need.what}"
    return None


def rule_of(requirement: Requirement, mechanism: Mechanism) -> Rule | None:
    """The rule for a requirement's metric with its options."""
    rule = rules(mechanism).get(requirement.metric)
    if rule is None or set(rule.options) != set(requirement.options):
        return None
    allowed = all(requirement.options[name] in choices for name, choices in rule.options.items())
    return rule if allowed else None


def _length_unproved(requirement: Requirement, proved: Sequence[Stated]) -> str | None:
    lengths = [statement for statement in proved if isinstance(statement, Length)]
    least, greatest = requirement.least, requirement.greatest
    if least is not None and not any(s.floor is not None and s.floor >= least for s in lengths):
        return f"there is no proved statement length with floor {least}"
    if greatest is not None and not any(s.ceiling is not None and s.ceiling <= greatest for s in lengths):
        return f"there is no proved statement length with ceiling {greatest}"
    return None


def proved_slack(requirement: Requirement, last: Stated) -> float:
    """By how much the last statement of a requirement exceeds what is asked for. Coverage is flat, and a
    singularity that is nowhere has no distance: there it is the statement's own floor."""
    found = []
    if requirement.least is not None:
        value = last.distance if isinstance(last, Locus) else getattr(last, "floor", None)
        nowhere = requirement.metric.endswith(DISTANCE) and not isinstance(last, Locus)
        asked = 0.0 if requirement.metric == "coverage" or nowhere else requirement.least
        found += [] if value is None else [value - asked]
    if requirement.greatest is not None:
        value = getattr(last, "ceiling", None)
        found += [] if value is None else [requirement.greatest - value]
    return min(found, default=0.0)
