"""What a search leaves as its result: the best design, then every other local optimum its method noted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from tpm_design.design_space import DesignSpace
from tpm_design.problem import Design, Problem
from tpm_design.runs.search import Entry, design_key, rank

SAME = 0.01
"""Designs of the same discrete choice that are nearer than this share of its range in every continuous
variable are one optimum."""


def distinct_optima(
    problem: Problem,
    space: DesignSpace,
    best: Entry | None,
    entries: Sequence[Entry],
    noted: Iterable[Design],
) -> tuple[Entry, ...]:
    """``best``, then the feasible entries among ``noted``, best first, duplicates left out. Only entries of
    the best one's round: others were judged by other samples."""
    if best is None:
        return ()
    if best.evaluation.status != "feasible":
        return (best,)
    keys = {design_key(design) for design in noted}
    optima = [best]
    for entry in sorted(entries, key=lambda entry: rank(problem, entry)):
        evaluation = entry.evaluation
        if entry.round != best.round or evaluation.status != "feasible":
            continue
        if design_key(evaluation.design) in keys and not any(_same(space, entry, known) for known in optima):
            optima.append(entry)
    return tuple(optima)


def _same(space: DesignSpace, one: Entry, other: Entry) -> bool:
    first, second = one.evaluation.design, other.evaluation.design
    if any(first[v.name] != second[v.name] for v in space.variables if v.values):
        return False
    return float(np.abs(space.point(first) - space.point(second)).max()) < SAME
