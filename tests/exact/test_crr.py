"""3-CRR, 3-PRRR and 3-CRRR against truths in closed form and against the same closures written anew."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tpm_design as tpm
from tpm_design.certificates.verdict import verdict
from tpm_design.errors import ParameterError
from tpm_design.evaluation.contexts import design_context
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.fold_lines import FoldLine
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.metrics import METRICS
from tpm_design.problem import Goal, Problem
from tpm_design.workspace.fold_clearance import fold_clearance
from tpm_design.workspace.region_geometry import place, signed_distance_at
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Points, Shape, Sphere

pytestmark = pytest.mark.xdist_group("crr")

FloatArray = NDArray[np.float64]
FAMILY = ("crr", "prrr", "crrr")
SKEW = {
    "f": (0.5, 0.45, 0.4),
    "r": (0.4, 0.5, 0.45),
    "azimuth": (0.2, 1.8, 0.4),
    "elevation": (0.1, -0.3, 1.2),
    "ax": (0.05, -0.02, 0.03),
    "ay": (0.01, 0.04, -0.06),
    "az": (-0.03, 0.02, 0.05),
    "bx": (0.02, 0.0, -0.01),
    "by": (-0.04, 0.03, 0.0),
    "bz": (0.0, -0.02, 0.01),
}
OBLIQUE = {"slide_azimuth": (0.9, 1.5, -0.4), "slide_elevation": (-0.3, 0.4, 0.7)}
IDLE = {"idle_azimuth": (1.9, 0.3, 0.9), "idle_elevation": (0.5, 1.1, -0.2)}
OWN: dict[str, dict[str, tuple[float, float, float]]] = {"crr": {}, "prrr": OBLIQUE, "crrr": IDLE}


def direction(azimuth: float, elevation: float) -> FloatArray:
    flat = math.cos(elevation)
    return np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])


def directions(machine: Mechanism, prefix: str = "") -> FloatArray:
    values = machine.parameters
    pairs = zip(values[f"{prefix}azimuth"], values[f"{prefix}elevation"], strict=True)
    return np.array([direction(*pair) for pair in pairs])


def slides(machine: Mechanism) -> FloatArray:
    return directions(machine, "slide_" if machine.kind.name == "prrr" else "")


def points(machine: Mechanism, letter: str) -> FloatArray:
    """Base or platform points, by limb."""
    return np.column_stack([machine.parameters[f"{letter}{axis}"] for axis in "xyz"])


def skew_machine(name: str) -> Mechanism:
    return MECHANISMS[name].build({**SKEW, **OWN[name]}, {})


def reachable(machine: Mechanism, mode: Mode, count: int, least: float = 1e-3) -> FloatArray:
    poses = np.random.default_rng(11).uniform(-0.5, 0.5, (40 * count, 3))
    poses = poses[machine.margins(poses, mode)["reach"] > least][:count]
    assert len(poses) == count
    return poses


@pytest.mark.parametrize("name", ["crr", "crrr"])
def test_axes_at_right_angles_make_the_machine_isotropic_everywhere(name: str) -> None:
    lengths = {"f": (0.3, 0.35, 0.4), "r": (0.45, 0.3, 0.35), "ax": (0.0, 0.02, -0.04)}
    for angles in ({}, {"azimuth": (0.3, 0.3 + 0.5 * math.pi, 0.0)}):
        machine = MECHANISMS[name].build({**lengths, **angles}, {})
        mode = machine.mode_of({"elbows": "+-+"})
        jacobians = machine.jacobian(reachable(machine, mode, 100, 0.0), mode)
        values = np.linalg.svd(jacobians, compute_uv=False)
        assert np.abs(values - 1.0).max() < 1e-9


def test_prrr_is_isotropic_where_all_p_joints_make_one_angle_with_their_axes() -> None:
    angle = 0.7
    angles = {
        "slide_azimuth": (angle, 0.5 * math.pi + angle, 0.3),
        "slide_elevation": (0.0, 0.0, 0.5 * math.pi - angle),
    }
    machine = MECHANISMS["prrr"].build({"f": 0.4, "r": 0.3, **angles}, {})
    mode = machine.mode_of({"elbows": "+++"})
    values = np.linalg.svd(machine.jacobian(reachable(machine, mode, 50), mode), compute_uv=False)
    assert np.abs(values - math.cos(angle)).max() < 1e-12


def test_the_tricylinder_by_rays_by_a_grid_and_between_proved_bounds() -> None:
    radius = 0.9
    exact = 8.0 * (2.0 - math.sqrt(2.0)) * radius**3
    machine = MECHANISMS["crr"].build({"f": 0.45, "r": 0.45}, {})
    mode = machine.mode_of({"elbows": "+++"})
    by_rays = tpm.workspace_volume(machine, mode, kind="singularity_free", rtol=1e-3)
    assert abs(by_rays.value / exact - 1.0) < 1e-3
    side = (np.arange(120) + 0.5) / 120.0 * radius
    grid = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    share = (machine.margins(grid, mode)["reach"] >= 0.0).mean()
    assert abs(8.0 * radius**3 * share / exact - 1.0) < 1e-3
    proved = tpm.certified_volume(machine, mode, kind="reachable", rtol=1e-2)
    assert proved.lower < exact < proved.upper


@pytest.mark.parametrize("name", FAMILY)
@pytest.mark.parametrize("elbows", ["+++", "-+-"])
def test_limbs_close_as_planar_chains_across_their_axes(name: str, elbows: str) -> None:
    machine = skew_machine(name)
    mode = machine.mode_of({"elbows": elbows})
    axes, ways = directions(machine), slides(machine)
    base, platform = points(machine, "a"), points(machine, "b")
    for pose in reachable(machine, mode, 20):
        strokes = machine.ik([pose], mode)[0]
        chains = machine.joint_centres(pose, mode)
        angles = []
        for limb, (carriage, elbow, joint) in enumerate(chains):
            assert np.allclose(carriage, base[limb] + strokes[limb] * ways[limb], atol=1e-12)
            assert np.allclose(joint, pose + platform[limb], atol=1e-12)
            first, second = elbow - carriage, joint - elbow
            assert abs(np.linalg.norm(first) - machine.parameters["f"][limb]) < 1e-12
            assert abs(np.linalg.norm(second) - machine.parameters["r"][limb]) < 1e-12
            assert max(abs(first @ axes[limb]), abs(second @ axes[limb])) < 1e-12
            side = np.cross(joint - carriage, first) @ axes[limb]
            assert (side > 0.0) == (elbows[limb] == "+")
            angles.append(math.atan2(np.linalg.norm(np.cross(first, second)), first @ second))
        assert abs(machine.margins([pose], mode)["serial"][0] - min(map(math.sin, angles))) < 1e-9


@pytest.mark.parametrize("name", FAMILY)
def test_forward_position_is_one_linear_solve_that_all_elbows_reach(name: str) -> None:
    machine = skew_machine(name)
    axes, ways = directions(machine), slides(machine)
    base, platform = points(machine, "a"), points(machine, "b")
    mode = machine.mode_of({"elbows": "+-+"})
    for pose in reachable(machine, mode, 10):
        strokes = machine.ik([pose], mode)[0]
        sides = [
            s @ (a + q * d - b) for s, a, q, d, b in zip(axes, base, strokes, ways, platform, strict=True)
        ]
        assert np.allclose(np.linalg.solve(axes, sides), pose, atol=1e-12)
        (found,) = machine.assemblies(strokes)
        assert np.allclose(found.pose, pose, atol=1e-12)
        assert found.unique
        for value, (low, high) in zip(np.linalg.solve(axes, sides), found.box, strict=True):
            assert low - 1e-14 <= value <= high + 1e-14
        assert len(machine.fk(strokes, machine.mode_of({"elbows": "---"}))) == 1
    assert machine.fk([5.0, 5.0, 5.0]).shape == (0, 3)


@pytest.mark.parametrize("name", FAMILY)
def test_jacobian_is_that_of_differences_and_constant(name: str) -> None:
    machine = skew_machine(name)
    mode = machine.mode_of({"elbows": "+++"})
    poses = reachable(machine, mode, 10, 0.02)
    step = 0.01
    columns = [
        (machine.ik(poses + step * e, mode) - machine.ik(poses - step * e, mode)) / (2.0 * step)
        for e in np.eye(3)
    ]
    assert np.allclose(machine.jacobian(poses, mode) @ np.stack(columns, axis=-1), np.eye(3), atol=1e-10)


@pytest.mark.parametrize("name", FAMILY)
def test_no_pose_within_the_reach_margin_is_out_of_reach(name: str) -> None:
    machine = skew_machine(name)
    mode = machine.mode_of({"elbows": "+++"})
    poses = reachable(machine, mode, 300)
    margins = machine.margins(poses, mode)["reach"]
    ways = np.random.default_rng(12).normal(size=(40, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    around = poses[:, None] + 0.999999 * margins[:, None, None] * ways
    assert (machine.margins(around.reshape(-1, 3), mode)["reach"] > 0.0).all()
    if name != "prrr":
        # exact: straight away from, or towards, the axis of the nearest bound the workspace ends there
        for pose, margin in zip(poses[:40], margins, strict=False):
            ends = []
            for s, o in zip(directions(machine), points(machine, "a") - points(machine, "b"), strict=True):
                out = (pose - o) - ((pose - o) @ s) * s
                ends += [sign * out / np.linalg.norm(out) for sign in (1.0, -1.0)]
            beyond = pose + 1.000001 * margin * np.array(ends)
            assert (machine.margins(beyond, mode)["reach"] < 0.0).any()


def test_parallel_p_joints_carry_the_workspace_along() -> None:
    upright = {"slide_azimuth": 0.0, "slide_elevation": 0.5 * math.pi}
    tilted = {"azimuth": (0.0, 2.0, 4.0), "elevation": 0.6}
    lengths = {"f": 0.3, "r": 0.25}
    with pytest.raises(ParameterError, match="grows with the stroke") as refused:
        MECHANISMS["prrr"].build({**lengths, **upright, **tilted}, {})
    assert refused.value.remedy is not None
    assert "stroke" in refused.value.remedy
    short, long = (
        MECHANISMS["prrr"].build({**lengths, **upright, **tilted}, {"stroke": (0.0, end)})
        for end in (1.0, 3.0)
    )
    mode = short.mode_of({"elbows": "+++"})
    random = np.random.default_rng(13)
    poses = random.uniform([-0.5, -0.5, 0.0], [0.5, 0.5, 1.0], (2000, 3))
    inside = poses[~np.isnan(short.ik(poses, mode)).any(axis=1)]
    assert len(inside) > 50
    # whatever is reached is reached anywhere above, as far as the strokes go
    for shift in (0.7, 1.6, 2.0):
        moved = inside + np.array([0.0, 0.0, shift])
        assert np.allclose(long.ik(moved, mode), short.ik(inside, mode) + shift, atol=1e-12)
    assert short.reach_radius() < long.reach_radius() < short.reach_radius() + 2.0 + 1e-12


def test_crrr_rotation_margin_is_the_determinant_of_the_normals() -> None:
    machine = skew_machine("crrr")
    mode = machine.mode_of({"elbows": "+++"})
    normals = np.cross(directions(machine), directions(machine, "idle_"))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = machine.margins(reachable(machine, mode, 5), mode)
    assert np.allclose(found["rotation"], np.linalg.det(normals), atol=1e-12)
    assert np.allclose(found["actuation"], np.linalg.det(directions(machine)), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "angles", "why"),
    [
        ("crr", {"azimuth": (0.0, 2.0, 4.0), "elevation": 0.0}, "cannot all be actuated at once"),
        ("prrr", {"azimuth": (0.0, 0.0, 1.0), "elevation": (0.3, 0.3, 1.0)}, "section 5.3"),
        ("crrr", {"elevation": (0.0, 0.0, 0.0)}, "section 5.3"),
        ("prrr", {"slide_azimuth": (0.5 * math.pi, 0.5 * math.pi, 0.0)}, "limb 1 is perpendicular"),
        ("crrr", {"idle_azimuth": 0.5 * math.pi, "idle_elevation": 0.0}, "limb 2 is parallel"),
        (
            "crrr",
            {"idle_azimuth": 0.0, "idle_elevation": (0.5 * math.pi, 0.5 * math.pi, 0.0)},
            "rotation singularity",
        ),
    ],
)
def test_what_cannot_work_is_refused_with_the_reason(name: str, angles: dict[str, Any], why: str) -> None:
    with pytest.raises(ParameterError, match=why):
        MECHANISMS[name].build({"f": 0.2, "r": 0.2, **angles}, {})


def test_limits_bound_strokes_and_the_angle_between_the_links() -> None:
    limits = {"stroke": (-0.3, 0.4), "elbow": (math.radians(25.0), math.radians(150.0))}
    machine = MECHANISMS["prrr"].build({**SKEW, **OBLIQUE}, limits)
    free = skew_machine("prrr")
    mode = machine.mode_of({"elbows": "+++"})
    poses = np.random.default_rng(14).uniform(-0.6, 0.6, (400, 3))
    poses = poses[~np.isnan(free.ik(poses, mode)).any(axis=1)]
    within = []
    for pose, strokes in zip(poses, free.ik(poses, mode), strict=True):
        angles = [
            math.acos((c - e) @ (p - e) / np.linalg.norm(c - e) / np.linalg.norm(p - e))
            for c, e, p in free.joint_centres(pose, mode)
        ]
        low, high = limits["elbow"]
        within.append(min(angles) > low and max(angles) < high and min(strokes) > -0.3 and max(strokes) < 0.4)
    assert 10 < sum(within) < len(poses) - 10
    assert (~np.isnan(machine.ik(poses, mode)).any(axis=1) == within).all()
    with pytest.raises(ParameterError, match="elbow"):
        MECHANISMS["crr"].build({"f": 0.2, "r": 0.2}, {"elbow": (-0.1, 1.0)})


# ------------------------------------------------------------------------------------------ the fold


SHAPES: tuple[Shape, ...] = (
    Box((0.3, 0.2, 0.4)),
    Cylinder(0.15, 0.5),
    Sphere(0.2),
    Ellipsoid((0.1, 0.2, 0.3)),
    Points(((0.1, 0.0, 0.0), (0.0, 0.2, -0.1))),
)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_a_fold_line_is_as_far_or_as_deep_as_its_worst_point(shape: Shape) -> None:
    random = np.random.default_rng(15)
    region = place(shape, (0.02, -0.01, 0.03))
    for spread in (0.05, 0.1, 0.6, 0.8):
        way = random.normal(size=3)
        way /= np.linalg.norm(way)
        start = random.uniform(-spread, spread, 3)
        line = FoldLine(tuple(start.tolist()), tuple(way.tolist()), 0.01)
        found = fold_clearance(region, line)
        along = np.linspace(-2.0, 2.0, 8001)
        searched = min(signed_distance_at(region, tuple(start + t * way)) for t in along) - 0.01
        assert found.value <= searched + 1e-12
        assert found.value > searched - 1e-3
        assert signed_distance_at(region, found.pose) <= 1e-12


EDGE = 0.3
COVERAGE = Goal(METRICS["coverage"], "coverage", {}, minimum=1.0)
BOUNDARY = Goal(METRICS["boundary_distance"], "boundary", {}, minimum=0.0)


def cube_problem(limits: dict[str, Any]) -> Problem:
    return Problem(
        MECHANISMS["crr"], {}, (), {"+++": {"elbows": "+++"}}, limits, Box((EDGE, EDGE, EDGE)),
        (), (COVERAGE, BOUNDARY), (),
    )  # fmt: skip


def cube_design(f: float, r: float, aside: float) -> dict[str, float | str]:
    """Each axis passes the cube's centre at a distance of ``aside``."""
    offsets = {"ax": (0.0, 0.0, aside), "ay": (aside, 0.0, 0.0), "az": (0.0, aside, 0.0)}
    limbs = {f"{name}{i + 1}": v for name, values in offsets.items() for i, v in enumerate(values)}
    return {"f": f, "r": r, **limbs, "center_x": 0.0, "center_y": 0.0, "center_z": 0.0, "mode": "+++"}


@pytest.mark.parametrize(("f", "r"), [(0.3, 0.3), (0.32, 0.28)])
@pytest.mark.parametrize("aside", [0.0, 0.05, 0.149, 0.2])
def test_reach_falls_short_by_the_depth_of_the_fold(f: float, r: float, aside: float) -> None:
    context = design_context(cube_problem({}), cube_design(f, r, aside))
    stretched = f + r - math.hypot(0.5 * EDGE, 0.5 * EDGE + aside)
    folded = aside - 0.5 * EDGE - abs(f - r)
    assert abs(context.reach.value - min(stretched, folded)) < 1e-9
    result = evaluate(cube_problem({}), cube_design(f, r, aside))
    assert (result.status == "feasible") == (min(stretched, folded) >= 0.0)
    assert abs(result.metrics["boundary"] - min(stretched, folded)) < 1e-9


def test_the_fold_ignored_is_no_bound_but_a_hole_is() -> None:
    assert evaluate(cube_problem({"fold": False}), cube_design(0.2, 0.2, 0.0)).status == "feasible"
    assert evaluate(cube_problem({"fold": False}), cube_design(0.21, 0.2, 0.0)).status == "infeasible"


def test_certificates_know_the_fold() -> None:
    def outcome(limits: dict[str, Any], aside: float, tolerance: dict[str, float]) -> str:
        design = cube_design(0.2, 0.2, aside)
        found = verdict(cube_problem(limits), design, tolerance, boxes=20_000)
        coverage = found.requirements[0]
        if coverage.outcome == "refuted":
            assert coverage.breaking is not None
            assert coverage.breaking.pose is not None
            assert max(map(abs, coverage.breaking.pose)) <= 0.5 * EDGE
        return str(coverage.outcome)

    assert outcome({}, 0.0, {}) == "refuted"
    assert outcome({}, 0.1499, {}) == "refuted"
    assert outcome({}, 0.151, {}) == "proved"
    assert outcome({"fold": False}, 0.0, {}) == "proved"
    # limbs within a tolerance have links of different lengths, and then a hole
    assert outcome({"fold": False}, 0.0, {"f": 1e-4}) == "refuted"
    assert outcome({}, 0.151, {"f": 1e-4, "r": 1e-4, "ay": 1e-4, "bz": 1e-4}) == "proved"


def test_base_and_platform_points_are_all_that_errors_come_from() -> None:
    goal = Goal(METRICS["position_sensitivity"], "sensitivity", {"drive": "motor"})
    problem = Problem(
        MECHANISMS["crr"], {}, (), {"+++": {"elbows": "+++"}}, {}, Box((0.1, 0.1, 0.1)), (), (), (goal,)
    )
    found = evaluate(problem, cube_design(0.3, 0.3, 0.2)).metrics["sensitivity"]
    assert abs(found - math.sqrt(2.0)) < 1e-9
