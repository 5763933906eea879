"""The mechanism's part of a study: its parameters, working modes and limits, and the region's centre."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

from tpm_design.errors import did_you_mean
from tpm_design.mechanisms.base import MechanismKind, ModeField, Parameter
from tpm_design.problem import Variable
from tpm_design.study.document import Place
from tpm_design.study.faults import Faults, shown
from tpm_design.study.model import (
    Center,
    DistanceCenter,
    Equals,
    Limits,
    LimitValue,
    MechanismModel,
    Quantity,
    Range,
    Ratio,
)
from tpm_design.study.quantities import meaning, read_quantity
from tpm_design.units import Units, si_unit

Modes = dict[str, dict[str, str]]
"""Labels such as ``+++ +-+`` → sign strings by field."""

_PARAMETERS: Place = ("mechanism", "parameters")
_MODE: Place = ("mechanism", "mode")


def read_parameters(
    model: MechanismModel, kind: MechanismKind, units: Units, faults: Faults
) -> dict[str, float | Variable]:
    """Parameters by name in the mechanism's own order, so that the order in the file changes nothing."""
    for name in model.parameters:
        if kind.parameter(name) is None:
            remedy = did_you_mean(name, kind.parameter_names())
            faults.add((*_PARAMETERS, name), f"{kind.name} has no parameter {shown(name)}", remedy)
    for parameter in kind.parameters:
        _check_given(parameter, kind, model.parameters, faults)
    found: dict[str, float | Variable] = {}
    for name in kind.parameter_names():
        given = model.parameters.get(name)
        if isinstance(given, Ratio):
            found[name] = Variable(
                name,
                meaning(name, kind)[0],
                lower=given.min,
                upper=given.max,
                initial=given.initial,
                scale=given.scale or "linear",
                ratio_of=given.ratio,
            )
        elif given is not None and not isinstance(given, Equals):
            dimension, domain = meaning(name, kind)
            place = (*_PARAMETERS, name)
            found[name] = read_quantity(name, given, dimension, domain, place, units, faults)
    return found


def _check_given(parameter: Parameter, kind: MechanismKind, given: Mapping[str, Any], faults: Faults) -> None:
    """Each parameter is given once: for all limbs, or for every limb by itself."""
    name = parameter.name
    limbs = kind.limb_names[name]
    single = [limb for limb in limbs if limb in given]
    if name in given and single:
        faults.add(
            (*_PARAMETERS, single[0]),
            f"{name} sets all limbs and {single[0]} one of them",
            f"Keep {name}, or give {', '.join(limbs)} instead.",
        )
    elif name not in given and not single and parameter.default is not None:
        pass
    elif name not in given and len(single) < max(len(limbs), 1):
        missing = [limb for limb in limbs if limb not in single] if single else [name]
        faults.add(
            _PARAMETERS,
            f"{kind.name} needs the parameter {' and '.join(missing)}",
            f"Add `{missing[0]}: …`: {parameter.description}.",
        )


_LIMIT_FORMS = {
    "range": ("a range", "Write {min: …, max: …}."),
    "number": ("one number", "Write it without min and max."),
    "switch": ("a switch", "Write true or false."),
}


def _limit_form(value: LimitValue) -> str:
    if isinstance(value, bool):
        return "switch"
    return "range" if isinstance(value, Limits) else "number"


def read_limits(
    given: Mapping[str, LimitValue], kind: MechanismKind, units: Units, faults: Faults
) -> dict[str, Any]:
    """Limits by name: (lowest, highest), one number or a switch, SI."""
    declared = {limit.name: limit for limit in kind.limits}
    for name in given:
        if name not in declared:
            place = ("mechanism", "limits", name)
            faults.add(place, f"{kind.name} has no limit {shown(name)}", did_you_mean(name, declared))
    found: dict[str, Any] = {}
    for name, limit in declared.items():
        if name not in given:
            continue
        value, unit = given[name], si_unit(limit.dimension)
        if _limit_form(value) != limit.kind:
            what, remedy = _LIMIT_FORMS[limit.kind]
            faults.add(("mechanism", "limits", name), f"{name} is {what}", remedy)
        elif isinstance(value, Limits):
            found[name] = (units.to_si(value.min, unit), units.to_si(value.max, unit))
        else:
            found[name] = value if isinstance(value, bool) else units.to_si(value, unit)
    return found


def mode_label(kind: MechanismKind, signs: Mapping[str, str]) -> str:
    """Sign strings in the mechanism's order: ``+++ +-+``."""
    return " ".join(signs[field.name] for field in kind.mode_fields) or "only"


def all_modes(kind: MechanismKind) -> list[dict[str, str]]:
    """Every combination of signs."""
    choices = [
        ["".join(signs) for signs in itertools.product("+-", repeat=field.length)]
        for field in kind.mode_fields
    ]
    names = [field.name for field in kind.mode_fields]
    return [dict(zip(names, signs, strict=True)) for signs in itertools.product(*choices)]


def best_modes(
    kind: MechanismKind, ranges: Mapping[str, tuple[float, float]], isotropic: bool
) -> list[dict[str, str]]:
    """The working modes worth trying: one of each kind that symmetry makes equal, if the mechanism knows."""
    candidates = kind.mode_candidates
    return list(candidates(ranges, isotropic)) if candidates else all_modes(kind)


def read_mode(
    given: str | Mapping[str, str] | None,
    kind: MechanismKind,
    ranges: Mapping[str, tuple[float, float]],
    isotropic: bool,
    faults: Faults,
) -> Modes:
    """The working modes to consider: one, or the candidates of ``best``."""
    if given == "best":
        return {mode_label(kind, mode): mode for mode in best_modes(kind, ranges, isotropic)}
    fields = {field.name: field for field in kind.mode_fields}
    example = ", ".join(f'{field.name}: "{"+" * field.length}"' for field in kind.mode_fields)
    signs = given if isinstance(given, Mapping) else {}
    for name in signs:
        if name not in fields:
            faults.add(
                (*_MODE, name), f"{kind.name} has no mode field {shown(name)}", did_you_mean(name, fields)
            )
    chosen: dict[str, str] = {}
    missing: list[str] = []
    for name, field in fields.items():
        chosen[name] = "any" if field.any_allowed and given is not None else "+" * field.length
        if name in signs:
            chosen[name] = _signs(signs[name], field, faults)
        elif chosen[name] != "any":
            missing.append(f"{name} ({field.description})")
    if missing and set(signs) <= set(fields):  # a misspelt name is not also a missing one
        faults.add(
            ("mechanism",) if given is None else _MODE,
            f"the working mode has no {' and no '.join(missing)}",
            f"Write `mode: {{{example}}}` or `mode: best`.",
        )
    return {mode_label(kind, chosen): chosen}


def _signs(text: str, field: ModeField, faults: Faults) -> str:
    if (text == "any" and field.any_allowed) or (len(text) == field.length and set(text) <= {"+", "-"}):
        return text
    other = ', or "any"' if field.any_allowed else ""
    faults.add(
        (*_MODE, field.name),
        f"{field.name} cannot be {shown(text)}",
        f'Write {field.length} signs, for example "{"+" * field.length}"{other}.',
    )
    return "+" * field.length


def free_center(
    kind: MechanismKind, ranges: Mapping[str, tuple[float, float]], modes: Modes, units: Units, faults: Faults
) -> Center | DistanceCenter:
    """``center: free`` written out: as far as the mechanism can reach, on the octant's side of each plane."""
    reach = units.from_si(kind.farthest_reach(ranges), "m")
    if math.isinf(reach):
        faults.stop(
            ("region", "center"),
            "how far the mechanism reaches does not follow from its parameters alone",
            "Give `center: {x: {min: …, max: …}, y: …, z: …}`.",
        )
    if not (math.isfinite(reach) and reach > 0):
        faults.stop(("region", "center"), "the mechanism reaches nothing", "Give larger lengths.")
    # four digits, rounded up: still a bound, and one that can be read
    grain = 10.0 ** (math.floor(math.log10(reach)) - 3)
    reach = float(f"{math.ceil(reach / grain) * grain:.6g}")
    if not kind.translational:
        return DistanceCenter.model_validate({"d": {"min": 0, "max": reach}})
    below, above = {"min": -reach, "max": 0}, {"min": 0, "max": reach}
    octants = {mode.get("octant", "any") for mode in modes.values()}
    sides: list[dict[str, float]]
    if "any" in octants:
        sides = [{"min": -reach, "max": reach}] * 3
    elif len(octants) > 1:
        sides = [above] * 3
    else:
        sides = [above if sign == "+" else below for sign in octants.pop()]
    axes: dict[str, Any] = dict(zip("xyz", sides, strict=True))
    return Center.model_validate(axes | {"mirrored": "any" not in octants and len(octants) > 1})


def read_center(
    given: tuple[float, float, float] | Center | DistanceCenter,
    kind: MechanismKind,
    modes: Modes,
    units: Units,
    faults: Faults,
) -> dict[str, float | Variable]:
    """The region's centre as design quantities (m), one for each length of the pose."""
    mirrored = isinstance(given, Center) and given.mirrored
    if isinstance(given, DistanceCenter):
        axes: dict[str, Quantity] = {"d": given.d}
    elif isinstance(given, Center):
        axes = {"x": given.x, "y": given.y, "z": given.z}
    else:
        axes = dict(zip("xyz", given, strict=True))
    if mirrored and any("any" in mode.get("octant", "any") for mode in modes.values()):
        faults.add(
            ("region", "center", "mirrored"),
            "there is no octant to mirror the centre into",
            "Remove `mirrored`.",
        )
    fixed = [axis for axis, value in axes.items() if not isinstance(value, Range)]
    if mirrored and fixed:
        told = f"a mirrored centre needs ranges, {' and '.join(fixed)} has none"
        faults.add(("region", "center", fixed[0]), told, "Write {min: …, max: …}.")
    found: dict[str, float | Variable] = {}
    for axis, value in axes.items():
        name = f"center_{axis}"
        place = ("region", "center", axis)
        dimension, domain = meaning(name, kind, mirrored=mirrored)
        found[name] = read_quantity(name, value, dimension, domain, place, units, faults, mirrored=mirrored)
    return found
