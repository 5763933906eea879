"""Least and greatest values over regions against dense sampling and a local search of its own."""

from __future__ import annotations

import numpy as np
import pytest
from designs import SHAPES, into, reachable_context, throughout

from tpm_design.metrics.context import Context
from tpm_design.workspace import indices
from tpm_design.workspace.extremes import extremes_over_region
from tpm_design.workspace.indices import Index, index_values
from tpm_design.workspace.region_geometry import place
from tpm_design.workspace.regions import Points

INDICES = {
    "reach": Index(indices.REACH),
    "legs": Index(indices.LEGS),
    "det V": Index(indices.DETERMINANT, 0),
    "det W": Index(indices.DETERMINANT, 1),
    "det W, greatest": Index(indices.DETERMINANT, 1, sign=-1.0),
    "|det V|": Index(indices.SINGULARITY, 0),
    "det H": Index(indices.DETERMINANT, 2),
    "serial": Index(indices.SERIAL),
    "1/κ₂, motors": Index(indices.CONDITION_2),
    "1/κ₂, joints": Index(indices.CONDITION_2, motor=0.0),
    "1/κ_F": Index(indices.CONDITION_FROBENIUS),
    "fastest": Index(indices.FASTEST, sign=-1.0),
    "slowest": Index(indices.SLOWEST),
    "transmission": Index(indices.TRANSMISSION, motor=0.0),
    "sensitivity": Index(indices.SENSITIVITY, sign=-1.0),
    "clearance": Index(indices.CLEARANCE),
    "actuator, least": Index(indices.ACTUATOR, 0),
    "actuator, greatest": Index(indices.ACTUATOR, 2, sign=-1.0),
    "extent, least": Index(indices.EXTENT, 0),
    "extent, greatest": Index(indices.EXTENT, 1, sign=-1.0),
}


def sampled_extreme(context: Context, index: Index, random: np.random.Generator) -> float:
    """Least of sign · field over 6 000 poses, then over shrinking clouds around the best three."""
    geometry, signs, region = context.mechanism.geometry, context.mode.signs, context.placed
    poses = throughout(region, 6000, random)
    values = index_values(geometry, signs, index, poses)
    best = []
    for n in np.argsort(values)[:3]:
        pose, value, width = poses[n], values[n], 0.15
        for _ in range(26):
            cloud = into(region, pose + width * np.array(region.half) * random.normal(size=(250, 3)))
            around = index_values(geometry, signs, index, cloud)
            if around.min() < value:
                pose, value = cloud[around.argmin()], around.min()
            width *= 0.62
        best.append(value)
    return float(min(best))


@pytest.mark.parametrize("name", INDICES)
def test_extremes(name: str) -> None:
    random = np.random.default_rng(21)
    index = INDICES[name]
    for shape in SHAPES * 2:
        context = reachable_context(random, shape, whole=True)
        found = context.least(index)
        sampled = index.sign * sampled_extreme(context, index, random)
        beyond = index.sign * (found.value - sampled)
        size = abs(sampled)
        assert beyond <= found.error + 1e-8 * size + 1e-9  # never missed
        assert beyond >= -1e-4 * size - 1e-9  # nor invented
        assert found.error <= 0.02 * size + 1e-9
        pose = np.array([found.pose])
        np.testing.assert_allclose(into(context.placed, pose), pose, atol=1e-12)
        at_pose = index_values(context.mechanism.geometry, context.mode.signs, index, pose)[0]
        assert index.sign * at_pose == pytest.approx(found.value, abs=1e-12)
        pieces = index.sign * np.array(found.pieces)
        assert pieces.min() == index.sign * found.value
        assert len(pieces) == 8


def test_extremes_over_points() -> None:
    """The least of the values at the points, without error."""
    random = np.random.default_rng(5)
    context = reachable_context(random, "sphere")
    offsets = tuple(map(tuple, random.uniform(-0.03, 0.03, (12, 3))))
    region = place(Points(offsets), context.placed.centre)
    points = np.array(offsets) + context.placed.centre
    for index in INDICES.values():
        values = index_values(context.mechanism.geometry, context.mode.signs, index, points)
        geometry, signs = context.mechanism.geometry, context.mode.signs
        (found,) = extremes_over_region(geometry, signs, region, [index], points, 0.01)
        assert found.value == index.sign * values.min()
        assert found.error <= 1e-10 * abs(found.value)
