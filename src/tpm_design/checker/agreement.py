"""Whether a certificate speaks of the study that it holds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from tpm_design.checker.claims import ANY, Machine, Requirement
from tpm_design.checker.fields import Fields
from tpm_design.checker.mechanisms import Mechanism
from tpm_design.checker.mechanisms.configuration import LIMBS
from tpm_design.checker.mechanisms.mechanism import LENGTH, Parameter, Powers
from tpm_design.checker.regions import Region

METRES = {"mm": (1, 1000), "cm": (1, 100), "m": (1, 1), "in": (127, 5000)}
CENTRE = ("center_x", "center_y", "center_z")

POWERS: Mapping[str, Powers] = {
    "reachable_volume": (3, 0),
    "singularity_free_volume": (3, 0),
    "translation_singularity_distance": LENGTH,
    "actuation_singularity_distance": LENGTH,
    "rotation_singularity_distance": LENGTH,
    "boundary_distance": LENGTH,
    "link_clearance": LENGTH,
    "total_link_length": LENGTH,
    "robot_size": LENGTH,
}


def powers_of(metric: str, mechanism: Mechanism) -> Powers:
    """Powers of metre and radian in a metric; those that are named nowhere are plain numbers."""
    metre, radian = mechanism.actuator
    if metric in ("velocity_min", "velocity_max"):
        return 1 - metre, -radian
    return mechanism.actuator if metric == "actuator_range" else POWERS.get(metric, (0, 0))


class StudyUnits:
    """From the study's units to SI."""

    def __init__(self, study: Fields) -> None:
        units = study.fields("units")
        up, down = METRES[units.text("length", tuple(METRES))]
        self._metre = up / down
        self._radian = math.pi / 180.0 if units.text("angle", ("deg", "rad")) == "deg" else 1.0

    def si(self, value: float, metre: int, radian: int) -> float:
        return float(value * self._metre**metre * self._radian**radian)

    def length(self, value: float) -> float:
        return self.si(value, 1, 0)


def same(value: float, other: float) -> bool:
    """Equal but for the rounding of a change of units."""
    return math.isclose(value, other, rel_tol=1e-12, abs_tol=1e-15)


def disagreements(
    certificate: Fields, machine: Machine, region: Region | None, requirements: list[Requirement]
) -> Iterator[str]:
    """Sentences on what the certificate says otherwise than its study and design."""
    study = certificate.fields("study")
    units = StudyUnits(study)
    design = certificate.fields("design")
    yield from _parameters(study.fields("mechanism"), units, design, machine)
    yield from _mode(study.fields("mechanism"), design, machine)
    yield from _limits(study.fields("mechanism"), units, machine)
    yield from _tolerances(study, units, machine)
    yield from _region(study, units, design, region, machine)
    yield from _requirements(study, units, requirements, machine.mechanism)


def _allowed(given: Fields, key: str, value: float, units: StudyUnits, powers: Powers) -> bool:
    """Whether a design's value is the study's, within its range or one of its list."""
    if not isinstance(given.value(key), dict):
        return same(value, units.si(given.number(key), *powers))
    quantity = given.fields(key)
    if "values" in quantity.data:
        values = quantity.numbers("values", len(quantity.items("values")))
        return any(same(value, units.si(number, *powers)) for number in values)
    low, high = (units.si(quantity.number(end), *powers) for end in ("min", "max"))
    return low <= value <= high or same(value, low) or same(value, high)


def _parameters(mechanism: Fields, units: StudyUnits, design: Fields, machine: Machine) -> Iterator[str]:
    mechanism.text("type", (machine.mechanism.name,))
    given = mechanism.fields("parameters")
    known: set[str] = set()
    left_out: set[str] = set()
    for parameter in machine.mechanism.parameters:
        names = {parameter.name, *parameter.limb_names}
        known |= names
        if parameter.name not in given.data:
            left_out |= names if parameter.default is not None else set()
        for limb in LIMBS:
            yield from _size(parameter, limb, given, units, design, machine)
    yield from (f"the study has a parameter {name}" for name in given.data if name not in known)
    odd = set(design.data) - set(given.data) - left_out - set(CENTRE) - {"mode"}
    yield from (f"the design has a quantity {name} that the study has not" for name in sorted(odd))


def _size(
    parameter: Parameter, limb: int, given: Fields, units: StudyUnits, design: Fields, machine: Machine
) -> Iterator[str]:
    """One limb's value: the design's, which the study allows, or the default of a study that is silent."""
    value, single = machine.parameters[parameter.name][limb], parameter.limb_names[limb]
    silent = parameter.default is not None and not {parameter.name, single} & set(given.data)
    places = design if silent else given
    key = parameter.name if parameter.name in places.data else single
    if not (silent and key not in design.data) and design.number(key) != value:
        yield f"machine.parameters.{parameter.name} is not the design's {key}"
    if silent and parameter.default is not None:
        if not same(value, parameter.default[limb]):
            yield f"machine.parameters.{parameter.name} is not what it is where the study does not give it"
        return
    tie = given.value(key)
    if isinstance(tie, dict) and "equals" in tie:
        source = given.fields(key).text("equals")
        if design.number(source) != value:
            yield f"the design's {key} is not its {source}"
    elif not _allowed(given, key, value, units, parameter.powers):
        yield f"the design's {key} is not within what the study gives"


def _mode(mechanism: Fields, design: Fields, machine: Machine) -> Iterator[str]:
    if design.text("mode") != " ".join(machine.mode.values()):
        yield "mode is not the design's"
    if mechanism.value("mode") == "best":
        yield from (
            f"mode has no {field}, as no mode of the study's has"
            for field, signs in machine.mode.items()
            if signs == ANY
        )
        return
    mode = mechanism.fields("mode")
    if any(mode.data.get(field, ANY) != signs for field, signs in machine.mode.items()):
        yield "mode is not the study's"


def _limits(mechanism: Fields, units: StudyUnits, machine: Machine) -> Iterator[str]:
    given = mechanism.fields("limits")
    limits = machine.mechanism.limits
    switches = {name for name, limit in limits.items() if limit.form == "switch"}
    for name in switches:
        if given.data.get(name, True) is not machine.limits.get(name, True):
            yield f"machine.limits.{name} is not the study's"
    if set(given.data) - switches != set(machine.limits) - switches:
        yield "machine.limits are not those the study sets"
        return
    for name in set(machine.limits) - switches:
        limit, powers = machine.limits[name], limits[name].powers
        if isinstance(limit, tuple):
            ends = given.fields(name)
            asked = [units.si(ends.number(end), *powers) for end in ("min", "max")]
            if not all(same(value, other) for value, other in zip(limit, asked, strict=True)):
                yield f"machine.limits.{name} is not the study's"
        elif not same(limit, units.si(given.number(name), *powers)):
            yield f"machine.limits.{name} is not the study's"


def _tolerances(study: Fields, units: StudyUnits, machine: Machine) -> Iterator[str]:
    if "certify" not in study.data:
        if machine.tolerance:
            yield "the study names no tolerances"
        return
    given = study.fields("certify").fields("tolerance")
    if set(given.data) != set(machine.tolerance):
        yield "tolerance is not of the parameters the study names"
        return
    for parameter in machine.mechanism.parameters:
        for name in {parameter.name, *parameter.limb_names} & set(machine.tolerance):
            if not same(machine.tolerance[name], units.si(given.number(name), *parameter.powers)):
                yield f"the tolerance of {name} is not the study's"


def _region(
    study: Fields, units: StudyUnits, design: Fields, region: Region | None, machine: Machine
) -> Iterator[str]:
    if study.data.get("region") is None or region is None:
        if study.data.get("region") is not None or region is not None:
            yield "region is not the study's: one of them has none"
        return
    given = study.fields("region")
    x, y, z = (design.number(name) for name in CENTRE)
    yield from _centre(given, units, (x, y, z), machine)
    kind = given.text("type", ("box", "cylinder", "sphere", "ellipsoid", "points"))
    form = "ellipsoid" if kind == "sphere" else kind
    if form != region.form:
        yield f"region is no {kind}"
        return
    if form == "points":
        asked = [[units.length(value) for value in point] for point in given.triples("points")]
        scale = max(map(abs, (x, y, z, *(value for point in asked for value in point))))
        placed = [[value + at for value, at in zip(point, (x, y, z), strict=True)] for point in asked]
        if len(placed) != len(region.points) or not all(
            math.isclose(value, other, rel_tol=0.0, abs_tol=1e-12 * scale)
            for point, there in zip(placed, region.points, strict=True)
            for value, other in zip(point, there, strict=True)
        ):
            yield "region.points are not the study's about the design's centre"
        return
    half = _half(given, kind, units)
    if not all(same(value, other) for value, other in zip(half, region.half, strict=True)):
        yield "region.half is not the study's"
    if region.centre != (x, y, z):
        yield "region.centre is not the design's"


def _half(given: Fields, kind: str, units: StudyUnits) -> list[float]:
    if kind == "box":
        return [0.5 * units.length(value) for value in given.triple("size")]
    if kind == "ellipsoid":
        return [units.length(value) for value in given.triple("semi_axes")]
    radius = units.length(given.number("radius"))
    return [radius, radius, radius if kind == "sphere" else 0.5 * units.length(given.number("height"))]


def _centre(
    given: Fields, units: StudyUnits, centre: tuple[float, float, float], machine: Machine
) -> Iterator[str]:
    if isinstance(given.value("center"), list):
        asked = [units.length(value) for value in given.triple("center")]
        if not all(same(value, other) for value, other in zip(centre, asked, strict=True)):
            yield "the design's centre is not the study's"
        return
    axes = given.fields("center")
    mirrored = axes.data.get("mirrored") is True
    sides = machine.within_tolerance().setting.sides
    for axis, side, value in zip("xyz", sides, centre, strict=True):
        turned = -value if mirrored and side < 0 else value
        if not _allowed(axes, axis, turned, units, LENGTH):
            yield f"the design's center_{axis} is not within what the study gives"


def _requirements(
    study: Fields, units: StudyUnits, requirements: list[Requirement], mechanism: Mechanism
) -> Iterator[str]:
    asked = study.entries("constraints")
    if len(asked) != len(requirements):
        yield f"there are {len(requirements)} requirements, and {len(asked)} constraints in the study"
        return
    for entry, requirement in zip(asked, requirements, strict=True):
        label = requirement.label
        metric = entry.text("metric")
        if (entry.text("label"), metric) != (label, requirement.metric):
            yield f"the requirement {label} is not the study's constraint in its place"
            continue
        powers = powers_of(metric, mechanism)
        for key, bound in (("min", requirement.least), ("max", requirement.greatest)):
            written = entry.number_or_none(key)
            converted = None if written is None else units.si(written, *powers)
            if (bound is None) != (converted is None) or (
                bound is not None and converted is not None and not same(bound, converted)
            ):
                yield f"the {key} of the requirement {label} is not the study's"
        if not _same_options(entry, requirement, units):
            yield f"the options of the requirement {label} are not the study's"


def _same_options(entry: Fields, requirement: Requirement, units: StudyUnits) -> bool:
    given = {
        name: value
        for name, value in entry.data.items()
        if name not in ("metric", "label", "min", "max") and value is not None
    }
    stated = {name: value for name, value in requirement.options.items() if value is not None}
    return set(given) == set(stated) and all(
        _same_option(value, stated[name], units) for name, value in given.items()
    )


def _same_option(value: Any, stated: Any, units: StudyUnits) -> bool:
    if isinstance(value, list) and isinstance(stated, list):
        return len(value) == len(stated) and all(
            isinstance(one, int | float) and isinstance(other, int | float) and same(units.length(one), other)
            for one, other in zip(value, stated, strict=True)
        )
    return bool(value == stated)
