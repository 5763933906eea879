"""Descent in discrete variables: neighbouring choices, each with a local search of the continuous ones."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from tpm_design.optimizers.base import Question
from tpm_design.optimizers.descent import Landing, Walk, descend
from tpm_design.optimizers.places import looked_at, places
from tpm_design.optimizers.starts import Choice, Levels, choice_of

FEW_LEVELS = 4
"""Variables of no more levels are tried at each of them, others at the neighbouring ones, also two by two."""

STRIDES = (4, 2, 1)
"""After a move that paid, so many times as far the same way is tried as well."""

TRIED = 3
"""Neighbours, the most promising first, that get a local search."""

GUESSED, RADIUS, STEPS = 0.2, 0.1, 15
"""How far from the optimum such a search may begin, and its first trust region, as shares of each range; its
steps, at most."""


def descend_levels(landing: Landing, levels: Levels) -> Walk:
    """Go from choice to neighbouring choice as long as that improves the optimum."""
    discrete, free = np.flatnonzero(levels > 0), np.flatnonzero(levels == 0)
    choice = choice_of(landing.place.point, levels)
    tried, moved = {choice}, choice
    while True:
        jumps = [tuple(a + k * (a - b) for a, b in zip(choice, moved, strict=True)) for k in STRIDES]
        options = [c for c in [*jumps, *neighbours(choice, levels)] if c not in tried and _exists(c, levels)]
        options = list(dict.fromkeys(options))
        if not options:
            return landing
        points = np.tile(landing.place.point, (len(options), 1))
        points[:, discrete] = (np.array(options) + 0.5) / levels[discrete]
        found = places(points, (yield Question(points)))
        if len(found[0].constraints) != len(landing.weights):
            landing = yield from descend(landing.place, free, RADIUS)
        guesses = [landing.guess(place, free, GUESSED) for place in found]
        order = sorted(range(len(options)), key=lambda n: guesses[n][0])
        moved = choice
        for number in order[:TRIED]:
            tried.add(options[number])
            start = yield from looked_at(guesses[number][1])
            trial = yield from descend(start, free, RADIUS, steps=STEPS)
            if trial.place.improves(landing.place):
                landing, choice = trial, options[number]
                break
        else:
            return landing


def neighbours(choice: Choice, levels: Levels) -> list[Choice]:
    """The choices next to one."""
    counts = [int(count) for count in levels if count]
    many = [n for n, count in enumerate(counts) if count > FEW_LEVELS]
    found = []
    for n, count in enumerate(counts):
        values = range(count) if count <= FEW_LEVELS else (choice[n] - 1, choice[n] + 1)
        found += [(*choice[:n], value, *choice[n + 1 :]) for value in values if value != choice[n]]
    for first, second in combinations(many, 2):
        for a, b in product((-1, 1), repeat=2):
            other = list(choice)
            other[first] += a
            other[second] += b
            found.append(tuple(other))
    return [other for other in found if _exists(other, levels)]


def _exists(choice: Choice, levels: Levels) -> bool:
    counts = [int(count) for count in levels if count]
    return all(0 <= value < count for value, count in zip(choice, counts, strict=True))
