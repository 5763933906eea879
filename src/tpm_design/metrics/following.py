"""Extremes of one design seen in its neighbours: at the poses where the design has them.

At a pose where a value is least over the region it changes, to first order, as it does at that pose held
fixed (J. M. Danskin, The theory of max-min, 1966). Poses move with the region's centre.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from tpm_design.metrics.base import FloatArray, Measurement, Nearby
from tpm_design.metrics.context import POLE, Context, Sides, Span
from tpm_design.metrics.neighbourhood import Neighbourhood
from tpm_design.workspace.extremes import Extreme, IndicesNear
from tpm_design.workspace.fold_clearance import fold_clearance
from tpm_design.workspace.indices import Index

CORNER_STEP, CORNER = 1e-6, 1e-9
"""Width of second differences, as a share of the machine's radius, and how large they are at a corner."""

Values = Callable[[Neighbourhood], FloatArray]
"""Of neighbouring designs, the first axis theirs."""

Posed = tuple[Sequence[Index], FloatArray]
"""Indices, and the poses (K, P, 3) of each."""


def pieces_of(context: Context, index: Index, extreme: Extreme) -> Values:
    """The pieces (N, P) of one extreme."""
    values = _at(context, lambda: ([index], extreme.piece_poses[None, :, :]))
    return lambda others: values(others)[:, 0]


def reach_of(context: Context) -> Values:
    """The pieces (N, P) of ``Context.reach``."""

    def near(others: Neighbourhood) -> FloatArray:
        found = others.values(context.reach_near)[:, 0]
        if not context.mechanism.fold_lines():
            return found
        return np.hstack([found, others.each(_fold_clearances)])

    return near


def _fold_clearances(context: Context) -> tuple[float, ...]:
    return tuple(fold_clearance(context.placed, line).value for line in context.mechanism.fold_lines())


def sides_of(context: Context) -> Values:
    """The pieces (N, D, P) of ``Context.sides``. Out of reach determinants are extrapolated, with corners
    where limbs are stretched: extremes there count as level."""
    sides = context.sides
    signs = np.array([[side.index.sign] for side in sides])

    def near(others: Neighbourhood) -> FloatArray:
        return np.maximum(signs * others.values(context.sides_near), POLE)

    if context.reachable:
        return near

    @cache
    def cornered() -> NDArray[np.bool_]:
        return _cornered(context, sides)

    return lambda others: np.where(cornered(), [side.pieces for side in sides], near(others))


def _cornered(context: Context, sides: Sequence[Sides]) -> NDArray[np.bool_]:
    """At which of its piece poses each determinant has a corner (D, P): there second differences are larger
    than the square of their width."""
    step = CORNER_STEP * context.mechanism.reach_radius()
    ways = step * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    indices = [side.index for side in sides]
    poses = np.array([side.extreme.piece_poses for side in sides])
    around = poses[:, :, None, :] + ways
    values = _at(context, lambda: (indices, around.reshape(len(indices), -1, 3)))(Neighbourhood((context,)))
    by_way = values.reshape(around.shape[:3])
    bends = np.abs(by_way[:, :, 1:4] + by_way[:, :, 4:] - 2.0 * by_way[:, :, :1])
    return np.asarray(bends.max(axis=2) > CORNER)


def span_of(context: Context, span: Span) -> Values:
    """The difference (N,) between two extremes of an index."""
    ends = [span.index._replace(sign=sign) for sign in (1.0, -1.0)]
    values = _at(context, lambda: (ends, np.array([[span.least.pose], [span.greatest.pose]])))

    def near(others: Neighbourhood) -> FloatArray:
        found = values(others)
        return found[:, 1, 0] - found[:, 0, 0]

    return near


def extreme_measurement(context: Context, index: Index) -> Measurement:
    """The least value of an index over the region (the greatest for sign −1)."""
    found = context.least(index)
    return in_pieces(found, index.sign, pieces_of(context, index, found))


def span_measurement(context: Context, span: Span) -> Measurement:
    """The difference between two extremes."""
    values = span_of(context, span)
    return Measurement(span.value, span.error, near=lambda others: Nearby(values(others), errors=span.error))


def out_of_reach(context: Context) -> Measurement:
    """0, and how far the region is out of reach, as a share of the machine's radius."""
    pieces = reach_of(context)

    def near(others: Neighbourhood) -> Nearby:
        return _flat(pieces(others).min(axis=1) / others.radii)

    return Measurement(0.0, depth=context.reach.value / context.mechanism.reach_radius(), near=near)


def reach_shortfall(context: Context) -> Measurement:
    """How far the region is out of reach (m, negative)."""
    return in_pieces(context.reach, 1.0, reach_of(context))


def in_pieces(found: Extreme, sign: float, pieces: Values) -> Measurement:
    """The least of some pieces (the greatest for sign −1)."""

    def near(others: Neighbourhood) -> Nearby:
        there = pieces(others)
        values = there.min(axis=1) if sign > 0.0 else there.max(axis=1)
        return Nearby(values, there, errors=found.error)

    return Measurement(found.value, found.error, pieces=found.pieces, near=near)


def in_one_piece(measurement: Measurement) -> Measurement:
    """The same without its pieces."""
    near = measurement.near
    there = None if near is None else lambda others: replace(near(others), pieces=None)
    return replace(measurement, pieces=(), near=there)


def singular(context: Context, side: Sides) -> Measurement:
    """0, and how far a determinant is beyond 0 somewhere in the region."""
    pieces = pieces_of(context, side.index, side.extreme)

    def near(others: Neighbourhood) -> Nearby:
        return _flat(np.maximum((side.index.sign * pieces(others)).min(axis=1), POLE))

    return Measurement(0.0, depth=side.margin, near=near)


def by_two_orders(
    fine_and_coarse: Callable[[Context], tuple[float, float]],
) -> Callable[[Neighbourhood], Nearby]:
    """A fine value whose error is its difference from a coarse one."""

    def near(others: Neighbourhood) -> Nearby:
        fine, coarse = others.each(fine_and_coarse).T
        return Nearby(fine, errors=np.abs(fine - coarse))

    return near


def _flat(depths: FloatArray) -> Nearby:
    return Nearby(np.zeros(len(depths)), depths=depths)


def _at(context: Context, posed: Callable[[], Posed]) -> Values:
    """Indices, each at its own poses, which are asked for once a neighbour is."""

    @cache
    def ready() -> IndicesNear:
        return IndicesNear(*posed(), context.placed.centre)

    return lambda others: others.values(ready())
