"""Every metric against its definition, computed with NumPy from inverse positions, Jacobians and margins."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from designs import SHAPES, inside, reachable_context, shape_of, throughout
from scipy import ndimage
from uru_vectors import limbs

from tpm_design.mechanisms import MECHANISMS, mechanism
from tpm_design.mechanisms.mechanism import FloatArray, Mechanism, Mode
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import UNDEFINED, Measurement
from tpm_design.metrics.context import Context
from tpm_design.workspace.indices import SENSITIVITY, Index, index_values
from tpm_design.workspace.region_geometry import place
from tpm_design.workspace.regions import Points
from tpm_design.workspace.volume import workspace_volume

ROUND = list(enumerate(SHAPES))


def measured(context: Context, name: str, **options: Any) -> Measurement:
    metric = METRICS[name]
    given = {option.name: option.default for option in metric.options} | options
    return metric.compute(context, given)


def singular_values(context: Context, poses: FloatArray, drive: str) -> FloatArray:
    """(N, 3) of J, zeros where it does not exist."""
    jacobians = context.mechanism.jacobian(poses, context.mode, drive=drive)
    known = np.isfinite(jacobians).all(axis=(1, 2))
    values = np.zeros((len(poses), 3))
    values[known] = np.linalg.svd(jacobians[known], compute_uv=False)
    return values


def inverse_condition(context: Context, poses: FloatArray, drive: str, norm: str) -> FloatArray:
    values = singular_values(context, poses, drive)
    known = values[:, 2] > 0.0
    result = np.zeros(len(poses))
    if norm == "2":
        result[known] = values[known, 2] / values[known, 0]
    else:
        both = np.linalg.norm(values[known], axis=1) * np.linalg.norm(1.0 / values[known], axis=1)
        result[known] = 3.0 / both
    return result


def codes(context: Context, poses: FloatArray) -> np.ndarray:
    """0 where unreachable, else 1 + a bit for the sign of each determinant."""
    margins = context.mechanism.margins(poses, context.mode)
    bits = sum((margins[n] > 0.0) << k for k, n in enumerate(context.mechanism.kind.determinants))
    return np.where(margins["reach"] >= 0.0, 1 + bits, 0)


def partly_cut(random: np.random.Generator, name: str) -> Context:
    """A region with unreachable parts or a singularity inside."""
    while True:
        context = reachable_context(random, name)
        shape = shape_of(name, 3.0 * context.placed.half[0])
        context = replace(context, region=place(shape, context.placed.centre))
        found = codes(context, inside(context.placed, 2000, random))
        if 0.2 < np.bincount(found).max() / found.size < 0.9 and (found > 0).mean() > 0.3:
            return context


@pytest.mark.parametrize("drive", ["motor", "joint"])
@pytest.mark.parametrize("norm", ["2", "frobenius"])
@pytest.mark.parametrize(("number", "name"), ROUND)
def test_conditioning_over_a_region(number: int, name: str, norm: str, drive: str) -> None:
    """60 000 poses: mean and share within four standard deviations, no pose below the least."""
    random = np.random.default_rng(number)
    context = reachable_context(random, name, whole=True)
    values = inverse_condition(context, inside(context.placed, 60_000, random), drive, norm)
    options = {"norm": norm, "drive": drive}
    mean = measured(context, "conditioning_mean", **options)
    deviation = values.std() / math.sqrt(len(values))
    assert mean.value == pytest.approx(values.mean(), abs=4.0 * deviation + mean.error)
    assert mean.error < 2e-3
    threshold = float(np.quantile(values, 0.4))
    share = measured(context, "conditioning_share", threshold=threshold, **options)
    assert share.value == pytest.approx(0.6, abs=0.01 + share.error)
    assert share.error < 0.1
    least = measured(context, "conditioning_min", **options)
    surface = inverse_condition(context, throughout(context.placed, 20_000, random), drive, norm)
    assert least.value <= surface.min() + least.error + 1e-9
    assert least.value >= 0.97 * surface.min() - 1e-3


@pytest.mark.parametrize(("number", "name"), ROUND)
def test_averages_over_a_region_partly_out_of_reach(number: int, name: str) -> None:
    """Poses out of reach count as 0, in the mean and in the share."""
    random = np.random.default_rng(20 + number)
    context = partly_cut(random, name)
    poses = inside(context.placed, 100_000, random)
    values = inverse_condition(context, poses, "motor", "2")
    mean = measured(context, "conditioning_mean")
    assert mean.value == pytest.approx(values.mean(), abs=0.003 + 3.0 * mean.error)
    share = measured(context, "conditioning_share", threshold=0.2)
    assert share.value == pytest.approx((values >= 0.2).mean(), abs=0.01 + 3.0 * share.error)
    assert measured(context, "conditioning_min").value == 0.0


@pytest.mark.parametrize("drive", ["motor", "joint"])
def test_conditioning_over_an_aspect(drive: str) -> None:
    """R1: the octant's ball is one aspect, over which random poses average."""
    built = mechanism("uru", db=0.1, dp=0.1, f=0.5, r=0.5, k=1.0)
    mode = built.mode_of({"octant": "+++", "elbows": "+++"})
    context = Context(built, mode, None, 1e-3, 9)
    random = np.random.default_rng(30)
    poses = random.uniform(0.0, 1.0, (200_000, 3))
    poses = poses[np.linalg.norm(poses, axis=1) < 1.0]
    values = inverse_condition(context, poses, drive, "2")
    options = {"over": "aspect", "drive": drive}
    mean = measured(context, "conditioning_mean", **options)
    assert mean.value == pytest.approx(values.mean(), abs=4.0 * values.std() / 300.0 + mean.error)
    assert mean.error < 5e-3
    share = measured(context, "conditioning_share", threshold=0.3, **options)
    assert share.value == pytest.approx((values >= 0.3).mean(), abs=0.005 + share.error)
    assert measured(context, "conditioning_min", **options).value < 0.01


@pytest.mark.parametrize(("drive", "name"), [("motor", "actuation"), ("joint", "translation")])
def test_no_conditioning_where_control_is_lost(drive: str, name: str) -> None:
    """The determinant changes sign inside the region: least 1/κ is 0, the greatest speed unbounded."""
    random = np.random.default_rng(40)
    part = ("translation", "actuation").index(name)
    while True:
        context = reachable_context(random, "sphere")
        if context.sides[part].margin < -0.01:
            break
    for norm in ("2", "frobenius"):
        found = measured(context, "conditioning_min", norm=norm, drive=drive)
        assert found.value == 0.0
        assert found.depth < 0.0
    for metric in ("velocity_max", "position_sensitivity"):
        found = measured(context, metric, drive=drive)
        assert math.isnan(found.value)
        assert found.notes[UNDEFINED]


@pytest.mark.parametrize("drive", ["motor", "joint"])
@pytest.mark.parametrize(("number", "name"), ROUND)
def test_velocities(number: int, name: str, drive: str) -> None:
    random = np.random.default_rng(50 + number)
    context = reachable_context(random, name, whole=True)
    values = singular_values(context, throughout(context.placed, 30_000, random), drive)
    slowest = measured(context, "velocity_min", drive=drive)
    fastest = measured(context, "velocity_max", drive=drive)
    assert slowest.value <= values[:, 2].min() + slowest.error + 1e-12
    assert slowest.value == pytest.approx(values[:, 2].min(), rel=0.02)
    assert fastest.value >= values[:, 0].max() - fastest.error - 1e-12
    assert fastest.value == pytest.approx(values[:, 0].max(), rel=0.02)


@pytest.mark.parametrize(("number", "name"), ROUND)
def test_transmission(number: int, name: str) -> None:
    """Rows of J⁻¹ made unit are the v_i: least of |sin θ_i3| and |det|/|v_j × v_k|."""
    random = np.random.default_rng(60 + number)
    context = reachable_context(random, name, whole=True)
    poses = throughout(context.placed, 20_000, random)
    rows = np.linalg.inv(context.mechanism.jacobian(poses, context.mode, drive="joint"))
    rows /= np.linalg.norm(rows, axis=2, keepdims=True)
    determinant = np.abs(np.linalg.det(rows))
    output = [
        determinant / np.linalg.norm(np.cross(rows[:, i - 1], rows[:, i - 2]), axis=1) for i in range(3)
    ]
    indices = np.minimum(context.mechanism.margins(poses, context.mode)["serial"], np.min(output, axis=0))
    found = measured(context, "transmission_min")
    assert found.value <= indices.min() + found.error + 1e-12
    assert found.value == pytest.approx(indices.min(), rel=0.02, abs=1e-3)
    pose = poses[0]
    knees = [abs(math.sin(limb.third)) for limb in limbs(context.mechanism, context.mode.signs.elbows, pose)]  # type: ignore[arg-type]
    assert context.mechanism.margins(pose, context.mode)["serial"][0] == pytest.approx(min(knees))


def locked_pose(built: Mechanism, mode: Mode, drive: str, q: FloatArray, pose: FloatArray) -> FloatArray:
    """Newton's method on the inverse map with the actuators held at ``q``."""
    for _ in range(8):
        jacobian = built.jacobian(pose, mode, drive=drive)[0]
        pose = pose + jacobian @ (q - built.ik(pose, mode, drive=drive)[0])
    return pose


@pytest.mark.parametrize("drive", ["motor", "joint"])
@pytest.mark.parametrize("seed", range(3))
def test_sensitivity_to_twelve_lengths(seed: int, drive: str) -> None:
    """d_b, d_p, f, r of each limb changed one at a time, the pose solved again: 3 × 12 spectral norm."""
    random = np.random.default_rng(70 + seed)
    context = reachable_context(random, SHAPES[seed], whole=True)
    built, mode = context.mechanism, context.mode
    poses = inside(context.placed, 4, random)
    index = Index(SENSITIVITY, motor=built.motor_weight(drive))
    found = index_values(built.geometry, mode.signs, index, poses)
    h = 1e-6
    for pose, value in zip(poses, found, strict=True):
        q = built.ik(pose, mode, drive=drive)[0]
        columns = []
        for name, limb in itertools.product(("db", "dp", "f", "r"), range(3)):
            ends = []
            for sign in (-1.0, 1.0):
                lengths = {key: list(numbers) for key, numbers in built.parameters.items()}
                lengths[name][limb] += sign * h
                ends.append(locked_pose(mechanism("uru", **lengths), mode, drive, q, pose))
            columns.append((ends[1] - ends[0]) / (2.0 * h))
        assert value == pytest.approx(np.linalg.norm(np.array(columns).T, 2), rel=1e-6)
    worst = measured(context, "position_sensitivity", drive=drive)
    sampled = index_values(
        built.geometry, mode.signs, index, throughout(context.placed, 20_000, random)
    ).max()
    assert worst.value >= sampled - worst.error - 1e-9
    assert worst.value == pytest.approx(sampled, rel=0.02)


@pytest.mark.parametrize("drive", ["motor", "joint"])
@pytest.mark.parametrize(("number", "name"), ROUND)
def test_actuator_range(number: int, name: str, drive: str) -> None:
    random = np.random.default_rng(80 + number)
    context = reachable_context(random, name)
    q = context.mechanism.ik(throughout(context.placed, 40_000, random), context.mode, drive=drive)
    travels = np.ptp(q, axis=0)
    found = measured(context, "actuator_range", drive=drive)
    assert found.value >= travels.max() - found.error - 1e-12
    assert found.value == pytest.approx(travels.max(), rel=0.02)


@pytest.mark.parametrize(("number", "name"), ROUND)
def test_robot_size_and_link_length(number: int, name: str) -> None:
    random = np.random.default_rng(90 + number)
    context = reachable_context(random, name)
    centres = np.array(
        [
            context.mechanism.joint_centres(pose, context.mode)
            for pose in throughout(context.placed, 4000, random)
        ]
    )
    box = np.ptp(centres.reshape(-1, 3), axis=0)
    found = measured(context, "robot_size")
    assert found.value >= box.max() - found.error - 1e-12
    assert found.value == pytest.approx(box.max(), rel=0.02)
    links = np.linalg.norm(np.diff(centres[0], axis=1), axis=2)
    assert measured(context, "total_link_length").value == pytest.approx(links.sum())


def test_robot_size_over_an_aspect() -> None:
    """R1 with d_b = d_p = 0.1, R = 0.5: the platform joints stay within 1.1 of the base on each axis."""
    built = mechanism("uru", db=0.1, dp=0.1, f=0.5, r=0.5, k=1.0)
    mode = built.mode_of({"octant": "+++", "elbows": "+++"})
    context = Context(built, mode, None, 1e-3, 9)
    random = np.random.default_rng(95)
    poses = random.uniform(0.0, 1.0, (6000, 3))
    poses = poses[np.linalg.norm(poses, axis=1) < 1.0]
    centres = np.array([built.joint_centres(pose, mode) for pose in poses])
    box = float(np.ptp(centres.reshape(-1, 3), axis=0).max())
    found = measured(context, "robot_size", over="aspect")
    assert found.value == pytest.approx(box, rel=0.03)
    assert found.error < 0.02 * found.value


def segment_gap(a: FloatArray, b: FloatArray) -> float:
    """Distance between segments (2, 3) by 101 × 101 points, refined twice."""
    s, t, width = 0.5, 0.5, 0.5
    least = math.inf
    for _ in range(3):
        u = np.clip(np.linspace(s - width, s + width, 101), 0.0, 1.0)
        v = np.clip(np.linspace(t - width, t + width, 101), 0.0, 1.0)
        p = a[0] + u[:, None] * (a[1] - a[0])
        q = b[0] + v[:, None] * (b[1] - b[0])
        gaps = np.linalg.norm(p[:, None] - q[None], axis=2)
        i, j = np.unravel_index(gaps.argmin(), gaps.shape)
        least, s, t, width = float(gaps[i, j]), float(u[i]), float(v[j]), width / 20.0
    return least


def test_link_clearance() -> None:
    """Links as segments less twice their radius, over poses of the region."""
    random = np.random.default_rng(100)
    for name in SHAPES[:3]:
        context = reachable_context(random, name)
        built = context.mechanism
        built = replace(built, geometry=built.geometry._replace(link_radius=0.012))
        context = Context(built, context.mode, context.placed, 1e-3, 9)
        found = measured(context, "link_clearance")
        least = math.inf
        for pose in throughout(context.placed, 12, random):
            chains = built.joint_centres(pose, context.mode)
            for one, other in itertools.combinations(range(3), 2):
                for m, n in itertools.product(range(2), repeat=2):
                    gap = segment_gap(chains[one][m : m + 2], chains[other][n : n + 2])
                    least = min(least, gap - 0.024)
        assert found.value <= least + found.error + 1e-4
        assert found.value >= -0.024
        assert found.value >= least - 2.0 * max(context.placed.half)


def test_boundary_distance_of_a_ball() -> None:
    """To spheres of radius f_i + r_i and |f_i − r_i| about −δ_i e_i, from a ball of radius s."""
    random = np.random.default_rng(110)
    for _ in range(8):
        context = reachable_context(random, "sphere")
        g, radius = context.mechanism.geometry, context.placed.half[0]
        room = []
        for i in range(3):
            centre = (g.base[i] - g.platform[i]) * np.eye(3)[i]
            rho = float(np.linalg.norm(np.array(context.placed.centre) - centre))
            room += [g.proximal[i] + g.distal[i] - rho, rho - abs(g.proximal[i] - g.distal[i])]
        found = measured(context, "boundary_distance")
        assert found.value == pytest.approx(min(room) - radius, abs=1e-9)


@pytest.mark.parametrize(("number", "name"), ROUND)
def test_singularity_margin(number: int, name: str) -> None:
    random = np.random.default_rng(120 + number)
    for whole in (True, False):
        context = reachable_context(random, name, whole=whole)
        poses = throughout(context.placed, 30_000, random)
        margins = context.mechanism.margins(poses, context.mode)
        least = margins["serial"].min()
        for determinant in context.mechanism.kind.determinants:
            values = margins[determinant]
            same = values.min() > 0.0 or values.max() < 0.0
            least = min(least, np.abs(values).min()) if same else 0.0
        found = measured(context, "singularity_margin_min")
        assert found.value <= least + found.error + 1e-9
        assert found.value == pytest.approx(least, rel=0.05, abs=2e-3)


@pytest.mark.parametrize(("number", "name"), ROUND)
def test_coverage_of_a_region_partly_cut(number: int, name: str) -> None:
    """Between the largest connected set of equal signs of a lattice in the region and all of these signs."""
    random = np.random.default_rng(130 + number)
    context = partly_cut(random, name)
    lines = [np.linspace(-1.0, 1.0, 61) * 0.999999] * 3
    unit = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    grid = np.array(context.placed.centre) + unit * context.placed.half
    across = np.linalg.norm(unit[..., :2], axis=-1)
    within = {
        "box": np.ones(across.shape, bool),
        "cylinder": across <= 1.0,
    }.get(name, np.linalg.norm(unit, axis=-1) <= 1.0)
    found = np.where(within, codes(context, grid.reshape(-1, 3)).reshape(within.shape), 0)
    whole = within.sum()
    largest = max(
        np.bincount(ndimage.label(found == code)[0].ravel())[1:].max(initial=0)
        for code in range(1, found.max() + 1)
    )
    coverage = measured(context, "coverage")
    allowed = 0.015 + 3.0 * coverage.error
    assert coverage.value >= largest / whole - allowed
    assert coverage.value <= np.bincount(found.ravel())[1:].max() / whole + allowed
    assert coverage.value < 1.0
    assert min(coverage.full_slacks) < 0.0


@pytest.mark.parametrize(("number", "name"), ROUND)
def test_full_coverage(number: int, name: str) -> None:
    """Exactly 1; the slack is the least signed margin, reach over the reach radius."""
    random = np.random.default_rng(140 + number)
    context = reachable_context(random, name, whole=True)
    coverage = measured(context, "coverage")
    assert (coverage.value, coverage.error) == (1.0, 0.0)
    poses = throughout(context.placed, 30_000, random)
    margins = context.mechanism.margins(poses, context.mode)
    least = min(
        # of reach, and the octant +++
        min(margins["reach"].min(), poses.min()) / context.mechanism.reach_radius(),
        *(np.abs(margins[name]).min() for name in context.mechanism.kind.determinants),
    )
    assert min(coverage.full_slacks) == pytest.approx(least, rel=0.05, abs=1e-3)
    assert min(coverage.full_slacks) <= least + 1e-9


def test_volumes_and_ratio() -> None:
    random = np.random.default_rng(150)
    context = reachable_context(random, "box", whole=True)
    free = measured(context, "singularity_free_volume")
    expected = workspace_volume(context.mechanism, context.mode, rtol=3e-4)
    assert free.value == pytest.approx(expected.value, abs=3.0 * (free.error + expected.error))
    ratio = measured(context, "workspace_ratio")
    assert ratio.value == pytest.approx(free.value / measured(context, "robot_size").value ** 3)
    reachable = measured(context, "reachable_volume")
    assert reachable.value >= free.value
    same = workspace_volume(context.mechanism, context.mode, "reachable", rtol=3e-4)
    assert reachable.value == pytest.approx(same.value, abs=3.0 * (reachable.error + same.error))


def test_points_count_one_each() -> None:
    """Means, shares and least values over isolated poses, one of them out of reach."""
    random = np.random.default_rng(160)
    context = reachable_context(random, "sphere", whole=True)
    offsets = [tuple(offset) for offset in random.uniform(-0.02, 0.02, (9, 3))]
    shape = Points((*offsets, (5.0, 5.0, 5.0)))
    context = Context(context.mechanism, context.mode, place(shape, context.placed.centre), 1e-3, 9)
    values = inverse_condition(context, context.placed.points, "motor", "2")
    assert measured(context, "conditioning_mean").value == pytest.approx(values.mean())
    threshold = float(np.median(values))
    share = measured(context, "conditioning_share", threshold=threshold - 1e-9).value
    assert share == pytest.approx((values >= threshold - 1e-9).mean())
    assert measured(context, "coverage").value == pytest.approx(0.9, abs=1e-6)
    near = place(Points(tuple(offsets)), context.placed.centre)
    near_context = Context(context.mechanism, context.mode, near, 1e-3, 9)
    assert measured(near_context, "coverage").value == 1.0
    assert measured(near_context, "conditioning_min").value == pytest.approx(values[:9].min())


@pytest.mark.parametrize(
    "name", sorted(name for name, metric in METRICS.items() if metric.refusal(MECHANISMS["uru"], {}) is None)
)
def test_out_of_reach(name: str) -> None:
    """No metric gives a number that flatters a region out of reach, and none a silent NaN."""
    built = mechanism("uru", db=0.1, dp=0.1, f=0.5, r=0.5, k=1.0)
    mode = built.mode_of({"octant": "+++", "elbows": "+++"})
    region = place(shape_of("sphere", 0.1), (2.0, 2.0, 2.0))
    metric = METRICS[name]
    options = {"threshold": 0.5} if any(option.required for option in metric.options) else {}
    found = measured(Context(built, mode, region, 1e-3, 9), name, **options)
    if math.isnan(found.value):
        assert found.notes[UNDEFINED]
    elif metric.needs_region and metric.better == "maximize" and name != "workspace_ratio":
        assert found.value <= 0.0
