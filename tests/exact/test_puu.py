"""The 3-PUU against closed forms, plain vector algebra, and the motions the paper claims."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from tpm_design.errors import ParameterError
from tpm_design.mechanisms import mechanism, mechanism_kind
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.metrics import METRICS
from tpm_design.workspace.all_round_tilt import all_round_tilt

KIND = mechanism_kind("puu")
STROKE = {"stroke": (0.020, 0.130)}
R, PLATFORM, L, OFFSET = 0.120, 0.050, 0.062, 0.0082843
HEIGHT = R - PLATFORM + OFFSET
AZIMUTHS = np.radians([210.0, 90.0, 330.0])


def machine(limits: dict[str, Any] | None = None, **changed: float) -> Mechanism:
    """The paper's, with L = 62 mm and the offset of its worked examples."""
    return KIND.build({**KIND.example, **changed}, limits or {})


PAPER = machine()
MODE = PAPER.mode_of({"carriages": "+++"})


def axis_rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)


def platform_of(alpha: float, beta: float, d: float) -> tuple[np.ndarray, np.ndarray]:
    """P and the rotation Q of a pose as the paper writes them."""
    half = 0.5 * beta
    l = -HEIGHT * math.cos(half) + math.sqrt(d**2 - (HEIGHT * math.sin(half)) ** 2)  # noqa: E741
    direction = np.array([math.sin(half) * math.cos(alpha), math.sin(half) * math.sin(alpha), math.cos(half)])
    axis = np.array([-math.sin(alpha), math.cos(alpha), 0.0])
    return np.array([0.0, 0.0, HEIGHT]) + l * direction, axis_rotation(axis, beta)


def platform_joints(point: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    own = np.column_stack([PLATFORM * np.cos(AZIMUTHS), PLATFORM * np.sin(AZIMUTHS), np.full(3, OFFSET)])
    return np.asarray(point + own @ rotation.T)


def pose_of(point: np.ndarray) -> np.ndarray:
    """(α, β, d) of a platform at P: the constraint plane is the bisector of P and P'."""
    normal = point - np.array([0.0, 0.0, HEIGHT])
    normal *= math.copysign(1.0, normal[2]) / np.linalg.norm(normal)
    return np.array([math.atan2(normal[1], normal[0]), 2.0 * math.acos(normal[2]), np.linalg.norm(point)])


def reflected(points: np.ndarray, through: np.ndarray, normal: np.ndarray) -> np.ndarray:
    return np.asarray(points - 2.0 * ((points - through) @ normal)[..., None] * normal)


def random_poses(count: int) -> np.ndarray:
    random = np.random.default_rng(7)
    return random.uniform([-math.pi, 0.05, 0.085], [math.pi, 0.9, 0.115], (count, 3))


# ------------------------------------------------------------------------------------------- position


def test_struts_close_by_the_rotation_matrix() -> None:
    poses = random_poses(50)
    positions = PAPER.ik(poses, MODE)
    assert np.isfinite(positions).all()
    rail = np.column_stack([-np.cos(AZIMUTHS), -np.sin(AZIMUTHS), np.ones(3)]) / math.sqrt(2.0)
    start = R * np.column_stack([np.cos(AZIMUTHS), np.sin(AZIMUTHS), np.zeros(3)])
    for pose, q in zip(poses, positions, strict=True):
        joints = platform_joints(*platform_of(*pose))
        sliders = start + q[:, None] * rail
        assert np.allclose(np.linalg.norm(joints - sliders, axis=1), L, rtol=1e-12)
        # the smaller root: the slider is short of the foot of the joint
        assert (((joints - sliders) * rail).sum(axis=1) > 0.0).all()
        centres = PAPER.joint_centres(pose, MODE)
        assert np.allclose(centres[:, 0], start, atol=1e-15)
        assert np.allclose(centres[:, 1], sliders, atol=1e-14)
        assert np.allclose(centres[:, 2], joints, atol=1e-14)


def test_the_larger_root_is_the_other_mode() -> None:
    other = PAPER.mode_of({"carriages": "-+-"})
    poses = random_poses(20)
    near, far = PAPER.ik(poses, MODE), PAPER.ik(poses, other)
    assert (far[:, [0, 2]] > near[:, [0, 2]]).all()
    assert np.array_equal(far[:, 1], near[:, 1])


def test_upright_margins_in_closed_form() -> None:
    # D = d − h + 2 o, σ = 1/√2
    d = np.array([0.080, 0.094, 0.110])
    poses = np.column_stack([0.0 * d, 0.0 * d, d])
    margins = PAPER.margins(poses, MODE)
    across = (d - HEIGHT + 2.0 * OFFSET) / math.sqrt(2.0)
    assert np.allclose(margins["reach"], L - across, rtol=1e-12)
    assert np.allclose(margins["serial"], np.sqrt(1.0 - (across / L) ** 2), rtol=1e-12)


def test_workspace_along_the_axis_for_three_lengths() -> None:
    # what L = 61, 62, 63 mm give beside the paper's [31, 142] mm
    for length, lowest, highest in ((0.061, 30.4, 140.5), (0.062, 32.8, 141.6), (0.063, 35.0, 142.7)):
        limited = machine(STROKE, L=length)
        d = np.linspace(1e-4, 0.2, 20001)
        inside = limited.margins(np.column_stack([0.0 * d, 0.0 * d, d]), MODE)["reach"] >= 0.0
        assert abs(1e3 * d[inside].min() - lowest) < 0.1
        assert abs(1e3 * d[inside].max() - highest) < 0.1


def test_forward_position_finds_all_that_a_search_from_everywhere_finds() -> None:
    random = np.random.default_rng(3)
    rail = np.column_stack([-np.cos(AZIMUTHS), -np.sin(AZIMUTHS), np.ones(3)]) / math.sqrt(2.0)
    start = R * np.column_stack([np.cos(AZIMUTHS), np.sin(AZIMUTHS), np.zeros(3)])
    for q in PAPER.ik(random_poses(3), MODE):

        def gaps(pose: np.ndarray, sliders: np.ndarray = start + q[:, None] * rail) -> np.ndarray:
            alpha, beta, d = pose
            if d < abs(HEIGHT * math.sin(0.5 * beta)):
                return np.full(3, 1.0)
            joints = platform_joints(*platform_of(alpha, beta, d))
            return np.asarray((np.linalg.norm(joints - sliders, axis=1) - L) / L)

        found = PAPER.fk(q)
        assert 1 <= len(found) <= 8
        points = np.array([platform_of(*pose)[0] for pose in found])
        for _ in range(150):
            guess = random.uniform([-math.pi, 0.0, 0.02], [math.pi, 2.0, 0.2])
            pose, _, ended, _ = fsolve(gaps, guess, full_output=True, xtol=1e-13)
            if ended == 1 and np.abs(gaps(pose)).max() < 1e-10 and abs(pose[1]) < 2.0:
                point = platform_of(*pose)[0]
                assert np.linalg.norm(points - point, axis=1).min() < 1e-7


def test_below_h_the_pose_meant_is_the_upper_one() -> None:
    low = 0.7 * HEIGHT
    pose = (0.4, 0.5, low)
    q = PAPER.ik([pose], MODE)[0]
    assert np.isfinite(q).all()
    point, _ = platform_of(*pose)
    assert point[2] > 0.0
    found = PAPER.fk(q, MODE)
    assert np.abs(found - pose).max(axis=1).min() < 1e-9


def test_a_third_of_a_turn_permutes_the_limbs() -> None:
    poses = random_poses(20)
    turned = poses + np.array([math.radians(120.0), 0.0, 0.0])
    # limbs 1, 2, 3 at 210°, 90°, 330°: by 120° the second goes to the first, the third to the second
    assert np.allclose(PAPER.ik(turned, MODE)[:, [0, 1, 2]], PAPER.ik(poses, MODE)[:, [1, 2, 0]], rtol=1e-10)


def test_upright_the_jacobian_does_not_exist() -> None:
    assert np.isnan(PAPER.jacobian([[0.3, 0.0, 0.094]], MODE)).all()
    assert np.isfinite(PAPER.ik([[0.3, 0.0, 0.094]], MODE)).all()


# ------------------------------------------------------------------------------------------- motions


def test_the_mirror_image_of_the_platform_never_moves() -> None:
    foot = np.array([0.0, 0.0, HEIGHT])
    still = np.column_stack(
        [PLATFORM * np.cos(AZIMUTHS), PLATFORM * np.sin(AZIMUTHS), np.full(3, R - PLATFORM)]
    )
    for pose in random_poses(50):
        point, _ = platform_of(*pose)
        normal = (point - foot) / np.linalg.norm(point - foot)
        joints = PAPER.joint_centres(pose, MODE)[:, 2]
        assert np.allclose(reflected(joints, 0.5 * (point + foot), normal), still, atol=1e-14)


def test_translation_along_the_normal_of_the_constraint_plane() -> None:
    alpha, beta, d = 0.5, 0.6, 0.094
    point, rotation = platform_of(alpha, beta, d)
    normal = point - np.array([0.0, 0.0, HEIGHT])
    normal /= np.linalg.norm(normal)
    for way in (-0.008, 0.004, 0.012):
        moved = point + way * normal
        pose = (alpha, beta, float(np.linalg.norm(moved)))
        assert np.isfinite(PAPER.ik([pose], MODE)).all()
        assert np.allclose(
            PAPER.joint_centres(pose, MODE)[:, 2], platform_joints(moved, rotation), atol=1e-14
        )


def test_rotation_about_a_fixed_axis_of_the_constraint_plane() -> None:
    point, rotation = platform_of(0.5, 0.4, 0.094)
    foot = np.array([0.0, 0.0, HEIGHT])
    normal = (point - foot) / np.linalg.norm(point - foot)
    across = np.cross(normal, [0.3, -0.5, 0.1])
    axis = across / np.linalg.norm(across)
    through = 0.5 * (point + foot) + 0.02 * np.cross(normal, axis)
    for angle in (-0.3, 0.1, 0.3):
        turn = axis_rotation(axis, angle)
        moved = through + turn @ (point - through)
        pose = pose_of(moved)
        assert np.isfinite(PAPER.ik([pose], MODE)).all()
        joints = platform_joints(moved, turn @ rotation)
        assert np.allclose(PAPER.joint_centres(pose, MODE)[:, 2], joints, atol=1e-13)


def test_rotation_about_many_centres_keeps_the_platform_on_spheres() -> None:
    random = np.random.default_rng(11)
    foot = np.array([0.0, 0.0, HEIGHT])
    for _ in range(20):
        centre = foot + random.uniform([-0.02, -0.02, 0.005], [0.02, 0.02, 0.02])
        radius = np.linalg.norm(centre - foot)
        bodies = []
        for _ in range(3):
            # whichever plane holds the centre: its pose keeps the centre's place in the platform
            tilt = random.uniform(-0.3, 0.3, 2)
            normal = np.array([*tilt, 1.0]) / math.sqrt(1.0 + tilt @ tilt)
            point = reflected(foot, centre, normal)
            assert math.isclose(np.linalg.norm(point - centre), radius, rel_tol=1e-12)
            pose = pose_of(point)
            joints = PAPER.joint_centres(pose, MODE)[:, 2]
            bodies.append(np.linalg.norm(joints - centre, axis=1))
        assert np.allclose(bodies, bodies[0], atol=1e-14)


# ------------------------------------------------------------------------------------------- singularities


def rotation_locus(mechanism: Mechanism, alpha: float, d: float) -> float:
    """β (deg) at which the constraints lose rank."""

    def margin(beta: float) -> float:
        return float(mechanism.determinants([[math.radians(alpha), math.radians(beta), d]], MODE)[1, 0])

    return float(brentq(margin, 60.0, 80.0, xtol=1e-12))


def planar_determinant(alpha: float, beta: float, offset: float) -> float:
    """det of the constraint forces as plane forces: each through D_i, where rail i meets s, along u_i × n."""
    rail = np.column_stack([-np.cos(AZIMUTHS), -np.sin(AZIMUTHS), np.ones(3)]) / math.sqrt(2.0)
    start = R * np.column_stack([np.cos(AZIMUTHS), np.sin(AZIMUTHS), np.zeros(3)])
    half = 0.5 * beta
    normal = np.array([math.sin(half) * math.cos(alpha), math.sin(half) * math.sin(alpha), math.cos(half)])
    meeting = start + ((offset - start @ normal) / (rail @ normal))[:, None] * rail
    forces = np.cross(rail, normal)
    first = np.cross(normal, [0.3, 0.2, 0.9])
    second = np.cross(normal, first)
    return float(
        np.linalg.det(np.column_stack([forces @ first, forces @ second, np.cross(meeting, forces) @ normal]))
    )


@pytest.mark.parametrize(("alpha", "size"), [(90.0, 2.0 / 3.0), (0.0, 2.0 / math.sqrt(7.0))])
def test_constraint_curve_whatever_distance_and_length(alpha: float, size: float) -> None:
    beta = 2.0 * math.atan(size)
    assert abs(rotation_locus(PAPER, alpha, 0.094) - math.degrees(beta)) < 1e-9
    for other, d in ((machine(L=0.090), 0.094), (PAPER, 0.120), (machine(o=0.0), 0.100)):
        assert abs(rotation_locus(other, alpha, d) - math.degrees(beta)) < 1e-9
    for offset in (0.080, 0.095):
        sides = [planar_determinant(math.radians(alpha), beta + step, offset) for step in (-1e-6, 1e-6)]
        assert sides[0] * sides[1] < 0.0


def test_constraint_singularity_where_the_rails_meet_in_the_plane() -> None:
    flat = machine(o=0.0)
    values = flat.determinants([[0.0, 0.0, R + PLATFORM + step] for step in (-1e-6, 0.0, 1e-6)], MODE)[1]
    assert values[0] * values[2] < 0.0
    assert abs(values[1]) < 1e-12


def test_second_kind_inside_the_workspace_that_the_paper_claims() -> None:
    poses = [[math.radians(90.0), math.radians(beta), 0.094] for beta in (54.0, 54.5)]
    before, after = PAPER.determinants(poses, MODE)[0]
    assert before * after < 0.0
    limited = machine(STROKE)
    assert (limited.margins([[math.radians(90.0), math.radians(60.0), 0.094]], MODE)["reach"] > 0.0).all()


def test_second_kind_is_where_the_assemblies_meet() -> None:
    beta = brentq(
        lambda b: PAPER.determinants([[math.radians(90.0), b, 0.094]], MODE)[0, 0],
        math.radians(54.0),
        math.radians(54.5),
    )
    q = PAPER.ik([[math.radians(90.0), beta - 2e-3, 0.094]], MODE)[0]
    found = PAPER.fk(q)
    near = found[(np.abs(found - [math.radians(90.0), beta, 0.094]) < [0.02, 0.01, 0.01]).all(axis=1)]
    assert len(near) == 2
    assert (near[0][1] - beta) * (near[1][1] - beta) < 0.0


def test_branch_singularity_is_on_the_locus_of_rotation() -> None:
    flat = machine(o=0.0)
    # rail 2 in s: n square to it, 90° of tilt of the platform towards α = 90°, and its point a in s
    length = 2.0 * PLATFORM * math.cos(math.radians(45.0))
    point = np.array([0.0, 0.0, R - PLATFORM]) + length * np.array([0.0, 1.0, 1.0]) / math.sqrt(2.0)
    in_plane = [math.radians(90.0), math.radians(90.0), float(np.linalg.norm(point))]
    # rail 2 square to s: n along it, the same tilt the other way; its constraint is not defined
    square = [math.radians(-90.0), math.radians(90.0), 0.1]
    assert np.abs(flat.determinants([in_plane, square], MODE)[1]).max() < 1e-12


# ------------------------------------------------------------------------------------------- limits


def test_swing_of_the_upright_pose_in_closed_form() -> None:
    d = 0.094
    apart = d - HEIGHT + 2.0 * OFFSET
    e = math.sqrt(L**2 - 0.5 * apart**2) - apart / math.sqrt(2.0)
    # the strut is D n + e u; the axes are u and 2 σ n − u
    slider = math.acos((apart / math.sqrt(2.0) + e) / L)
    platform = math.acos(apart / math.sqrt(2.0) / L)
    assert platform > slider
    for swing, inside in ((platform + 1e-6, True), (platform - 1e-6, False)):
        reach = machine({"swing": swing}).margins([[0.0, 0.0, d]], MODE)["reach"][0]
        assert (reach >= 0.0) == inside


def test_all_round_tilt_against_a_scan() -> None:
    limited = machine(STROKE)
    found = all_round_tilt(limited, MODE, 0.094)
    assert found.limit == "actuation singularity"
    assert abs(math.degrees(found.tilt) - 54.286) < 1e-3
    beta = np.radians(np.arange(0.05, 100.0, 0.05))
    firsts, reaches = [], []
    for alpha in np.radians(np.arange(0.0, 360.0, 3.0)):
        margins = limited.margins(np.column_stack([0.0 * beta + alpha, beta, 0.0 * beta + 0.094]), MODE)
        inside = margins["reach"] >= 0.0
        # the signs of the upright pose
        same = inside & (margins["actuation"] < 0.0) & (margins["rotation"] > 0.0)
        firsts.append(beta[np.argmin(same)])
        reaches.append(math.pi if inside.all() else beta[np.argmin(inside)])
    assert 0.0 <= min(firsts) - found.tilt < math.radians(0.051)
    # strokes alone: 73 to 76° for L = 61 to 63 mm
    assert 73.0 < math.degrees(min(reaches)) < 76.0


def test_constraint_curve_stops_a_machine_that_the_second_kind_does_not() -> None:
    found = all_round_tilt(machine(L=0.095, o=0.0), MODE, 0.120)
    assert found.limit == "rotation singularity"
    assert abs(math.degrees(found.tilt) - 67.380) < 1e-3


# ------------------------------------------------------------------------------------------- refusals


def test_condition_numbers_need_a_characteristic_length() -> None:
    refusal = METRICS["conditioning_min"].refusal
    assert "characteristic_length" in (refusal(KIND, {}) or "")
    assert refusal(KIND, {"characteristic_length": 0.05}) is None
    assert METRICS["position_sensitivity"].refusal(KIND, {}) is not None


def test_dimensions_that_cannot_be_are_refused() -> None:
    for theta in (math.radians(90.0), math.radians(120.0)):
        with pytest.raises(ParameterError, match="theta"):
            mechanism("puu", **{**KIND.example, "theta": theta})
    with pytest.raises(ParameterError, match="alike"):
        PAPER.enclosed_geometry({"L": 1e-4})
