"""One design quantity: a number, a free range or a list of values, and the domain it must stay in."""

from __future__ import annotations

from typing import Literal

from tpm_design.mechanisms.base import Dimension, Domain, MechanismKind, within
from tpm_design.problem import Variable
from tpm_design.study.document import Place
from tpm_design.study.faults import Faults
from tpm_design.study.model import Range, Values
from tpm_design.units import Units, si_unit

_WORDS: dict[Domain, str] = {
    "positive": "greater than 0",
    "non-negative": "0 or more",
    "non-zero": "different from 0, and a range must not contain 0",
    "any": "a number",
}


def meaning(name: str, kind: MechanismKind, *, mirrored: bool = False) -> tuple[Dimension, Domain]:
    """Dimension and domain of a parameter of the mechanism or a coordinate of the region's centre."""
    if name in kind.centre_names:
        return "length", "non-negative" if mirrored else "any"
    parameter = kind.parameter(name)
    if parameter is None:
        raise KeyError(name)
    return parameter.dimension, parameter.domain


def domain_words(domain: Domain) -> str:
    """The domain in words, after "must be"."""
    return _WORDS[domain]


def read_quantity(
    name: str,
    given: float | Range | Values,
    dimension: Dimension | Literal["ratio"],
    domain: Domain,
    place: Place,
    units: Units,
    faults: Faults,
    *,
    mirrored: bool = False,
) -> float | Variable:
    """A quantity in the study's units → SI. Faults: values outside the domain."""
    unit = si_unit(dimension)
    if isinstance(given, Range):
        spans = [(given.min, given.max)]
        quantity: float | Variable = Variable(
            name,
            dimension,
            lower=units.to_si(given.min, unit),
            upper=units.to_si(given.max, unit),
            initial=None if given.initial is None else units.to_si(given.initial, unit),
            mirrored=mirrored,
            scale=given.scale or "linear",
        )
    elif isinstance(given, Values):
        spans = [(value, value) for value in given.values]
        values = tuple(units.to_si(value, unit) for value in given.values)
        quantity = Variable(name, dimension, values=values, mirrored=mirrored)
    else:
        spans = [(given, given)]
        quantity = units.to_si(given, unit)
    for low, high in spans:
        if not within(domain, low, high):
            span = f"{low:g}" if low == high else f"{low:g} … {high:g}"
            faults.add(place, f"{name} cannot be {span}", f"It must be {domain_words(domain)}.")
    return quantity
