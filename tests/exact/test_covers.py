"""Covers: every leaf holds what its letter says, and no bound beyond the true extreme is proved."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from designs import SHAPES, reachable_context, throughout

from tpm_design.mechanisms.mechanism import FloatArray
from tpm_design.metrics.context import Context
from tpm_design.workspace import statements
from tpm_design.workspace.covers import Cover, Proof, prove
from tpm_design.workspace.indices import REACH, SLOWEST, Index, index_values
from tpm_design.workspace.region_geometry import signed_distance_at

DETERMINANTS = ("translation", "actuation", "rotation")


def leaves(cover: Cover) -> Iterator[tuple[str, FloatArray]]:
    """Letter and box (3, 2) of every leaf."""
    waiting = [np.array(cover.root)]
    for letter in cover.tree:
        box = waiting.pop()
        if letter in "xyz":
            axis = "xyz".index(letter)
            lower, upper = box.copy(), box.copy()
            lower[axis, 1] = upper[axis, 0] = 0.5 * (box[axis, 0] + box[axis, 1])
            waiting += [upper, lower]
        else:
            yield letter, box
    assert not waiting


def proof_of(statement: statements.Slowest | statements.Regular, context: Context, distance: float) -> Proof:
    return prove(
        statement,
        context.mechanism,
        context.mode,
        context.placed,
        tolerance={},
        distance=distance,
        boxes=20_000,
    )


def near(context: Context, distance: float, count: int, random: np.random.Generator) -> FloatArray:
    """Poses (N, 3) within ``distance`` of the region."""
    poses = throughout(context.placed, count, random)
    away = random.normal(size=poses.shape)
    away *= (distance * random.random(count) / np.linalg.norm(away, axis=1))[:, None]
    return np.asarray(poses + away)


def test_leaves_hold_what_they_say() -> None:
    """Around regions near the bound of reach: poses of each kind of leaf, and all poses in some leaf."""
    random = np.random.default_rng(5)
    counted = dict.fromkeys("pon", 0)
    while min(counted.values()) < 100:
        context = reachable_context(random, str(random.choice(SHAPES)), whole=True, samples=5)
        part = int(random.integers(3))
        sign = float(np.sign(context.lattice_determinants[part].flat[0]))
        distance = context.reach.value + float(random.uniform(0.0, 0.1))
        found = proof_of(statements.Regular(part, sign), context, distance)
        if not found.proved:
            continue
        geometry, signs = context.mechanism.geometry, context.mode.signs
        poses = near(context, distance, 2000, random)
        held = np.zeros(len(poses), np.bool_)
        for letter, box in leaves(found.covers[0]):
            inside = ((poses >= box[:, 0]) & (poses <= box[:, 1])).all(axis=1)
            held |= inside & (letter != "o")
            sample = random.uniform(box[:, 0], box[:, 1], (20, 3))
            reach = np.asarray(index_values(geometry, signs, Index(REACH), sample))
            counted[letter] += 1
            if letter == "o":
                distances = [signed_distance_at(context.placed, tuple(pose)) for pose in sample.tolist()]
                assert min(distances) > distance
            elif letter == "n":
                assert reach.max() < 0.0
            elif (reach >= 0.0).any():
                margins = context.mechanism.determinants(sample[reach >= 0.0], context.mode)[part]
                assert (sign * margins).min() > 0.0
        assert held.all()


@pytest.mark.parametrize("motor", [0.0, 1.0])
def test_no_bound_beyond_the_extreme_is_proved(motor: float) -> None:
    """A millionth above the least singular value a proof fails, a hundredth below it succeeds."""
    random = np.random.default_rng(2)
    proved = 0
    for _ in range(8):
        context = reachable_context(random, str(random.choice(SHAPES)), whole=True, samples=5)
        least = context.least(Index(SLOWEST, motor=motor)).value
        for excess in (1e-6, 1e-4, 1e-2):
            assert not proof_of(statements.Slowest(motor, least * (1.0 + excess)), context, 0.0).proved
        proved += proof_of(statements.Slowest(motor, least * 0.99), context, 0.0).proved
    assert proved >= 7


@pytest.mark.parametrize(
    ("seed", "motor", "excess"), [(42, 0.0, 1e-3), (118, 1.0, 1e-4), (202, 0.0, 1e-3), (231, 1.0, 1e-3)]
)
def test_rows_of_different_matrices_are_not_put_together(seed: int, motor: float, excess: float) -> None:
    """Each box writes the matrix in a frame of its own: rows proved in another one say nothing there."""
    random = np.random.default_rng(seed)
    context = reachable_context(random, str(random.choice(SHAPES)), whole=True, samples=5)
    least = context.least(Index(SLOWEST, motor=motor)).value
    assert not proof_of(statements.Slowest(motor, least * (1.0 + excess)), context, 0.0).proved
