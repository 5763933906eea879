"""One evaluated design."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from tpm_design.evaluation.slopes import Slopes
from tpm_design.problem import Design


@dataclass(frozen=True)
class Cutoff:
    """What a design must not be worse than to be worth measuring: a ``violation`` and, where that is 0, a
    value of the objective as ``scaled_objective`` gives it."""

    violation: float
    objective: float


@dataclass(frozen=True)
class Evaluation:
    """One evaluated design, SI units. ``slacks``: constraint label → signed distance to its bound, the
    least of its ``pieces``: one number, or a fixed number of them, smoother in the design; those of the
    problem's samples included. Of several objectives ``pieces`` has the values of which each is the least or
    the greatest, none where it is one by itself.

    "aborted": found to be worse than ``cutoff`` before everything was measured. What was not measured is
    missing; ``violation`` is what it is at least. ``slopes``: None where they were not asked for.
    """

    design: Design
    metrics: Mapping[str, float]
    errors: Mapping[str, float]
    slacks: Mapping[str, float]
    pieces: Mapping[str, tuple[float, ...]]
    notes: Mapping[str, str]
    violation: float
    status: Literal["feasible", "infeasible", "failed", "aborted"]
    reason: str
    seconds: float
    cutoff: Cutoff | None = None
    slopes: Slopes | None = None
