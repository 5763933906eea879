"""The local search of ``multistart`` as a method of its own."""

from __future__ import annotations

from collections import deque
from contextlib import closing

import numpy as np

from tpm_design.optimizers.base import Abilities, FloatArray, Optimizer
from tpm_design.optimizers.descent import Walk, descend
from tpm_design.optimizers.places import looked_at
from tpm_design.optimizers.watch import LOCAL_STEP, Watch, watched


def _walk(start: FloatArray) -> Walk:
    place = yield from looked_at(start)
    return (yield from descend(place, np.arange(len(start)), LOCAL_STEP))


def descent(watch: Watch, seed: int) -> str:
    """From ``start`` downhill. Raises BudgetSpent."""
    walk = _walk(watch.start)
    questions = deque([next(walk)])
    with closing(watch.answers(questions)) as answers:
        for found in answers:
            try:
                questions.append(walk.send(found))
            except StopIteration:
                break
    return "Converged: no step leads further downhill."


METHODS = (
    Optimizer(
        "descent",
        "local: quadratic programs in a trust region, with cutting planes where constraints have kinks",
        "Fletcher, 1987; Powell, 1978",
        Abilities(
            constraints=True, discrete=False, derivatives=False, random=False, whole_space=False, batch=True
        ),
        watched(descent),
    ),
)
