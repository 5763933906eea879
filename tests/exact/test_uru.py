"""The 3-URU against its geometry written with vectors, closed forms and its definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit
from uru_vectors import AXES, good_poses, limbs, numbers, random_machine, random_signs

from tpm_design.errors import ParameterError
from tpm_design.mechanisms import equations, mechanism
from tpm_design.mechanisms.uru import KIND, Uru
from tpm_design.workspace.volume import workspace_volume

R1 = {"db": 0.1, "dp": 0.1, "f": 1.0, "r": 1.0, "k": 1.0}


@njit
def velocity_at(geometry, signs, motor, x, y, z):  # type: ignore[no-untyped-def]
    return equations.velocity_map(geometry, signs, motor, x, y, z)


@pytest.mark.parametrize("seed", range(6))
def test_velocity_rows(seed: int) -> None:
    """Rows v_i, w_i and b_i by cross products; det W = det V · det S with (34) as corrected."""
    random = np.random.default_rng(seed)
    machine = random_machine(random)
    octant, elbows = random_signs(random), random_signs(random)
    mode = machine.mode(octant=octant, elbows=elbows)
    gears = machine.geometry.gear
    poses = good_poses(machine, octant, 30, random)
    for pose in poses:
        parts = limbs(machine, numbers(elbows), pose)
        v_rows = np.array([part.v for part in parts])
        w_rows = np.array(
            [part.v + k * part.gamma / part.beta * part.g for part, k in zip(parts, gears, strict=True)]
        )
        det_v = np.linalg.det(v_rows)
        s = np.eye(3)
        for i in range(3):
            for j in range(3):
                across = np.cross(parts[(j + 1) % 3].v, parts[(j + 2) % 3].v)
                s[i, j] += gears[i] * parts[j].gamma * (parts[i].g @ across) / (parts[i].beta * det_v)
        joint_rows, joint_b = velocity_at(machine.geometry, mode.signs, 0.0, *pose)
        motor_rows, motor_b = velocity_at(machine.geometry, mode.signs, 1.0, *pose)
        np.testing.assert_allclose(joint_rows, v_rows, atol=1e-12)
        np.testing.assert_allclose(motor_rows, w_rows, atol=1e-11)
        np.testing.assert_allclose(joint_b, [part.gamma for part in parts], atol=1e-12)
        np.testing.assert_allclose(motor_b, np.multiply(joint_b, gears), atol=1e-12)
        assert np.linalg.det(motor_rows) == pytest.approx(det_v * np.linalg.det(s), rel=1e-9, abs=1e-11)
        for part in parts:
            assert part.gamma == pytest.approx(np.linalg.norm(part.c - part.a) * math.sin(part.third))
    assert len(poses) == 30


@pytest.mark.parametrize("seed", range(4))
def test_translation_singularity_polynomial(seed: int) -> None:
    """r_1 r_2 r_3 det V is the left-hand side of (25)."""
    random = np.random.default_rng(100 + seed)
    machine = random_machine(random)
    octant, elbows = random_signs(random), random_signs(random)
    mode = machine.mode(octant=octant, elbows=elbows)
    g = machine.geometry
    poses = good_poses(machine, octant, 40, random)
    second = machine.ik(poses, mode, drive="joint")
    x, y, z = poses.T
    m = 1.0 / np.sqrt([y**2 + z**2, z**2 + x**2, x**2 + y**2])
    n1, n2, n3 = 1.0 - np.array(g.proximal)[:, None] * m * np.sin(second.T)
    offsets = np.subtract(g.platform, g.base)[:, None]
    q1, q2, q3 = offsets - np.array(g.proximal)[:, None] * np.cos(second.T)
    polynomial = (
        x * y * z * (1 - n2 * n3 - n1 * n2 - n1 * n3 + 2 * n1 * n2 * n3)
        + x * y * q3 * (1 - n1 * n2)
        + x * z * q2 * (1 - n1 * n3)
        + y * z * q1 * (1 - n2 * n3)
        + x * q2 * q3
        + y * q1 * q3
        + z * q1 * q2
        + q1 * q2 * q3
    )
    expected = np.prod(g.distal) * machine.margins(poses, mode)["translation"]
    np.testing.assert_allclose(polynomial, expected, atol=1e-12)
    assert len(poses) == 40


@pytest.mark.parametrize("drive", ["motor", "joint"])
@pytest.mark.parametrize("seed", range(8))
def test_jacobian_is_the_derivative_of_the_inverse_map(seed: int, drive: str) -> None:
    """Central differences of ik at h and h/2: their error falls fourfold, to J⁻¹."""
    random = np.random.default_rng(200 + seed)
    machine = random_machine(random)
    octant = random_signs(random)
    mode = machine.mode(octant=octant, elbows=random_signs(random))
    poses = good_poses(machine, octant, 20, random)
    assert len(poses) == 20

    def difference(h: float) -> np.ndarray:
        columns = [
            (
                machine.ik(poses + h * axis, mode, drive=drive)
                - machine.ik(poses - h * axis, mode, drive=drive)
            )
            / (2.0 * h)
            for axis in AXES
        ]
        return np.stack(columns, axis=2)

    inverse = np.linalg.inv(machine.jacobian(poses, mode, drive=drive))
    errors = [np.abs(difference(h) - inverse).max() for h in (2e-3, 1e-3)]
    assert errors[1] < 1e-2 * np.abs(inverse).max()
    assert 3.7 < errors[0] / errors[1] < 4.4


def test_joint_centres_close_the_limbs() -> None:
    random = np.random.default_rng(300)
    machine = random_machine(random)
    mode = machine.mode(octant="+-+", elbows="-+-")
    for pose in good_poses(machine, "+-+", 10, random):
        centres = machine.joint_centres(pose, mode)
        parts = limbs(machine, (-1.0, 1.0, -1.0), pose)
        expected = [[part.a, part.c, part.b] for part in parts]
        np.testing.assert_allclose(centres, expected, atol=1e-12)


def test_reachable_workspace_is_a_ball() -> None:
    """d_b = d_p, f = r = R: the ball of radius 2R (Fig. 7)."""
    machine = mechanism("uru", **R1)
    mode = machine.mode(octant="any", elbows="+++")
    assert workspace_volume(machine, mode, "reachable").value == pytest.approx(32 * math.pi / 3, rel=1e-3)


@pytest.mark.parametrize("octant", ["+++", "+-+", "---", "-++"])
@pytest.mark.parametrize(("gear", "opposite"), [(1.0, False), (1.0, True), (-1.0, False)])
def test_octant_of_the_ball_is_free_of_singularities(octant: str, gear: float, opposite: bool) -> None:
    """k = 1 and elbows s_i = σ sign(p_i); inversion makes that k = −1 as well."""
    machine = mechanism("uru", **(R1 | {"k": gear}))
    elbows = octant.translate(str.maketrans("+-", "-+")) if opposite else octant
    mode = machine.mode(octant=octant, elbows=elbows)
    assert workspace_volume(machine, mode).value == pytest.approx(4 * math.pi / 3, rel=1e-3)


@pytest.mark.parametrize(("gear", "elbows"), [(0.9, "+++"), (0.5, "+++"), (-0.5, "+++"), (1.0, "++-")])
def test_other_gears_and_elbows_have_actuation_singularities(gear: float, elbows: str) -> None:
    machine = mechanism("uru", **(R1 | {"k": gear}))
    mode = machine.mode(octant="+++", elbows=elbows)
    random = np.random.default_rng(400)
    poses = 10.0 ** random.uniform(-4.0, 0.3, (20_000, 3))  # they are near the axes
    actuation = machine.margins(poses, mode)["actuation"]
    assert np.nanmin(actuation) < -1e-3
    assert np.nanmax(actuation) > 1e-3


@pytest.mark.parametrize("joint", range(4))
def test_joint_limits(joint: int) -> None:
    """A pose is in the workspace exactly where the angle of each limb is in its range modulo 2π."""
    random = np.random.default_rng(500 + joint)
    octant, elbows = random_signs(random), random_signs(random)
    free = random_machine(random)
    mode = free.mode(octant=octant, elbows=elbows)
    poses = good_poses(free, octant, 400, random)
    angles = []
    for pose in poses:
        x, y, z = pose
        first = (math.atan2(y, -z), math.atan2(-x, -z), math.atan2(x, -y))
        parts = limbs(free, numbers(elbows), pose)
        all_angles = (first, *zip(*((p.second, p.third, -p.second - p.third) for p in parts), strict=True))
        angles.append(all_angles[joint])
    # the first pose inside with room for about half of the others
    low = np.min(angles[0]) - 0.5
    width = np.max(angles[0]) + 0.5 - low
    expected = (np.mod(np.array(angles) - low, 2 * math.pi) <= width).all(axis=1)
    machine = KIND.build(free.parameters, {f"theta{joint + 1}": (low, low + width)})
    reach = machine.margins(poses, mode)["reach"]
    np.testing.assert_array_equal(reach >= 0.0, expected)
    np.testing.assert_array_equal(np.isfinite(machine.ik(poses, mode)).all(axis=1), expected)
    assert 0 < expected.sum() < len(expected)


def test_undefined_and_unreachable_poses() -> None:
    machine = mechanism("uru", db=0.3, dp=0.1, f=0.6, r=0.5, k=1.0)
    mode = machine.mode(octant="+++", elbows="+++")
    poses = {
        "inside": (0.5, 0.6, 0.4),
        "unreachable": (2.0, 2.0, 2.0),
        "other octant": (-0.5, 0.6, 0.4),
        "on a plane": (0.0, 0.6, 0.4),
        "on an axis": (0.0, 0.0, 0.7),
        "at the origin": (0.0, 0.0, 0.0),
    }
    index = {name: n for n, name in enumerate(poses)}
    points = list(poses.values())
    margins = machine.margins(points, mode)
    for drive in ("motor", "joint"):
        finite = np.isfinite(machine.ik(points, mode, drive=drive)).all(axis=1)
        assert finite.tolist() == [name == "inside" for name in poses]
        regular = np.isfinite(machine.jacobian(points, mode, drive=drive)).all(axis=(1, 2))
        assert regular.tolist() == finite.tolist()
    for name in ("unreachable", "other octant"):
        assert margins["reach"][index[name]] < 0.0
        assert np.isnan([margins[key][index[name]] for key in ("serial", *KIND.determinants)]).all()
    for name in ("on a plane", "on an axis"):
        assert margins["rotation"][index[name]] == 0.0
    assert not any(np.isnan(values[index["inside"]]) for values in margins.values())


def test_centre_of_the_folded_limbs_is_undefined() -> None:
    """ρ_i = 0 with f_i = r_i: the elbow's direction is free."""
    machine = mechanism("uru", db=0.2, dp=0.0, f=0.5, r=0.5, k=1.0)
    mode = machine.mode(octant="any", elbows="+++")
    point = [(0.2, 0.0, 0.0)]
    assert np.isnan(machine.ik(point, mode)).all()
    margins = machine.margins(point, mode)
    assert [margins[key][0] for key in KIND.determinants] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"f": 0.0}, "not positive"),
        ({"r": (0.5, -0.5, 0.5)}, "not positive"),
        ({"db": -0.1}, "not non-negative"),
        ({"k": 0.0}, "not non-zero"),
        ({"f": math.nan}, "not a finite number"),
        ({"f": "long"}, "'f'|finite number|values"),
        ({"f": (0.5, 0.6)}, "2 values for 3 limbs"),
        ({"f2": 0.6}, "both given"),
        ({"g": 0.6}, "no parameter 'g'"),
    ],
)
def test_impossible_parameters(change: dict[str, float], told: str) -> None:
    with pytest.raises(ParameterError, match=told):
        mechanism("uru", **(R1 | change))


def test_missing_parameters() -> None:
    with pytest.raises(ParameterError, match="no value for 'k'"):
        mechanism("uru", db=0.1, dp=0.1, f=0.5, r=0.5)
    with pytest.raises(ParameterError, match="no value for 'f3'"):
        mechanism("uru", db=0.1, dp=0.1, f1=0.5, f2=0.5, r=0.5, k=1.0)


@pytest.mark.parametrize("signs", [("++", "+++"), ("+++", "any"), ("+0+", "+++"), ("+++", "++++")])
def test_wrong_modes(signs: tuple[str, str]) -> None:
    machine = mechanism("uru", **R1)
    assert isinstance(machine, Uru)
    with pytest.raises(ParameterError, match="Give 3 signs"):
        machine.mode(octant=signs[0], elbows=signs[1])


@pytest.mark.parametrize(
    ("points", "told"),
    [([[1.0, 2.0]], "shape"), ([[math.nan, 0.1, 0.1]], "not finite"), ("here", "numbers"), (1.0, "shape")],
)
def test_wrong_poses(points: object, told: str) -> None:
    machine = mechanism("uru", **R1)
    mode = machine.mode_of({"octant": "+++", "elbows": "+++"})
    for function in (machine.ik, machine.jacobian, machine.margins):
        with pytest.raises(ParameterError, match=told):
            function(points, mode)


def test_wrong_drive() -> None:
    machine = mechanism("uru", **R1)
    mode = machine.mode_of({"octant": "+++", "elbows": "+++"})
    with pytest.raises(ParameterError, match="Did you mean 'motor'"):
        machine.ik([[0.3, 0.3, 0.3]], mode, drive="motors")
