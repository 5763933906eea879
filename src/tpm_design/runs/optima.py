"""What a search leaves as its result: the best design, then every other local optimum its method noted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from tpm_design.design_space import DesignSpace
from tpm_design.optimizers.starts import are_one
from tpm_design.problem import Design, Problem
from tpm_design.runs.entry import Entry, design_key
from tpm_design.runs.ranking import rank


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
    optima, levels = [best], np.array(space.levels)
    for entry in sorted(entries, key=lambda entry: rank(problem, entry)):
        evaluation = entry.evaluation
        if entry.round != best.round or evaluation.status != "feasible":
            continue
        if design_key(evaluation.design) not in keys:
            continue
        point = space.point(evaluation.design)
        if not any(are_one(point, space.point(known.evaluation.design), levels) for known in optima):
            optima.append(entry)
    return tuple(optima)
