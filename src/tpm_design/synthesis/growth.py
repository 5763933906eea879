"""A body grown from a pose: planes that separate it from what it must not hold, then the largest body between
them, and again.

R. Deits, R. Tedrake, Computing large convex regions of obstacle-free space through semidefinite programming,
WAFR 2014. Obstacles are what rays from the body's centre meet. Where the free set is convex all their tangent
planes stay; where an obstacle bulges the nearest plane replaces those that it hides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpm_design.optimizers.polytope import largest_between
from tpm_design.synthesis.body_forms import BodyForm
from tpm_design.synthesis.fold_planes import fold_plane
from tpm_design.synthesis.free_set import FreeSet, Seed

FloatArray = NDArray[np.float64]

MOST_ROUNDS = 8
# growth by less than this, twice, ends the rounds: what follows is quicker at it
WORTHWHILE = 0.01
# shares of the reach: within which a bound counts as met by a ray, where slopes are taken instead of at a
# kink, and by which a plane hides what it touches
NEAR, AROUND, HIDDEN = 1e-4, 1e-4, 1e-9


@dataclass(frozen=True, eq=False)
class Grown:
    """A body of a form: ``centre`` (3,), ``sizes`` (k,), metres; about all of it lies in the free set."""

    free: FreeSet
    centre: FloatArray
    sizes: FloatArray


def grown(form: BodyForm, seed: Seed) -> Grown | None:
    """The body to which a seed grows, None where nothing is found around it."""
    free, centre = seed.free, seed.pose
    count = form.spread.shape[1]
    sizes = np.full(count, 0.5 * seed.depth / float(form.spread.max()))
    best: Grown | None = None
    volume, stuck = 0.0, 0
    exits = free.exits(centre)
    for _ in range(MOST_ROUNDS):
        if not len(exits):
            break
        fitting = _fitting(form, free, centre, sizes, exits)
        gained = form.volume(fitting) / volume - 1.0 if best else math.inf
        if gained > 0.0:
            best, volume = Grown(free, centre, fitting), form.volume(fitting)
        stuck = stuck + 1 if gained < WORTHWHILE else 0
        if stuck == 2:
            break
        normals, offsets = _planes(form, free, centre, fitting, exits)
        # about the centre and of the order of 1, for the solver's sake
        found = largest_between(
            form.unit, form.spread, normals, (offsets - normals @ centre) / free.length, 2.0
        )
        if found is None:
            break
        wanted = centre + free.length * found.centre
        centre, sizes, exits = _inside(free, centre, wanted, free.length * found.sizes)
    return best


def _inside(
    free: FreeSet, centre: FloatArray, wanted: FloatArray, sizes: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The next centre, nearer to the last one if rays show that it is outside, and the exits from it."""
    for share in (1.0, 0.5, 0.25):
        there = centre + share * (wanted - centre)
        exits = free.exits(there)
        if len(exits):
            return there, sizes, exits
    return centre, sizes, np.zeros((0, 3))


def _fitting(
    form: BodyForm, free: FreeSet, centre: FloatArray, sizes: FloatArray, exits: FloatArray
) -> FloatArray:
    """The sizes scaled so that the body just holds no exit."""
    scaled = sizes * float(form.gauge(exits - centre, sizes).min())
    for line in free.lines:
        for _ in range(60):
            if fold_plane(form, centre, scaled, line).room >= 0.0:
                break
            scaled = 0.9 * scaled
    return np.asarray(scaled)


def _planes(
    form: BodyForm, free: FreeSet, centre: FloatArray, sizes: FloatArray, exits: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Separating planes, the nearest first."""
    planes = [fold_plane(form, centre, sizes, line) for line in free.lines]
    normals, offsets = [plane.normal for plane in planes], [plane.offset for plane in planes]
    length = free.length
    waiting = exits[np.argsort(form.gauge(exits - centre, sizes), kind="stable")]
    touching = free.tangents(waiting, NEAR * length, AROUND * length)
    # a plane beyond which the centre lies separates nothing
    usable = touching.normals @ centre < touching.offsets
    hidden = np.zeros(len(waiting), dtype=np.bool_)
    for n, pose in enumerate(waiting):
        if hidden[n]:
            continue
        own = np.flatnonzero(usable & (touching.pose == n))
        there, beyond = touching.normals[own], touching.offsets[own]
        if not own.size:
            # the bounds have no slope here: a plane across the ray
            across = (pose - centre) / np.linalg.norm(pose - centre)
            there, beyond = across[None], np.array([across @ pose])
        normals.extend(there)
        offsets.extend(beyond.tolist())
        hidden |= (waiting @ there.T >= beyond - HIDDEN * length).any(axis=1)
    return np.array(normals), np.array(offsets)
