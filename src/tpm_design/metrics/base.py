"""What a metric declares about itself and what it gives back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tpm_design.mechanisms.base import MechanismKind
    from tpm_design.metrics.context import Context
    from tpm_design.metrics.neighbourhood import Neighbourhood

FloatArray = NDArray[np.float64]

Sense = Literal["maximize", "minimize"]
UNDEFINED = "undefined"

Cost = Literal["closed form", "extreme", "locus", "rays"]
COSTS: tuple[Cost, ...] = ("closed form", "extreme", "locus", "rays")
"""What a metric takes, cheapest first: a formula; least values over the region; distances to loci, which are
dearer than rays where the whole region is reachable, and nothing where it is not; volumes by rays."""


@dataclass(frozen=True)
class Option:
    """One option of a metric.

    ``kind``: "choice" (one of ``choices``), "number" (within ``minimum``..``maximum``, no unit), "length" (a
    positive length) or "point" (three lengths), in the study's unit and handed on in metres.
    ``default`` None: not given.
    """

    name: str
    kind: Literal["choice", "number", "length", "point"]
    description: str
    default: Any = None
    choices: tuple[str, ...] = ()
    minimum: float = float("-inf")
    maximum: float = float("inf")
    required: bool = False


@dataclass(frozen=True)
class Nearby:
    """What a measurement says of N neighbouring designs, exact to first order: ``values`` (N,) and what
    ``Measurement`` calls so, ``pieces`` (N, P), ``errors`` and ``depths`` (N,), 0 throughout where they are
    left out, ``full_slacks`` (N, P). A value that is not known is NaN."""

    values: FloatArray
    pieces: FloatArray | None = None
    errors: FloatArray | float = 0.0
    depths: FloatArray | float = 0.0
    full_slacks: FloatArray | None = None


@dataclass(frozen=True)
class Measurement:
    """A metric's value in SI units with its numeric error.

    Values may be flat where a constraint on them fails; then ``depth`` ≤ 0 is added to a negative slack,
    and ``full_slacks`` replace the slack of a constraint that asks for the full score 1 (coverage).
    ``pieces``: values whose least (of a metric to be large) or greatest is ``value``; like ``full_slacks``
    smoother in the design than their minimum. ``notes`` are extra columns, such as which
    locus was nearest. ``near``: what this says of neighbouring designs, taken where its own extremes are;
    None where nothing is known of them.
    """

    value: float
    error: float = 0.0
    depth: float = 0.0
    full_slacks: tuple[float, ...] = ()
    notes: Mapping[str, str] = field(default_factory=dict)
    pieces: tuple[float, ...] = ()
    near: Callable[[Neighbourhood], Nearby] | None = field(default=None, compare=False, repr=False)

    @classmethod
    def undefined(cls, reason: str) -> Measurement:
        """No value: the design is infeasible for the stated reason, and so are its neighbours."""
        return cls(float("nan"), notes={UNDEFINED: reason})


def never_refused(kind: MechanismKind, limits: Mapping[str, Any]) -> str | None:
    """A metric that means something for every mechanism."""
    return None


def of_positions(kind: MechanismKind, limits: Mapping[str, Any]) -> str | None:
    """A metric in metres or cubic metres of pose space: poses must be positions."""
    return None if kind.translational else f"the poses of {kind.name} are not positions"


@dataclass(frozen=True)
class Metric:
    """One figure of merit. ``scale`` (in the metric's SI unit) makes its violation dimensionless. ``notes``:
    names of the notes its measurements may carry. ``refusal(kind, limits)``: why it means nothing for a
    mechanism with these limits, None where it does; ``drives``: those of the mechanism's drives for which it
    does, the usual one first. ``cost``: what it takes; cheap ones are measured first. ``greatest``: what it
    can never exceed, in its SI unit."""

    name: str
    unit: str
    better: Sense
    scale: float
    description: str
    source: str
    compute: Callable[[Context, Mapping[str, Any]], Measurement]
    options: tuple[Option, ...] = ()
    needs_region: bool = True
    differentiable: bool = True
    notes: tuple[str, ...] = ()
    refusal: Callable[[MechanismKind, Mapping[str, Any]], str | None] = never_refused
    drives: Callable[[MechanismKind], tuple[str, ...]] = lambda kind: kind.drives
    cost: Cost = "extreme"
    greatest: float = float("inf")

    def option(self, name: str) -> Option | None:
        return next((option for option in self.options if option.name == name), None)
