"""A certificate's machine, region, statements and requirements, read into values of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tpm_design.checker.cover import Cover
from tpm_design.checker.fields import Fields
from tpm_design.checker.proof import Machines, Span, sizes_within
from tpm_design.checker.regions import Point, Region
from tpm_design.checker.statements import (
    DETERMINANTS,
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
from tpm_design.checker.uru import JOINTS, LIMBS, Mode, joint_range

PARAMETERS = ("db", "dp", "f", "r", "k")
OUTCOMES = ("proved", "refuted", "undecided")
DRIVES = ("motor", "joint")
SIGNS = {"+": 1, "-": -1}

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
    """Sizes per limb, their tolerances, limits and the working mode, as written."""

    parameters: Parameters
    tolerance: Mapping[str, float]
    limits: Mapping[str, tuple[float, float] | float]
    octant: str
    elbows: str

    def within_tolerance(self) -> Machines:
        return self._machines(self.parameters, self.tolerances())

    def exactly(self, parameters: Parameters) -> Machines:
        return self._machines(parameters, dict.fromkeys(PARAMETERS, (0.0, 0.0, 0.0)))

    def tolerances(self) -> Parameters:
        """± of each size of each limb."""
        found = {}
        for name in PARAMETERS:
            one, two, three = (
                self.tolerance.get(name, self.tolerance.get(f"{name}{limb + 1}", 0.0)) for limb in LIMBS
            )
            found[name] = (one, two, three)
        return found

    def _machines(self, parameters: Parameters, tolerances: Parameters) -> Machines:
        ranges = [
            joint_range(joint, *limit)
            for joint in JOINTS
            if isinstance(limit := self.limits.get(joint), tuple)
        ]
        octant = "000" if self.octant == "any" else self.octant
        x, y, z = (SIGNS.get(sign, 0) for sign in octant)
        s1, s2, s3 = (SIGNS[sign] for sign in self.elbows)
        sizes: dict[str, Span] = {}
        for limb in LIMBS:
            sizes |= sizes_within(
                limb,
                {name: parameters[name][limb] for name in PARAMETERS},
                {name: tolerances[name][limb] for name in PARAMETERS},
            )
        return Machines(Mode((x, y, z), (s1, s2, s3)), tuple(r for r in ranges if r is not None), sizes)


def read_parameters(fields: Fields) -> Parameters:
    found = {name: fields.triple(name) for name in PARAMETERS}
    for name, values in found.items():
        if name in ("f", "r") and min(values) <= 0.0:
            fields.refuse(name, "greater than 0")
        if name == "k" and 0.0 in values:
            fields.refuse(name, "different from 0")
    return found


def read_machine(certificate: Fields) -> Machine:
    machine, mode = certificate.fields("machine"), certificate.fields("mode")
    machine.text("type", ("uru",))
    limits: dict[str, tuple[float, float] | float] = {}
    given = machine.fields("limits")
    for name in given.data:
        if name in JOINTS:
            low, high = given.numbers(name, 2)
            limits[name] = (low, high)
        elif name == "link_radius":
            limits[name] = given.number(name)
        else:
            given.refuse(name, "a limit of the 3-URU")
    tolerance = certificate.fields("tolerance")
    names = {*PARAMETERS, *(f"{name}{limb + 1}" for name in PARAMETERS for limb in LIMBS)}
    for name in tolerance.data:
        if name not in names or tolerance.number(name) < 0.0:
            tolerance.refuse(name, "a tolerance of a parameter, 0 or more")
    for name in PARAMETERS:
        if name in tolerance.data and any(f"{name}{limb + 1}" in tolerance.data for limb in LIMBS):
            tolerance.refuse(name, "given once, for all limbs or for each")
    return Machine(
        read_parameters(machine.fields("parameters")),
        {name: tolerance.number(name) for name in tolerance.data},
        limits,
        _signs(mode, "octant", "any"),
        _signs(mode, "elbows"),
    )


def _signs(mode: Fields, key: str, word: str = "") -> str:
    text = mode.text(key)
    if text != word and (len(text) != 3 or set(text) - set(SIGNS)):
        mode.refuse(key, "three signs")
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


def read_claim(entry: Fields) -> Claim:
    kind = entry.text("kind", tuple(KINDS))
    covers = []
    for cover in entry.entries("covers") if kind != "length" else ():
        x, y, z = cover.intervals("root")
        covers.append(Cover((x, y, z), cover.text("tree")))
    return Claim(KINDS[kind](entry), entry.text("outcome", OUTCOMES), tuple(covers))


def _level(entry: Fields, key: str) -> float:
    value = entry.number(key)
    return value if value >= 0.0 else entry.refuse(key, "0 or more")


def _positive(entry: Fields, key: str) -> float:
    """A level at which nothing can be proved where it is 0; what is not proved may still ask for that."""
    value = _level(entry, key)
    if value == 0.0 and entry.text("outcome") == "proved":
        entry.refuse(key, "greater than 0")
    return value


def _drive(entry: Fields) -> str:
    return entry.text("drive", DRIVES)


def _determinant(entry: Fields) -> Determinant:
    sign = entry.number("sign")
    if abs(sign) != 1.0:
        entry.refuse("sign", "1 or -1")
    return Determinant(entry.text("name", DETERMINANTS), int(sign), _positive(entry, "floor"))


KINDS: Mapping[str, Callable[[Fields], Statement | Length]] = {
    "reach": lambda entry: Reach(_level(entry, "floor")),
    "determinant": _determinant,
    "serial": lambda entry: Serial(_level(entry, "floor")),
    "frobenius": lambda entry: Frobenius(_drive(entry), _level(entry, "floor")),
    "condition": lambda entry: Condition(_drive(entry), _level(entry, "floor")),
    "slowest": lambda entry: Slowest(_drive(entry), _level(entry, "floor")),
    "fastest": lambda entry: Fastest(_drive(entry), _positive(entry, "ceiling")),
    "transmission": lambda entry: Transmission(_level(entry, "floor")),
    "sensitivity": lambda entry: Sensitivity(_drive(entry), _positive(entry, "ceiling")),
    "locus": lambda entry: Locus(entry.text("name", DETERMINANTS), _level(entry, "distance")),
    "length": lambda entry: Length(entry.number_or_none("floor"), entry.number_or_none("ceiling")),
}


def read_requirement(entry: Fields, statements: int) -> Requirement:
    indices = entry.items("statements")
    if not all(type(index) is int and 0 <= index < statements for index in indices):
        entry.refuse("statements", "a list of statements' places")
    breaking = None
    if entry.value("breaking") is not None:
        given = entry.fields("breaking")
        pose = None if given.value("pose") is None else given.triple("pose")
        breaking = Breaking(pose, read_parameters(given.fields("parameters")))
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
