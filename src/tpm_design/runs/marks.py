"""What stands out on a front: its knee, and the best design by each objective."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpm_design.problem import Problem
from tpm_design.runs.entry import Entry
from tpm_design.runs.front import extremes, knee
from tpm_design.runs.ranking import scaled_objectives

KNEE = "knee"


def front_marks(problem: Problem, front: Sequence[Entry]) -> list[str]:
    """For each entry of a front ``knee``, ``best <label>``, several of them joined by ``; ``, or nothing.
    Nothing for entries that are not feasible."""
    if not front or any(entry.evaluation.status != "feasible" for entry in front):
        return [""] * len(front)
    values = np.array([scaled_objectives(problem, entry.evaluation) for entry in front])
    found: list[list[str]] = [[] for _ in front]
    found[knee(values)].append(KNEE)
    for goal, row in zip(problem.objectives, extremes(values), strict=True):
        found[row].append(f"best {goal.label}")
    return ["; ".join(marks) for marks in found]
