"""The unit cube that optimisers search, and the designs its points stand for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tpm_design.problem import CENTRE, Design, Problem, Variable

FloatArray = NDArray[np.float64]

Multiples = dict[str, float]
"""Of quantities that are ratios: name → multiple of the parameter that it is a ratio of."""


@dataclass(frozen=True)
class DesignSpace:
    """Free quantities in order, and what is fixed. ``octants``: mode label → signs (±1, 0) of its octant,
    for the quantities that follow it. ``ties``: as in ``Problem``."""

    variables: tuple[Variable, ...]
    fixed: Mapping[str, float | str]
    octants: Mapping[str, tuple[float, float, float]]
    ties: Mapping[str, str] = field(default_factory=dict)

    @property
    def levels(self) -> tuple[int, ...]:
        """Number of values of each variable, 0 for a continuous one."""
        return tuple(len(variable.values) for variable in self.variables)

    def design(self, point: FloatArray) -> Design:
        """The design (SI) at a point (n,) of the unit cube."""
        values, multiples = values_at(self.variables, point)
        return self.completed(values, multiples)

    def completed(self, values: Design, multiples: Mapping[str, float] = MappingProxyType({})) -> Design:
        """The design with these values (SI) of its variables, or these multiples of the ones they are ratios
        of: what is fixed and what is tied added, and quantities that follow the mode's octant on its side.
        Values of fixed quantities take their place."""
        design = self._mirrored({**self.fixed, **values})
        return with_ties(self.ties, with_ratios(self.variables, multiples, design))

    def point(self, design: Design) -> FloatArray:
        """The unit-cube point (n,) of a design; discrete values at the centre of their interval."""
        return np.array([coordinate_of(variable, design) for variable in self.variables], dtype=np.float64)

    def start(self) -> FloatArray:
        """The point of every variable's ``first_value``."""
        return np.array([coordinate_at(v, first_value(v)) for v in self.variables], dtype=np.float64)

    def holding_discrete(self, design: Design) -> DesignSpace:
        """The space of the continuous variables, the discrete ones fixed at the design's values."""
        chosen = {v.name: design[v.name] for v in self.variables if v.values}
        continuous = tuple(v for v in self.variables if not v.values)
        return replace(self, variables=continuous, fixed={**self.fixed, **chosen})

    def near(self, design: Design, share: float) -> DesignSpace:
        """The space cut to within ``share`` of each continuous range around a design."""
        point = self.point(design)
        narrowed = []
        for variable, coordinate in zip(self.variables, point, strict=True):
            if variable.values:
                narrowed.append(variable)
                continue
            low, high = (value_at(variable, float(coordinate) + step) for step in (-share, share))
            narrowed.append(replace(variable, lower=float(low), upper=float(high)))
        return replace(self, variables=tuple(narrowed))

    def _mirrored(self, design: dict[str, float | str]) -> Design:
        for variable in self.variables:
            if variable.mirrored:
                sign = self.octants[str(design["mode"])][CENTRE.index(variable.name)]
                design[variable.name] = (sign or 1.0) * float(design[variable.name])
        return design


def value_at(variable: Variable, coordinate: float) -> float | str:
    """The value (SI) of a variable at its coordinate of the unit cube; beyond it, that of the nearest end."""
    share = min(1.0, max(0.0, coordinate))
    if variable.values:
        count = len(variable.values)
        return variable.values[min(count - 1, int(share * count))]
    return between(variable.lower, variable.upper, share, logarithmic=variable.scale == "log")


def between(lower: float, upper: float, share: float, *, logarithmic: bool) -> float:
    """The value at a share of the way from ``lower`` to ``upper``, exactly these at 0 and 1; of the way of
    their logarithms if ``logarithmic``."""
    if share == 1.0:
        return upper
    if logarithmic:
        return min(upper, lower * math.pow(upper / lower, share))
    return lower + share * (upper - lower)


def coordinate_at(variable: Variable, value: float | str) -> float:
    """The inverse of ``value_at``; beyond the range the nearest end, of a discrete value the middle of its
    interval."""
    if variable.values:
        return (variable.values.index(value) + 0.5) / len(variable.values)
    number = abs(float(value)) if variable.mirrored else float(value)
    if number <= variable.lower:
        return 0.0
    if number >= variable.upper:
        return 1.0
    if variable.scale == "log":
        return math.log(number / variable.lower) / math.log(variable.upper / variable.lower)
    return (number - variable.lower) / (variable.upper - variable.lower)


def coordinate_of(variable: Variable, design: Design) -> float:
    """The coordinate of a variable in a design (SI)."""
    value = design[variable.name]
    if variable.ratio_of is not None:
        source = float(design[variable.ratio_of])
        value = float(value) / source if source else variable.lower
    return coordinate_at(variable, value)


def values_at(variables: Sequence[Variable], point: FloatArray) -> tuple[dict[str, float | str], Multiples]:
    """The variables at a point (n,) of the unit cube: values (SI), and multiples of those that are ratios."""
    found = {v.name: value_at(v, float(c)) for v, c in zip(variables, point, strict=True)}
    multiples = {v.name: float(found.pop(v.name)) for v in variables if v.ratio_of is not None}
    return found, multiples


def first_value(variable: Variable) -> float | str:
    """What a variable is where nothing is said: ``initial``, else the middle of its range on its scale, else
    the first value; of a ratio the multiple."""
    if variable.initial is not None:
        return variable.initial
    if variable.values:
        return variable.values[0]
    if variable.scale == "log":
        return value_at(variable, 0.5)
    return 0.5 * (variable.lower + variable.upper)


def spans(quantities: Mapping[str, float | Variable]) -> dict[str, tuple[float, float]]:
    """Lowest and highest value (SI) of each quantity, fixed or free. What is a ratio of none of them, or one
    of a circle of ratios, has no span."""
    found: dict[str, tuple[float, float]] = {}
    left = dict(quantities)
    while left:
        before = len(left)
        for name, quantity in list(left.items()):
            if not isinstance(quantity, Variable):
                found[name] = quantity, quantity
            elif quantity.values:
                numbers = [float(value) for value in quantity.values]
                found[name] = min(numbers), max(numbers)
            elif quantity.ratio_of is None:
                found[name] = quantity.lower, quantity.upper
            elif quantity.ratio_of in found:
                ends = [
                    multiple * end
                    for multiple in (quantity.lower, quantity.upper)
                    for end in found[quantity.ratio_of]
                ]
                found[name] = min(ends), max(ends)
            if name in found:
                del left[name]
        if len(left) == before:
            break
    return {name: found[name] for name in quantities if name in found}


def octant_signs(modes: Mapping[str, Mapping[str, str]]) -> dict[str, tuple[float, float, float]]:
    """Signs of each mode's octant; 0 where the mode has none."""
    meaning = {"+": 1.0, "-": -1.0}
    signs = {}
    for label, fields in modes.items():
        text = fields.get("octant", "any")
        x, y, z = (meaning[sign] for sign in text) if text != "any" else (0.0, 0.0, 0.0)
        signs[label] = (x, y, z)
    return signs


def with_ties(ties: Mapping[str, str], design: Design) -> Design:
    """The design with every tied parameter at the value of the one it names."""
    return {**design, **{name: design[source] for name, source in ties.items()}}


def with_ratios(variables: Sequence[Variable], multiples: Mapping[str, float], design: Design) -> Design:
    """The design with every variable named in ``multiples`` at that multiple of the parameter it is a ratio
    of, which may be such a variable itself."""
    sources = {variable.name: variable.ratio_of for variable in variables}
    found: dict[str, float | str] = dict(design)
    left = dict(multiples)

    def settle(name: str) -> float:
        if name in left:
            found[name] = left.pop(name) * settle(str(sources[name]))
        return float(found[name])

    for name in multiples:
        settle(name)
    return found


def with_changes(problem: Problem, design: Design, values: Design) -> Design:
    """A design with other ``values`` (SI) of some quantities. What is a ratio of one that changes remains the
    same multiple of it, unless it is given itself, and what is tied follows."""
    changed: Design = {**design, **values}
    left = [variable for variable in problem.variables if variable.ratio_of and variable.name not in values]
    while left:
        # those whose own parameter is settled first
        names = {variable.name for variable in left}
        ready = [variable for variable in left if variable.ratio_of not in names]
        for variable in ready:
            before, after = float(design[str(variable.ratio_of)]), float(changed[str(variable.ratio_of)])
            if before not in (after, 0.0):
                changed = {**changed, variable.name: float(design[variable.name]) / before * after}
        left = [variable for variable in left if variable not in ready]
    return with_ties(problem.ties, changed)
