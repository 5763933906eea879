"""A certificate's machine, region, statements and requirements, read into values of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tpm_design.checker.cover import Cover
from tpm_design.checker.fields import Fields
from tpm_design.checker.mechanisms import MECHANISMS, Mechanism
from tpm_design.checker.mechanisms.configuration import Machines
from tpm_design.checker.mechanisms.mechanism import ANGLE, LimitValue, Made, ModeField
from tpm_design.checker.regions import Point, Region
from tpm_design.checker.statements import (
    Condition,
    Determinant,
    Fastest,
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
from tpm_design.errors import UsageError

OUTCOMES = ("proved", "refuted", "undecided")
SIGNS = {"+": 1, "-": -1}
ANY = "any"
DOMAINS = {
    "positive": "greater than 0",
    "non-negative": "0 or more",
    "non-zero": "different from 0",
    "any": "a number",
}

Parameters = Mapping[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Claim:
    """One statement with its covers."""

    statement: Statement | Length
    outcome: str
    covers: tuple[Cover, ...]


@dataclass(frozen=True)
class Breaking:
    """A pose and a machine at which a requirement fails; without a pose where it asks nothing of poses."""

    pose: Point | None
    parameters: Parameters


@dataclass(frozen=True)
class Requirement:
    """A constraint of the study, in SI."""

    label: str
    metric: str
    options: Mapping[str, Any]
    least: float | None
    greatest: float | None
    outcome: str
    slack: float | None
    statements: tuple[int, ...]
    breaking: Breaking | None


@dataclass(frozen=True)
class Machine:
    """A mechanism's sizes per limb, their tolerances, limits and the working mode, as written."""

    mechanism: Mechanism
    parameters: Parameters
    tolerance: Mapping[str, float]
    limits: Mapping[str, LimitValue]
    mode: Mapping[str, str]

    def within_tolerance(self) -> Machines:
        return self._machines(self.parameters, self.tolerances())

    def exactly(self, parameters: Parameters) -> Machines:
        return self._machines(parameters, dict.fromkeys(parameters, (0.0, 0.0, 0.0)))

    def tolerances(self) -> Parameters:
        """± of each size of each limb."""
        found = {}
        for parameter in self.mechanism.parameters:
            whole = self.tolerance.get(parameter.name, 0.0)
            one, two, three = (self.tolerance.get(name, whole) for name in parameter.limb_names)
            found[parameter.name] = (one, two, three)
        return found

    def _machines(self, parameters: Parameters, tolerances: Parameters) -> Machines:
        signs = {field: _three_signs(text) for field, text in self.mode.items()}
        return self.mechanism.machines(Made(parameters, tolerances, self.limits, signs))


def _three_signs(text: str) -> tuple[int, int, int]:
    one, two, three = (SIGNS.get(sign, 0) for sign in (text if text != ANY else "000"))
    return one, two, three


def read_mechanism(certificate: Fields) -> Mechanism:
    """Raises UsageError for a mechanism whose equations are not written here."""
    name = certificate.fields("machine").text("type")
    if name not in MECHANISMS:
        raise UsageError(
            f"the mechanism {name} is not known to the checker: its certificate cannot be proved again",
            where=certificate.file,
            remedy=f"Certificates of {', '.join(MECHANISMS)} can be checked.",
        )
    return MECHANISMS[name]


def read_parameters(fields: Fields, mechanism: Mechanism) -> Parameters:
    found = {}
    for parameter in mechanism.parameters:
        found[parameter.name] = values = fields.triple(parameter.name)
        if not all(map(parameter.allows, values)):
            fields.refuse(parameter.name, DOMAINS[parameter.domain])
    return found


def read_machine(certificate: Fields) -> Machine:
    mechanism = read_mechanism(certificate)
    machine, mode = certificate.fields("machine"), certificate.fields("mode")
    tolerance = certificate.fields("tolerance")
    return Machine(
        mechanism,
        read_parameters(machine.fields("parameters"), mechanism),
        _tolerance(tolerance, mechanism),
        {name: _limit(machine.fields("limits"), name, mechanism) for name in machine.fields("limits").data},
        {field.name: _signs(mode, field) for field in mechanism.mode},
    )


def _limit(given: Fields, name: str, mechanism: Mechanism) -> LimitValue:
    limit = mechanism.limits.get(name)
    if limit is None:
        given.refuse(name, f"a limit of {mechanism.name}")
    if limit.form == "range":
        low, high = given.numbers(name, 2)
        return low, high
    return given.switch(name) if limit.form == "switch" else given.number(name)


def _tolerance(given: Fields, mechanism: Mechanism) -> dict[str, float]:
    sizes = [parameter for parameter in mechanism.parameters if parameter.powers != ANGLE]
    names = {name for parameter in sizes for name in (parameter.name, *parameter.limb_names)}
    for name in given.data:
        if name not in names or given.number(name) < 0.0:
            given.refuse(name, "a tolerance of a length or ratio, 0 or more")
    for parameter in sizes:
        if parameter.name in given.data and any(name in given.data for name in parameter.limb_names):
            given.refuse(parameter.name, "given once, for all limbs or for each")
    return {name: given.number(name) for name in given.data}


def _signs(mode: Fields, field: ModeField) -> str:
    text = mode.text(field.name)
    if not (field.any_allowed and text == ANY) and (len(text) != 3 or set(text) - set(SIGNS)):
        mode.refuse(field.name, "three signs")
    return text


def read_region(certificate: Fields) -> Region | None:
    if certificate.value("region") is None:
        return None
    region = certificate.fields("region")
    form = region.text("form", ("box", "cylinder", "ellipsoid", "points"))
    if form == "points":
        points = region.triples("points")
        return Region(form, points=points) if points else region.refuse("points", "a list of poses")
    half = region.triple("half")
    if min(half) <= 0.0:
        region.refuse("half", "greater than 0")
    if form == "cylinder" and half[0] != half[1]:
        region.refuse("half", "[radius, radius, half height]")
    return Region(form, region.triple("centre"), half)


def read_claim(entry: Fields, mechanism: Mechanism) -> Claim:
    kind = entry.text("kind", tuple(KINDS))
    covers = []
    for cover in entry.entries("covers") if kind != "length" else ():
        x, y, z = cover.intervals("root")
        covers.append(Cover((x, y, z), cover.text("tree")))
    return Claim(KINDS[kind](entry, mechanism), entry.text("outcome", OUTCOMES), tuple(covers))


def _level(entry: Fields, key: str) -> float:
    value = entry.number(key)
    return value if value >= 0.0 else entry.refuse(key, "0 or more")


def _positive(entry: Fields, key: str) -> float:
    """A level at which nothing can be proved where it is 0; what is not proved may still ask for that."""
    value = _level(entry, key)
    if value == 0.0 and entry.text("outcome") == "proved":
        entry.refuse(key, "greater than 0")
    return value


def _drive(entry: Fields, mechanism: Mechanism) -> str:
    return entry.text("drive", tuple(mechanism.drives))


def _determinant(entry: Fields, mechanism: Mechanism) -> Determinant:
    sign = entry.number("sign")
    if abs(sign) != 1.0:
        entry.refuse("sign", "1 or -1")
    return Determinant(entry.text("name", mechanism.determinants), int(sign), _positive(entry, "floor"))


KINDS: Mapping[str, Callable[[Fields, Mechanism], Statement | Length]] = {
    "reach": lambda entry, _: Reach(_level(entry, "floor")),
    "determinant": _determinant,
    "serial": lambda entry, _: Serial(_level(entry, "floor")),
    "frobenius": lambda entry, mechanism: Frobenius(_drive(entry, mechanism), _level(entry, "floor")),
    "condition": lambda entry, mechanism: Condition(_drive(entry, mechanism), _level(entry, "floor")),
    "slowest": lambda entry, mechanism: Slowest(_drive(entry, mechanism), _level(entry, "floor")),
    "fastest": lambda entry, mechanism: Fastest(_drive(entry, mechanism), _positive(entry, "ceiling")),
    "transmission": lambda entry, _: Transmission(_level(entry, "floor")),
    "sensitivity": lambda entry, mechanism: Sensitivity(
        _drive(entry, mechanism), _positive(entry, "ceiling")
    ),
    "locus": lambda entry, mechanism: Locus(
        entry.text("name", mechanism.determinants), _level(entry, "distance")
    ),
    "length": lambda entry, _: Length(entry.number_or_none("floor"), entry.number_or_none("ceiling")),
}


def read_requirement(entry: Fields, statements: int, mechanism: Mechanism) -> Requirement:
    indices = entry.items("statements")
    if not all(type(index) is int and 0 <= index < statements for index in indices):
        entry.refuse("statements", "a list of statements' places")
    breaking = None
    if entry.value("breaking") is not None:
        given = entry.fields("breaking")
        pose = None if given.value("pose") is None else given.triple("pose")
        breaking = Breaking(pose, read_parameters(given.fields("parameters"), mechanism))
    return Requirement(
        entry.text("label"),
        entry.text("metric"),
        entry.fields("options").data,
        entry.number_or_none("min"),
        entry.number_or_none("max"),
        entry.text("outcome", OUTCOMES),
        entry.number_or_none("slack"),
        tuple(indices),
        breaking,
    )
