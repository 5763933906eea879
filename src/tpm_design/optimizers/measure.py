"""What a local search weighs objective and constraints by."""

from __future__ import annotations

import numpy as np

from tpm_design.optimizers.base import FloatArray
from tpm_design.optimizers.places import Place
from tpm_design.optimizers.quadratic import Program, Step, elastic_step

INSIDE = 1e-9
"""How far inside its constraints a search aims to end, as a share of the ranges."""

FORGOTTEN = 0.3
"""Factor by which a slope that is the measure may shrink at each step."""

FLATTEST = 1e-3, 1e-6
"""Slopes of constraints and objective count as at least these shares of their steepest so far."""

FIRST_PENALTY, LEAST_PENALTY, LARGEST_PENALTY = 10.0, 1.0, 1e5

MET = 1e-10
"""Shortfall of a program's step up to which it meets its constraints."""


class Measure:
    """Scales, ``height`` of the objective and ``weights`` (m,) of the constraints, by which their steepest
    slopes lately are 1 over the whole range, and the ``penalty`` on the worst shortfall."""

    def __init__(self, count: int) -> None:
        self.height, self.penalty = 0.0, FIRST_PENALTY
        self.weights = np.ones(count)
        self._idle = np.zeros(count, dtype=bool)
        self._steepest = self._greatest = np.zeros(count)
        self._highest = 0.0

    def follow(self, here: Place, gradient: FloatArray, jacobian: FloatArray) -> float:
        """Take in the slopes at a place; the factor by which measured objectives grow."""
        slopes = np.abs(jacobian).max(axis=1, initial=0.0)
        self._idle = (slopes == 0.0) & (here.constraints < 0.0)
        self._greatest = np.maximum(self._greatest, slopes)
        least = np.maximum(FORGOTTEN * self._steepest, FLATTEST[0] * self._greatest)
        self._steepest = np.maximum(slopes, least)
        self.weights = 1.0 / np.where(self._steepest > 0.0, self._steepest, 1.0)
        steepness, before = float(np.abs(gradient).max()), self.height
        self._highest = max(self._highest, steepness)
        lowest = max(FORGOTTEN / before if before else 0.0, FLATTEST[1] * self._highest)
        self.height = 1.0 / (max(steepness, lowest) or 1.0)
        factor = self.height / before if before else 1.0
        self.penalty *= factor
        return factor

    def needed(self, place: Place) -> FloatArray:
        """The constraints (m,), measured. Those that were missed and level at the last place give no way to
        go by and count as met."""
        needed: FloatArray = place.constraints * self.weights - INSIDE
        return np.where(self._idle, 1.0, needed)

    def shortfall(self, place: Place) -> float:
        """Of the constraint missed most."""
        return max(0.0, float(-self.needed(place).min(initial=0.0)))

    def gain(self, here: Place, there: Place) -> float:
        """By how much the penalised objective is less at ``there``."""
        objective = (here.objective - there.objective) * self.height
        return objective + self.penalty * (self.shortfall(here) - self.shortfall(there))

    def steered(self, program: Program, *, easing: bool) -> Step:
        """The step of a program, with a penalty that is large enough for it to meet what it can (R. H. Byrd,
        J. Nocedal, R. A. Waltz, Steering exact penalty methods, 2008). ``easing``: the penalty may shrink."""
        step = elastic_step(program, self.penalty)
        while step.shortfall > MET and self.penalty < LARGEST_PENALTY:
            harder = elastic_step(program, 10.0 * self.penalty)
            if harder.shortfall > 0.9 * step.shortfall:
                break
            step, self.penalty = harder, 10.0 * self.penalty
        kept = 0.5 * self.penalty if easing else self.penalty
        enough = 2.0 * float(step.multipliers.sum()) if step.shortfall <= MET else 0.0
        self.penalty = max(kept, min(enough, LARGEST_PENALTY), LEAST_PENALTY)
        return step
