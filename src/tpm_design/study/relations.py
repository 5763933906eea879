"""Parameters that follow another one: ties, ``r: {equals: f}``, and ratios, ``db: {ratio: f, …}``."""

from __future__ import annotations

from collections.abc import Mapping

from tpm_design.design_space import spans
from tpm_design.errors import did_you_mean
from tpm_design.mechanisms.base import MechanismKind, within
from tpm_design.problem import Variable
from tpm_design.study.document import Place
from tpm_design.study.faults import Faults, shown
from tpm_design.study.model import Equals, MechanismModel
from tpm_design.study.quantities import domain_words, meaning

_PARAMETERS: Place = ("mechanism", "parameters")

Fault = tuple[str, str]
"""What is wrong, and what to do about it."""


def read_ties(
    model: MechanismModel,
    kind: MechanismKind,
    quantities: Mapping[str, float | Variable],
    faults: Faults,
) -> dict[str, str]:
    """Tied parameters → the ones they equal. ``quantities``: the others, SI."""
    found: dict[str, str] = {}
    for name in kind.parameter_names():
        given = model.parameters.get(name)
        if not isinstance(given, Equals):
            continue
        wrong = _tie_fault(name, given.equals, model, kind, quantities)
        if wrong is None:
            found[name] = given.equals
        else:
            faults.add((*_PARAMETERS, name, "equals"), *wrong)
    return found


def check_ratios(
    model: MechanismModel,
    kind: MechanismKind,
    quantities: Mapping[str, float | Variable],
    faults: Faults,
) -> None:
    """Faults of ratios: of what, in a circle, of what can be 0, or outside the parameter's domain."""
    told_circles: set[frozenset[str]] = set()
    for name, quantity in quantities.items():
        if not isinstance(quantity, Variable) or quantity.ratio_of is None:
            continue
        place = (*_PARAMETERS, name, "ratio")
        circle = _circle(name, quantities)
        if circle and frozenset(circle) in told_circles:
            continue
        told_circles.add(frozenset(circle))
        wrong = _ratio_fault(name, quantity.ratio_of, circle, model, kind, quantities)
        if wrong is not None:
            faults.add(place, *wrong)


def _circle(name: str, quantities: Mapping[str, float | Variable]) -> list[str]:
    """The ratios from ``name`` on until they come back to it; empty where they do not."""
    met: list[str] = []
    following: str | None = name
    while following is not None and following not in met:
        met.append(following)
        quantity = quantities.get(following)
        following = quantity.ratio_of if isinstance(quantity, Variable) else None
    return met if following == name else []


def _ratio_fault(
    name: str,
    source: str,
    circle: list[str],
    model: MechanismModel,
    kind: MechanismKind,
    quantities: Mapping[str, float | Variable],
) -> Fault | None:
    """What is wrong with ``name: {ratio: source, …}``."""
    if source == name:
        return f"{name} is a ratio of itself", "Name another parameter, or leave `ratio` out."
    if circle:
        return (
            f"{name} is a ratio of {', which is a ratio of '.join([*circle[1:], name])}",
            "Give one of them a range of its own.",
        )
    further = model.parameters.get(source)
    if isinstance(further, Equals):
        what = f"{name} is a ratio of {source}, which equals {further.equals}"
        if further.equals == name:
            return what, "Give one of them a range of its own."
        return what, f"Write `ratio: {further.equals}`."
    wrong = _source_fault(f"{name} is a ratio of", name, source, kind, quantities)
    if wrong is not None:
        return wrong
    known = spans(quantities)
    if source in known and known[source][0] <= 0.0:
        return f"{name} is a ratio of {source}, which can be 0 or less", f"Give {source} a range above 0."
    domain = meaning(name, kind)[1]
    if name in known and not within(domain, *known[name]):
        return f"{name} cannot be every such multiple of {source}", f"{name} must be {domain_words(domain)}."
    return None


def _tie_fault(
    name: str,
    source: str,
    model: MechanismModel,
    kind: MechanismKind,
    quantities: Mapping[str, float | Variable],
) -> Fault | None:
    """What is wrong with ``name: {equals: source}``."""
    if source == name:
        return f"{name} equals itself", "Name another parameter, or give a number or a range."
    further = model.parameters.get(source)
    if isinstance(further, Equals):
        return f"{name} equals {source}, which itself equals {further.equals}", "Name the last one directly."
    wrong = _source_fault(f"{name} equals", name, source, kind, quantities)
    if wrong is not None:
        return wrong
    known, domain = spans(quantities), meaning(name, kind)[1]
    if source in known and not within(domain, *known[source]):
        return (
            f"{name} cannot take every value of {source}",
            f"{name} must be {domain_words(domain)}: change the range of {source}.",
        )
    return None


def _source_fault(
    relation: str, name: str, source: str, kind: MechanismKind, quantities: Mapping[str, float | Variable]
) -> Fault | None:
    """Whether a parameter is there to follow and of the same kind."""
    if source not in quantities:
        return (
            f"{relation} {shown(source)}, which this study does not give",
            did_you_mean(source, [other for other in quantities if other != name]),
        )
    dimension, other = meaning(name, kind)[0], meaning(source, kind)[0]
    if dimension != other:
        return f"{name} is {_a(dimension)} and {source} is {_a(other)}", "Name one of the same kind."
    return None


def _a(dimension: str) -> str:
    return f"an {dimension}" if dimension == "angle" else f"a {dimension}"
