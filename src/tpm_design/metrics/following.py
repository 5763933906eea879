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

from tpm_design.metrics.base import Measurement
from tpm_design.metrics.context import POLE, Context, Sides, Span
from tpm_design.workspace.extremes import Extreme, IndicesNear
from tpm_design.workspace.fold_clearance import fold_clearance
from tpm_design.workspace.indices import REACH, Index

CORNER_STEP, CORNER = 1e-6, 1e-9
"""Width of second differences, as a share of the machine's radius, and how large they are at a corner."""

Values = Callable[[Context], NDArray[np.float64]]
"""Of a neighbouring design."""

Posed = tuple[Sequence[Index], NDArray[np.float64]]
"""Indices, and the poses (K, P, 3) of each."""


def pieces_of(context: Context, index: Index, extreme: Extreme) -> Values:
    """The pieces (P,) of one extreme."""
    values = _at(context, lambda: ([index], extreme.piece_poses[None, :, :]))
    return lambda other: values(other)[0]


def reach_of(context: Context) -> Values:
    """The pieces of ``Context.reach``."""
    values = pieces_of(context, Index(REACH), context.reach)

    def near(other: Context) -> NDArray[np.float64]:
        folds = [fold_clearance(other.placed, line).value for line in other.mechanism.fold_lines()]
        return np.concatenate([values(other), folds]) if folds else values(other)

    return near


def sides_of(context: Context) -> Values:
    """The pieces (D, P) of ``Context.sides``. Out of reach determinants are extrapolated, with corners where
    limbs are stretched: extremes there count as level."""
    sides = context.sides
    values = _at(context, lambda: _posed(sides))
    signs = np.array([[side.index.sign] for side in sides])

    def near(other: Context) -> NDArray[np.float64]:
        return np.asarray(np.maximum(signs * values(other), POLE))

    if context.reachable:
        return near

    @cache
    def cornered() -> NDArray[np.bool_]:
        return _cornered(context, sides)

    return lambda other: np.where(cornered(), [side.pieces for side in sides], near(other))


def _posed(sides: Sequence[Sides]) -> Posed:
    return [side.index for side in sides], np.array([side.extreme.piece_poses for side in sides])


def _cornered(context: Context, sides: Sequence[Sides]) -> NDArray[np.bool_]:
    """At which of its piece poses each determinant has a corner (D, P): there second differences are larger
    than the square of their width."""
    step = CORNER_STEP * context.mechanism.reach_radius()
    ways = step * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    indices, poses = _posed(sides)
    around = poses[:, :, None, :] + ways
    values = _at(context, lambda: (indices, around.reshape(len(indices), -1, 3)))(context)
    by_way = values.reshape(around.shape[:3])
    bends = np.abs(by_way[:, :, 1:4] + by_way[:, :, 4:] - 2.0 * by_way[:, :, :1])
    return np.asarray(bends.max(axis=2) > CORNER)


def span_of(context: Context, span: Span) -> Callable[[Context], float]:
    """The difference between two extremes of an index."""
    ends = [span.index._replace(sign=sign) for sign in (1.0, -1.0)]
    values = _at(context, lambda: (ends, np.array([[span.least.pose], [span.greatest.pose]])))

    def near(other: Context) -> float:
        least, greatest = values(other)[:, 0].tolist()
        return float(greatest - least)

    return near


def extreme_measurement(context: Context, index: Index) -> Measurement:
    """The least value of an index over the region (the greatest for sign −1)."""
    found = context.least(index)
    pieces = pieces_of(context, index, found)

    def near(other: Context) -> Measurement:
        return _of_pieces(pieces(other), found, index.sign)

    return Measurement(found.value, found.error, pieces=found.pieces, near=near)


def span_measurement(context: Context, span: Span) -> Measurement:
    """The difference between two extremes."""
    value = span_of(context, span)
    return Measurement(span.value, span.error, near=lambda other: Measurement(value(other), span.error))


def out_of_reach(context: Context) -> Measurement:
    """0, and how far the region is out of reach, as a share of the machine's radius."""
    pieces = reach_of(context)

    def near(other: Context) -> Measurement:
        return Measurement(0.0, depth=float(pieces(other).min()) / other.mechanism.reach_radius())

    return Measurement(0.0, depth=context.reach.value / context.mechanism.reach_radius(), near=near)


def reach_shortfall(context: Context) -> Measurement:
    """How far the region is out of reach (m, negative)."""
    found, pieces = context.reach, reach_of(context)

    def near(other: Context) -> Measurement:
        return _of_pieces(pieces(other), found, 1.0)

    return Measurement(found.value, found.error, pieces=found.pieces, near=near)


def in_one_piece(measurement: Measurement) -> Measurement:
    """The same without its pieces."""
    near = measurement.near
    there = None if near is None else lambda other: replace(near(other), pieces=())
    return replace(measurement, pieces=(), near=there)


def singular(context: Context, side: Sides) -> Measurement:
    """0, and how far a determinant is beyond 0 somewhere in the region."""
    pieces = pieces_of(context, side.index, side.extreme)

    def near(other: Context) -> Measurement:
        return Measurement(0.0, depth=max(float((side.index.sign * pieces(other)).min()), POLE))

    return Measurement(0.0, depth=side.margin, near=near)


def _of_pieces(pieces: NDArray[np.float64], found: Extreme, sign: float) -> Measurement:
    values = pieces.tolist()
    return Measurement(min(values) if sign > 0.0 else max(values), found.error, pieces=tuple(values))


def _at(context: Context, posed: Callable[[], Posed]) -> Values:
    """Indices, each at its own poses, which are asked for once a neighbour is."""

    @cache
    def ready() -> IndicesNear:
        return IndicesNear(*posed(), context.placed.centre)

    return lambda other: ready().values(other.mechanism.geometry, other.mode.signs, other.placed.centre)
