"""What a study asks, in SI units: free quantities, goals, samples of the tolerances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from tpm_design.mechanisms.base import Dimension, MechanismKind
from tpm_design.metrics.base import Metric, Sense
from tpm_design.workspace.regions import Shape

CENTRE = ("center_x", "center_y", "center_z")

Design = Mapping[str, float | str]
"""Parameter names → SI values, ``center_x`` … → metres, ``mode`` → the mode's label."""


@dataclass(frozen=True)
class Variable:
    """One free quantity. Continuous: ``lower``..``upper``. Otherwise one of ``values`` (SI or mode labels).

    ``mirrored``: the value takes the sign of the mode's octant along that axis, so that a search over
    octants keeps one range. ``scale``: "log" is searched by its logarithm, ``lower`` > 0. ``ratio_of``: the
    parameter that it is searched as a multiple of; ``lower``, ``upper`` and ``initial`` are multiples then,
    its value in a design is SI like any other.
    """

    name: str
    dimension: Dimension | Literal["mode"]
    lower: float = 0.0
    upper: float = 0.0
    values: tuple[float, ...] | tuple[str, ...] = ()
    initial: float | str | None = None
    mirrored: bool = False
    scale: Literal["linear", "log"] = "linear"
    ratio_of: str | None = None


@dataclass(frozen=True)
class Goal:
    """One metric with its options, as an objective, a constraint or a recorded figure.

    Objective: ``sense``. Constraint: ``minimum`` and/or ``maximum`` in SI. Recorded: none of them.
    """

    metric: Metric
    label: str
    options: Mapping[str, Any] = field(default_factory=dict)
    sense: Sense | None = None
    minimum: float | None = None
    maximum: float | None = None


@dataclass(frozen=True)
class Accuracy:
    """``volume``: relative error wanted of volumes and averages. ``region_samples``: samples along the
    longest edge of the region from which its extremes are polished."""

    volume: float = 1e-3
    region_samples: int = 9


@dataclass(frozen=True)
class Sample:
    """The constraint ``label`` must also hold, with ``margin`` (its metric's SI unit) to spare, for the
    machine whose parameters differ from the design's by ``offsets`` (name → one per limb, SI; empty: the
    exact one), over the whole region and at ``pose`` (m, about the region's centre; None: at none alone)."""

    label: str
    offsets: Mapping[str, tuple[float, ...]]
    pose: tuple[float, float, float] | None
    margin: float


@dataclass(frozen=True)
class Problem:
    """What a study asks. ``modes``: label → sign strings, ``{"+++ +-+": {"octant": …, "elbows": …}}``.
    ``samples``: what every design must hold besides; a design's metrics are those of its exact machine.
    ``ties``: parameters that take the value of another one, by name: neither fixed nor free."""

    kind: MechanismKind
    fixed: Mapping[str, float | str]
    variables: tuple[Variable, ...]
    modes: Mapping[str, Mapping[str, str]]
    limits: Mapping[str, Any]
    region: Shape | None
    objectives: tuple[Goal, ...]
    constraints: tuple[Goal, ...]
    record: tuple[Goal, ...]
    accuracy: Accuracy = Accuracy()
    samples: tuple[Sample, ...] = ()
    ties: Mapping[str, str] = field(default_factory=dict)
