"""No pose contradicts what is said of its box: proved constraints, refuted boxes, linear forms, shares."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from box_forms_kernel import forms_of, share_at, values_at
from numpy.typing import NDArray

from tpm_design.mechanisms.uru import build
from tpm_design.workspace.box_verdicts import REFUTED
from tpm_design.workspace.paving import PavedSet, Paving, halves, largest

ROUNDING = 1e-9


def random_design(random: np.random.Generator) -> dict[str, Any]:
    return {
        "db": tuple(random.uniform(0.0, 0.4, 3)),
        "dp": tuple(random.uniform(0.0, 0.3, 3)),
        "f": tuple(random.uniform(0.4, 1.0, 3)),
        "r": tuple(random.uniform(0.4, 1.0, 3)),
        "k": tuple(random.uniform(0.4, 2.0, 3) * random.choice([-1.0, 1.0], 3)),
    }


def random_limits(random: np.random.Generator) -> dict[str, Any]:
    joints = random.choice([1, 2, 3, 4], random.integers(0, 3), replace=False)
    starts = random.uniform(-math.pi, 0.0, len(joints))
    return {f"theta{j}": (s, s + random.uniform(1.5, 4.0)) for j, s in zip(joints, starts, strict=True)}


def random_signs(random: np.random.Generator) -> str:
    return "".join(random.choice(["+", "-"], 3))


def random_set(random: np.random.Generator) -> PavedSet:
    mechanism = build(random_design(random), random_limits(random) if random.random() < 0.4 else {})
    octant = "any" if random.random() < 0.2 else random_signs(random)
    mode = mechanism.mode(octant=octant, elbows=random_signs(random))
    signs = tuple(random.choice([-1.0, 1.0], 3)) if random.random() < 0.8 else ()
    return PavedSet(mechanism, mode, signs, float(random.choice([0.0, 0.02, 0.2])))


def poses_in(
    charts: NDArray[np.int64], boxes: NDArray[np.float64], each: int, random: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Poses (N · each, 3) of the boxes and their coordinates (N · each, 3) between −1 and 1: all over the
    boxes, some in their faces."""
    places = np.clip(random.uniform(-1.1, 1.1, (len(boxes) * each, 3)), -1.0, 1.0)
    wide, chart = np.repeat(boxes, each, axis=0), np.repeat(charts, each, axis=0)
    s, u, v = (
        0.5 * (wide[:, 2 * j] + wide[:, 2 * j + 1])
        + 0.5 * (wide[:, 2 * j + 1] - wide[:, 2 * j]) * places[:, j]
        for j in range(3)
    )
    t = np.cbrt(3.0 * s)
    along = np.stack([t, t * u, t * v], axis=1)
    axis = (chart[:, :1] + np.arange(3)) % 3
    poses = np.empty_like(along)
    np.put_along_axis(poses, axis, along, axis=1)
    return poses * chart[:, 1:], places


def contradictions(target: PavedSet, wanted_boxes: int, each: int, random: np.random.Generator) -> int:
    """Judge boxes of all sizes that a paving comes by, and random ones; returns how many poses were tried."""
    paving = Paving(target)
    seen = []
    while paving.boxes < wanted_boxes and paving.refine(0.0, 10**6):
        seen.append(paving.leaves)
    leaves = halves(paving.leaves)
    for earlier in seen[::3]:
        leaves = leaves.and_also(earlier)
    extent = paving.extent
    count = 500
    spans = np.sort(random.uniform(0.0, 1.0, (count, 3, 2)), axis=2)
    spans[:, :, 1] = (
        spans[:, :, 0] + (spans[:, :, 1] - spans[:, :, 0]) * random.uniform(0.0, 1.0, (count, 1)) ** 3
    )
    spans = np.round(spans * 2**20) / 2**20 + np.array([0.0, 2.0**-20])
    spans[:, 0] *= extent
    charts = paving.roots[random.integers(0, len(paving.roots), count)]
    boxes = np.concatenate([leaves.boxes, spans.reshape(count, 6)])
    charts = np.concatenate([leaves.charts, charts])
    known = np.concatenate([leaves.proved, np.zeros(count, np.int64)])
    mechanism = target.mechanism
    counts = (6, 6, len(target.signs))
    signs = np.array(target.signs or [1.0])
    arguments = (target.mode.signs, counts, signs, target.margin)
    proved, forms = forms_of(mechanism.enclosed_geometry({}), *arguments, charts, boxes, known)
    poses, places = poses_in(charts, boxes, each, random)
    values = values_at(mechanism.geometry, *arguments, poses).reshape(len(boxes), each, -1)
    values[np.isnan(values)] = 0.0
    size = values.shape[2]
    bits = (proved[:, None] >> np.arange(size)) & 1 == 1
    refuted = proved == REFUTED
    assert values[refuted].min(axis=2, initial=0.0).max(initial=-1.0) <= ROUNDING
    holds = bits & ~refuted[:, None]
    assert values.min(axis=1)[holds].min(initial=1.0) >= -ROUNDING
    still = ~bits & ~refuted[:, None]
    linear = forms[:, None, :size, 0] + sum(
        places.reshape(len(boxes), each, 3)[:, :, None, j] * forms[:, None, :size, 1 + j] for j in range(3)
    )
    finite = np.isfinite(forms[:, :size]).all(axis=2) & still
    excess = np.abs(values - linear) - forms[:, None, :size, 4]
    assert excess.max(axis=1)[finite].max(initial=-1.0) <= ROUNDING
    # every verdict was there
    if target.signs == () or target.margin < 0.2:
        assert refuted.any() and still.any()
    return len(poses)


@pytest.mark.parametrize("seed", range(6))
def test_no_pose_contradicts_its_box(seed: int) -> None:
    random = np.random.default_rng(seed)
    target = random_set(random)
    assert contradictions(target, 3_000, 5, random) > 2_000


@pytest.mark.parametrize("flat", [0, 1, 2, 3])
def test_share_cut_off_by_a_plane(flat: int) -> None:
    """Against counting, to four standard deviations; some slopes 0 or nearly."""
    random = np.random.default_rng(flat)
    places = random.uniform(-1.0, 1.0, (100_000, 3))
    for _ in range(30):
        slopes = random.uniform(0.0, 1.0, 3)
        slopes[random.permutation(3)[:flat]] *= random.choice([0.0, 1e-5, 1e-3])
        level = float(random.uniform(-1.0, 1.0) * slopes.sum())
        lower, upper = share_at(level, *slopes)
        share = float((level + places @ slopes < 0.0).mean())
        deviation = math.sqrt(max(share * (1.0 - share), 1e-4) / len(places))
        assert 0.0 <= lower <= upper <= 1.0
        assert lower - 4.0 * deviation <= share <= upper + 4.0 * deviation
        assert upper - lower <= 1e-3 or flat == 3


def test_shares_in_closed_form() -> None:
    """Half, a corner's sixth, a slab, nothing and everything."""
    for level, slopes, exact in (
        (0.0, (0.3, 0.2, 0.7), 0.5),
        (1.0, (0.5, 0.5, 0.5), 1.0 / 48.0),
        (-0.5, (1.0, 0.0, 0.0), 0.75),
        (2.0, (1.0, 0.5, 0.4), 0.0),
        (-2.0, (1.0, 0.5, 0.4), 1.0),
    ):
        lower, upper = share_at(level, *slopes)
        assert lower <= exact <= upper
        assert upper - lower <= 1e-10


def exact_share(level: float, slopes: NDArray[np.float64]) -> Fraction:
    """Σ ± (a − sums of the slopes)₊ⁿ over n! times their product, in fractions."""
    steep = [2 * Fraction(slope) for slope in slopes.tolist() if slope > 0.0]
    start = sum(steep) / 2 - Fraction(level)
    total = Fraction(0)
    for count in range(len(steep) + 1):
        for chosen in itertools.combinations(steep, count):
            total += (-1) ** count * max(Fraction(0), start - sum(chosen)) ** len(steep)
    return total / (math.factorial(len(steep)) * math.prod(steep))


def test_shares_hold_the_exact_one() -> None:
    """Slopes of any size and ratio, planes through corners among them."""
    random = np.random.default_rng(6)
    for _ in range(3000):
        slopes = 10.0 ** random.uniform(-9.0, 0.0, 3) * 10.0 ** random.choice(
            [0, -8, 8, -100, 120, -250, 250]
        )
        slopes[random.integers(3)] *= random.choice([0.0, 1.0])
        corner = random.random() < 0.2
        level = float((random.choice([-1.0, 1.0], 3) if corner else random.uniform(-1.0, 1.0, 3)) @ slopes)
        lower, upper = share_at(level, *slopes)
        assert lower <= exact_share(level, slopes) <= upper


def test_waves_take_the_largest_gaps() -> None:
    random = np.random.default_rng(1)
    gaps = random.uniform(0.0, 1.0, 10_000) ** 4
    gaps[::7] = 0.0
    for together, most in ((1e9, 10**6), (10.0, 10**6), (1e9, 50)):
        chosen = largest(gaps, together, most)
        assert 0 < np.count_nonzero(chosen) <= most
        assert gaps[chosen].min() >= 0.75 * gaps[~chosen].max() or np.count_nonzero(chosen) == most
        if most > len(gaps):
            assert gaps[chosen].sum() >= min(together, 0.5 * gaps.sum())
    assert not largest(np.zeros(5), 1.0, 10).any()
