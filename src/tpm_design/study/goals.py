"""Objectives, constraints and recorded figures: metrics with their options, bounds and labels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tpm_design.errors import did_you_mean
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.metrics.base import Metric, Option
from tpm_design.problem import Goal
from tpm_design.study.document import Place
from tpm_design.study.faults import Faults, shown
from tpm_design.study.model import LARGEST, ConstraintModel, Entry, ObjectiveModel
from tpm_design.study.plain import plain
from tpm_design.units import Units, unit_for

_COLUMNS = {"id", "round", "status", "reason", "violation", "seconds", "mode"}


class GoalReader:
    """Reads the entries of one study, keeping the labels apart."""

    def __init__(
        self,
        metrics: Mapping[str, Metric],
        kind: MechanismKind,
        units: Units,
        limits: Mapping[str, Any],
        has_region: bool,
        taken: Iterable[str],
        faults: Faults,
    ) -> None:
        self._metrics = metrics
        self._kind = kind
        self._units = units
        self._limits = limits
        self._has_region = has_region
        self._taken = {*taken, *_COLUMNS}
        self._labels: dict[str, Place] = {}
        self._faults = faults

    def read(self, section: str, entries: Sequence[Entry]) -> list[tuple[Goal, dict[str, Any]]]:
        """Each entry as a goal (SI) and written out in full (the study's units)."""
        found = [self._goal((section, index), entry) for index, entry in enumerate(entries)]
        return [goal for goal in found if goal is not None]

    def _goal(self, place: Place, entry: Entry) -> tuple[Goal, dict[str, Any]] | None:
        metric = self._metrics.get(entry.metric)
        if metric is None:
            remedy = did_you_mean(entry.metric, self._metrics)
            self._faults.add((*place, "metric"), f"there is no metric {shown(entry.metric)}", remedy)
            return None
        refusal = metric.refusal(self._kind, self._limits)
        if refusal is not None:
            useful = [n for n, other in self._metrics.items() if not other.refusal(self._kind, self._limits)]
            self._faults.add(
                (*place, "metric"),
                f"{metric.name} has no meaning here: {refusal}",
                f"Remove it. Metrics for {self._kind.name}: {', '.join(sorted(useful))}.",
            )
            return None
        given = self._options(place, metric, entry)
        options = {
            option.name: given.get(option.name, self._default(metric, option)) for option in metric.options
        }
        if metric.needs_region and not self._has_region and options.get("over") != "aspect":
            aspect = " or `over: aspect`" if metric.option("over") else ""
            self._faults.add((*place, "metric"), f"{metric.name} needs a region", f"Add `region:`{aspect}.")
        label = self._label(place, metric, entry, given)
        written: dict[str, Any] = {"metric": metric.name, "label": label}
        sense = minimum = maximum = None
        unit = unit_for(metric.unit, self._kind.actuator_unit)
        if isinstance(entry, ObjectiveModel):
            sense = written["sense"] = entry.sense
        elif isinstance(entry, ConstraintModel):
            minimum = None if entry.min is None else self._units.to_si(entry.min, unit)
            maximum = None if entry.max is None else self._units.to_si(entry.max, unit)
            if minimum is not None and minimum > metric.greatest:
                self._faults.add(
                    (*place, "min"),
                    f"{metric.name} is never above {metric.greatest:g}: min {entry.min:g} cannot be met",
                    f"Choose min up to {metric.greatest:g}.",
                )
            written |= {"min": entry.min, "max": entry.max}
        written |= options
        in_si = {option.name: self._in_si(option, options[option.name]) for option in metric.options}
        return Goal(metric, label, in_si, sense, minimum, maximum), plain(written)

    def _in_si(self, option: Option, value: Any) -> Any:
        if value is None or option.kind not in ("point", "length"):
            return value
        if option.kind == "length":
            return self._units.to_si(value, "m")
        return tuple(self._units.to_si(v, "m") for v in value)

    def _choices(self, metric: Metric, option: Option) -> tuple[str, ...]:
        """The choices there are for this mechanism: it may know one drive only."""
        return metric.drives(self._kind) if option.name == "drive" else option.choices

    def _default(self, metric: Metric, option: Option) -> Any:
        choices = self._choices(metric, option)
        return choices[0] if choices and option.default not in choices else option.default

    def _options(self, place: Place, metric: Metric, entry: Entry) -> dict[str, Any]:
        """The options that are given, checked, in the study's units."""
        given: dict[str, Any] = {}
        for name, value in entry.options.items():
            option = metric.option(name)
            if option is None:
                keys = [*type(entry).model_fields, *(option.name for option in metric.options)]
                self._faults.add(
                    (*place, name), f"{metric.name} has no option {shown(name)}", did_you_mean(name, keys)
                )
                continue
            try:
                given[name] = _option_value(option, value, self._choices(metric, option))
            except ValueError as error:
                self._faults.add(
                    (*place, name), f"{metric.name}: {name} cannot be {shown(value)}", str(error)
                )
        for option in metric.options:
            if option.required and option.name not in entry.options:
                self._faults.add(
                    place,
                    f"{metric.name} needs the option {option.name}",
                    f"Add `{option.name}: …`: {option.description}.",
                )
        return given

    def _label(self, place: Place, metric: Metric, entry: Entry, given: Mapping[str, Any]) -> str:
        label = entry.label or default_label(metric, given)
        if label in self._taken:
            self._faults.add((*place, "label"), f"the label {shown(label)} is taken", "Choose another label.")
        if label in self._labels:
            self._faults.add(
                (*place, "label") if entry.label else place,
                f"two entries have the label {shown(label)}",
                "Give one of them a `label:` of its own.",
            )
        self._labels[label] = place
        return label


def default_label(metric: Metric, given: Mapping[str, Any]) -> str:
    """The metric's name with the options that differ from their defaults."""
    parts = [
        f"{option.name}={_in_label(given[option.name])}"
        for option in metric.options
        if option.name in given and given[option.name] != option.default
    ]
    return f"{metric.name}({', '.join(parts)})" if parts else metric.name


def _in_label(value: Any) -> str:
    if isinstance(value, tuple):
        return " ".join(map(_in_label, value))
    return str(plain(value))


def _option_value(option: Option, value: Any, choices: tuple[str, ...]) -> Any:
    """The value an option takes, in the study's units. ValueError: what it should be."""
    if option.kind == "choice":
        word = str(value) if isinstance(value, str | int) and not isinstance(value, bool) else ""
        if word not in choices:
            raise ValueError(f"Choose {' or '.join(choices)}.")
        return word
    if option.kind == "number":
        if not _is_number(value) or not option.minimum <= value <= option.maximum:
            low = f" from {option.minimum:g}" if math.isfinite(option.minimum) else ""
            high = f" up to {option.maximum:g}" if math.isfinite(option.maximum) else ""
            raise ValueError(f"Give a number{low}{high}.")
        return float(value)
    if option.kind == "length":
        if not _is_number(value) or not value > 0.0:
            raise ValueError("Give a length greater than 0.")
        return float(value)
    if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
        raise ValueError("Give three lengths: [x, y, z].")
    return tuple(float(v) for v in value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST
