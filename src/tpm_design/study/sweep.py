"""The plan of ``tpm-design sweep``: which designs to evaluate. Values in SI."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from tpm_design.design_space import between
from tpm_design.errors import did_you_mean
from tpm_design.mechanisms.base import within
from tpm_design.problem import Problem, Variable
from tpm_design.study.document import Place
from tpm_design.study.faults import Faults, shown
from tpm_design.study.model import LARGEST_GRID, GridModel, Listed, ListModel, SampleModel, Steps
from tpm_design.study.plain import plain
from tpm_design.study.quantities import domain_words, meaning
from tpm_design.units import Units, si_unit

Item = TypeVar("Item")


@dataclass(frozen=True)
class GridSweep:
    """Every combination of the values of each axis, the last axis running fastest."""

    axes: tuple[tuple[str, tuple[float | str, ...]], ...]


@dataclass(frozen=True)
class ListSweep:
    """Designs one by one; what a point does not name is held."""

    points: tuple[Mapping[str, float | str], ...]


@dataclass(frozen=True)
class SampleSweep:
    """Points of a Sobol sequence or a Latin hypercube over the ranges of the named variables."""

    method: Literal["sobol", "latin_hypercube"]
    samples: int
    seed: int
    names: tuple[str, ...]


Sweep = GridSweep | ListSweep | SampleSweep


def design_names(problem: Problem) -> list[str]:
    """Every design quantity in order: parameters, centre, mode."""
    given = {*problem.fixed, *(variable.name for variable in problem.variables)}
    return [
        name
        for name in (*problem.kind.parameter_names(), *problem.kind.centre_names, "mode")
        if name in given
    ]


def design_value(name: str, value: float | str, problem: Problem, units: Units) -> float | str:
    """One value in the study's units → SI, or a mode's label. ValueError: what is wrong, for a sentence that
    begins with the name."""
    if name == "mode":
        if value not in problem.modes:
            raise ValueError(f"cannot be {shown(value)}; {did_you_mean(str(value), problem.modes)}")
        return value
    if isinstance(value, str):
        raise ValueError(f"must be a number, not {shown(value)}")
    mirrored = any(variable.mirrored and variable.name == name for variable in problem.variables)
    dimension, domain = meaning(name, problem.kind, mirrored=mirrored)
    if not within(domain, value, value):
        raise ValueError(f"cannot be {value:g}; it must be {domain_words(domain)}")
    return units.to_si(value, si_unit(dimension))


class SweepReader:
    """Reads the plan against the problem it sweeps."""

    def __init__(self, problem: Problem, units: Units, faults: Faults) -> None:
        self._problem = problem
        self._units = units
        self._faults = faults
        self._names = design_names(problem)
        self._variables = {variable.name: variable for variable in problem.variables}

    def read(self, model: GridModel | ListModel | SampleModel) -> tuple[Sweep, dict[str, Any]]:
        """The plan (SI), and written out in the study's units."""
        if isinstance(model, GridModel):
            return self._grid(model)
        if isinstance(model, ListModel):
            points: list[dict[str, float | str]] = []
            for index, given in enumerate(model.points):
                place: Place = ("sweep", "points", index)
                points.append(
                    {n: self._value(n, v, (*place, n)) for n, v in self._ordered(given, place).items()}
                )
            written = [self._ordered(given, ("sweep", "points")) for given in model.points]
            return ListSweep(tuple(points)), plain({"type": "list", "points": written})
        names = tuple(self._variables) if model.parameters is None else self._chosen(model.parameters)
        if not names and model.parameters is None:
            self._faults.add(
                ("sweep",), "there is nothing to sample: nothing is free", "Give a range {min, max}."
            )
        sweep = SampleSweep(model.type, model.samples, model.seed, names)
        return sweep, plain(dict(model) | {"parameters": names})

    def _ordered(self, given: Mapping[str, Item], place: Place) -> dict[str, Item]:
        """The known ones of the given names, in the order of the design."""
        for name in given:
            if name not in self._names:
                remedy = did_you_mean(name, self._names)
                self._faults.add((*place, name), f"{shown(name)} is no quantity of this design", remedy)
        return {name: given[name] for name in self._names if name in given}

    def _value(self, name: str, value: float | str, place: Place) -> float | str:
        try:
            return design_value(name, value, self._problem, self._units)
        except ValueError as error:
            self._faults.add(place, f"{name} {error}", "Choose another value.")
            return 0.0

    def _chosen(self, names: tuple[str, ...]) -> tuple[str, ...]:
        for index, name in enumerate(names):
            if name not in self._variables:
                remedy = f"Give it a range {{min, max}}. {did_you_mean(name, self._variables)}"
                self._faults.add(("sweep", "parameters", index), f"{shown(name)} is not free", remedy)
        return tuple(name for name in self._variables if name in names)

    def _grid(self, model: GridModel) -> tuple[Sweep, dict[str, Any]]:
        axes: list[tuple[str, tuple[float | str, ...]]] = []
        written: dict[str, Any] = {}
        place: Place = ("sweep", "parameters")
        for name, axis in self._ordered(model.parameters, place).items():
            values: tuple[float | str, ...]
            if isinstance(axis, Listed):
                values, written[name] = axis.values, axis
            else:
                steps = self._with_range(name, axis, (*place, name))
                if steps is None:
                    continue
                logarithmic = name in self._variables and self._variables[name].scale == "log"
                if logarithmic and steps.min is not None and steps.min <= 0.0:
                    told = f"{name} is searched by its logarithm, and min {steps.min:g} has none"
                    self._faults.add((*place, name), told, "Choose min above 0, or write {values: […]}.")
                    continue
                values, written[name] = _steps(steps, logarithmic=logarithmic), steps
            axes.append((name, tuple(self._value(name, value, (*place, name)) for value in values)))
        if math.prod(len(values) for _, values in axes) > LARGEST_GRID:
            self._faults.add(("sweep",), f"the grid has more than {LARGEST_GRID} designs", "Use fewer steps.")
        return GridSweep(tuple(axes)), plain({"type": "grid", "parameters": written})

    def _with_range(self, name: str, axis: Steps, place: Place) -> Steps | None:
        """Steps with their range, taken from the free range where none is given."""
        if axis.min is not None and name != "mode":
            return axis
        variable = self._variables.get(name)
        if variable is None or variable.values or variable.ratio_of:
            what = f"{name} has no range to divide"
            if variable is not None and variable.ratio_of:
                what = f"{name} is a ratio of {variable.ratio_of} and has no range of its own to divide"
            self._faults.add(place, what, _axis_remedy(name, variable))
            return None
        unit = si_unit(variable.dimension)
        low, high = (self._units.from_si(bound, unit) for bound in (variable.lower, variable.upper))
        return Steps(num=axis.num, min=low, max=high)


def _axis_remedy(name: str, variable: Variable | None) -> str:
    if name == "mode" or (variable is not None and variable.values):
        return "Write {values: […]}."
    return "Write {min: …, max: …, num: …} or {values: […]}."


def _steps(axis: Steps, *, logarithmic: bool) -> tuple[float, ...]:
    low, high = axis.min or 0.0, axis.max or 0.0
    last = axis.num - 1
    # twelve digits: 0.1 + 0.2 shall read 0.3 in the study's units
    return tuple(
        high if i == last else float(f"{between(low, high, i / last, logarithmic=logarithmic):.12g}")
        for i in range(axis.num)
    )
