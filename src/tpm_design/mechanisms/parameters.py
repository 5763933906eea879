"""Design parameters and sign strings, checked against what a mechanism declares."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tpm_design.arithmetic import Interval
from tpm_design.errors import ParameterError, did_you_mean
from tpm_design.mechanisms.base import MechanismKind, ModeField, Parameter, within


def limb_values(
    kind: MechanismKind, parameters: Mapping[str, float | Sequence[float]]
) -> dict[str, tuple[float, ...]]:
    """Each parameter's SI value per limb, from ``f``, ``f=(…)`` or ``f1``, ``f2``, ``f3``.

    Raises ParameterError on an unknown, missing, doubly given or impossible value.
    """
    for name in parameters:
        if kind.parameter(name) is None:
            raise ParameterError(
                f"{kind.name} has no parameter {name!r}.", remedy=did_you_mean(name, kind.parameter_names())
            )
    return {parameter.name: _values(kind, parameter, parameters) for parameter in kind.parameters}


def _values(
    kind: MechanismKind, parameter: Parameter, given: Mapping[str, float | Sequence[float]]
) -> tuple[float, ...]:
    count, single = kind.limb_count if parameter.per_limb else 1, kind.limb_names[parameter.name]
    named = [name for name in single if name in given]
    if parameter.name not in given:
        if not named and parameter.default is not None:
            return parameter.default
        missing = [name for name in (single or (parameter.name,)) if name not in given]
        if missing:
            raise ParameterError(
                f"{kind.name}: no value for {missing[0] if named else parameter.name!r}.",
                remedy=f"It is the {parameter.description}.",
            )
        return tuple(checked_value(kind, parameter, given[name]) for name in single)
    if named:
        raise ParameterError(
            f"{kind.name}: {parameter.name!r} and {named[0]!r} are both given.",
            remedy=f"Give {parameter.name!r} for all limbs, or {', '.join(single)} one each.",
        )
    value = given[parameter.name]
    if isinstance(value, int | float):
        return (checked_value(kind, parameter, value),) * count
    if len(value) != count:
        raise ParameterError(f"{kind.name}: {parameter.name!r} has {len(value)} values for {count} limbs.")
    return tuple(checked_value(kind, parameter, each) for each in value)


def limb_tolerances(kind: MechanismKind, tolerance: Mapping[str, float]) -> dict[str, tuple[float, ...]]:
    """Tolerances (±, SI) by parameter and limb, from ``f`` for all limbs or ``f2`` for one; 0 where there is
    none. Raises ParameterError on an unknown name or a negative tolerance."""
    found: dict[str, tuple[float, ...]] = {}
    for name, bound in tolerance.items():
        parameter = kind.parameter(name)
        if parameter is None:
            raise ParameterError(
                f"{kind.name} has no parameter {name!r}.", remedy=did_you_mean(name, kind.parameter_names())
            )
        if not 0.0 <= bound < math.inf:
            raise ParameterError(f"The tolerance {name} = {bound!r} is not a non-negative number.")
        if kind.tolerance_refusal is not None and bound > 0.0:
            raise ParameterError(
                f"Nothing is proved within tolerances of {kind.name}: {kind.tolerance_refusal}.",
                remedy="Leave the tolerances out.",
            )
        if parameter.dimension == "angle" and bound > 0.0:
            raise ParameterError(
                f"{name} is an angle, and angles have no tolerance: misplaced axes destroy pure translation.",
                remedy="Give tolerances of lengths and ratios.",
            )
        count = kind.limb_count if parameter.per_limb else 1
        values = list(found.get(parameter.name, (0.0,) * count))
        for limb in range(count):
            if name in (parameter.name, f"{parameter.name}{limb + 1}"):
                values[limb] = float(bound)
        found[parameter.name] = tuple(values)
    return found


def enclosed_values(
    kind: MechanismKind, parameters: Mapping[str, tuple[float, ...]], tolerance: Mapping[str, float]
) -> dict[str, tuple[Interval, ...]]:
    """Each parameter per limb as an Interval that holds its value ± its tolerance (SI)."""
    bounds = limb_tolerances(kind, tolerance)
    return {
        name: tuple(
            Interval(value, value) if bound == 0.0 else value + Interval(-bound, bound)
            for value, bound in zip(values, bounds.get(name, (0.0,) * len(values)), strict=True)
        )
        for name, values in parameters.items()
    }


def checked_value(kind: MechanismKind, parameter: Parameter, value: object) -> float:
    """``value`` as a float of the parameter's domain; raises ParameterError otherwise."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(f"{kind.name}: {parameter.name} = {value!r} is not a finite number.")
    if not within(parameter.domain, value, value):
        raise ParameterError(
            f"{kind.name}: {parameter.name} = {value!r} is not {parameter.domain}.",
            remedy=f"It is the {parameter.description}.",
        )
    return float(value)


def mode_signs(kind: MechanismKind, signs: Mapping[str, str]) -> dict[str, tuple[float, ...]]:
    """Each mode field as a tuple of ±1.0, or of 0.0 for ``any``; raises ParameterError otherwise."""
    known = [field.name for field in kind.mode_fields]
    for name in signs:
        if name not in known:
            raise ParameterError(f"{kind.name} has no mode field {name!r}.", remedy=did_you_mean(name, known))
    return {field.name: _field_signs(kind, field, signs) for field in kind.mode_fields}


def _field_signs(kind: MechanismKind, field: ModeField, signs: Mapping[str, str]) -> tuple[float, ...]:
    text = signs.get(field.name)
    if field.any_allowed and text == "any":
        return (0.0,) * field.length
    if not isinstance(text, str) or len(text) != field.length or set(text) - {"+", "-"}:
        choice = ' or "any"' if field.any_allowed else ""
        raise ParameterError(
            f"{kind.name}: {field.name} is {text!r}.",
            remedy=f'Give {field.length} signs, such as "{"+" * field.length}"{choice}: {field.description}.',
        )
    return tuple(1.0 if sign == "+" else -1.0 for sign in text)


def three_numbers(values: ArrayLike, name: str, remedy: str) -> NDArray[np.float64]:
    """``values`` as a float array (3,); raises ParameterError on anything but three finite numbers."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError(f"{name} must be numbers.", remedy=remedy) from None
    if array.shape != (3,):
        raise ParameterError(f"{name} has shape {array.shape}.", remedy=remedy)
    if not np.isfinite(array).all():
        raise ParameterError(f"{name} is not finite.", remedy=remedy)
    return array


def span(ranges: Mapping[str, tuple[float, float]], name: str) -> tuple[float, float]:
    """Lowest and highest SI value of a parameter over all limbs, from the ranges of the names set."""
    found = [ranges[key] for key in (name, f"{name}1", f"{name}2", f"{name}3") if key in ranges]
    return min(low for low, _ in found), max(high for _, high in found)


def swing_limit(limits: Mapping[str, Any]) -> float | None:
    """The limit ``swing`` (rad), None where it limits nothing. Raises ParameterError beyond a right angle."""
    if "swing" not in limits:
        return None
    swing = float(limits["swing"])
    if not 0.0 < swing <= 0.5 * math.pi:
        raise ParameterError(
            f"The limit swing = {math.degrees(swing):g}° is not between 0 and 90°.",
            remedy="Leave it out where nothing limits the swing.",
        )
    return swing
