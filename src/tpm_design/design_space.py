"""The unit cube that optimisers search, and the designs its points stand for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tpm_design.problem import CENTRE, Design, Variable, with_ties

FloatArray = NDArray[np.float64]


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
        return self.completed(
            {v.name: value_at(v, float(c)) for v, c in zip(self.variables, point, strict=True)}
        )

    def completed(self, values: Design) -> Design:
        """The design with these values (SI) of its variables: what is fixed and what is tied added, and
        quantities that follow the mode's octant on its side. Values of fixed quantities take their place."""
        return with_ties(self.ties, self._mirrored({**self.fixed, **values}))

    def point(self, design: Design) -> FloatArray:
        """The unit-cube point (n,) of a design; discrete values at the centre of their interval."""
        coordinates = []
        for variable in self.variables:
            value = design[variable.name]
            if variable.values:
                coordinates.append((variable.values.index(value) + 0.5) / len(variable.values))
            else:
                number = abs(float(value)) if variable.mirrored else float(value)
                width = variable.upper - variable.lower
                coordinates.append((number - variable.lower) / width if width > 0.0 else 0.0)
        return np.clip(np.asarray(coordinates, dtype=np.float64), 0.0, 1.0)

    def start(self) -> FloatArray:
        """The point of every ``initial``, else of the middle of the range, else of the first value."""
        design: dict[str, float | str] = {}
        for variable in self.variables:
            if variable.initial is not None:
                design[variable.name] = variable.initial
            elif variable.values:
                design[variable.name] = variable.values[0]
            else:
                design[variable.name] = 0.5 * (variable.lower + variable.upper)
        return self.point(design)

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
            width = variable.upper - variable.lower
            low, high = max(0.0, float(coordinate) - share), min(1.0, float(coordinate) + share)
            narrowed.append(
                replace(variable, lower=variable.lower + low * width, upper=variable.lower + high * width)
            )
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
    return variable.lower + share * (variable.upper - variable.lower)


def octant_signs(modes: Mapping[str, Mapping[str, str]]) -> dict[str, tuple[float, float, float]]:
    """Signs of each mode's octant; 0 where the mode has none."""
    meaning = {"+": 1.0, "-": -1.0}
    signs = {}
    for label, fields in modes.items():
        text = fields.get("octant", "any")
        x, y, z = (meaning[sign] for sign in text) if text != "any" else (0.0, 0.0, 0.0)
        signs[label] = (x, y, z)
    return signs
