"""Forward position of the 3-URU: complete, and true to the inverse map."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from uru_vectors import Array, random_machine, random_signs

from tpm_design.errors import ParameterError
from tpm_design.mechanisms import mechanism
from tpm_design.mechanisms.uru import KIND, Uru

SIGNS = ["".join(signs) for signs in itertools.product("+-", repeat=3)]


def random_reachable(machine: Uru, count: int, random: np.random.Generator) -> Array:
    """Poses (count, 3) anywhere in the reachable workspace."""
    poses = random.uniform(-1.5, 1.5, (20_000, 3))
    mode = machine.mode(octant="any", elbows="+++")
    return poses[machine.margins(poses, mode)["reach"] > 1e-3][:count]


@pytest.mark.parametrize("drive", ["motor", "joint"])
@pytest.mark.parametrize("seed", range(10))
def test_forward_of_inverse_holds_the_pose(seed: int, drive: str) -> None:
    """1,000 poses in all."""
    random = np.random.default_rng(seed)
    machine = random_machine(random)
    poses = random_reachable(machine, 50, random)
    assert len(poses) == 50
    for pose in poses:
        octant = "".join("+" if value > 0.0 else "-" for value in pose)
        mode = machine.mode(octant=octant, elbows=random_signs(random))
        q = machine.ik([pose], mode, drive=drive)[0]
        found = machine.fk(q, mode, drive=drive)
        assert np.min(np.abs(found - pose).max(axis=1)) < 1e-10


def candidates(machine: Uru, q: Array) -> Array:
    """Assemblies (K, 3) for joint angles by elimination.

    With u = |p|² limb i reads u + A_i + b_i p_i = 2 f_i sin θ_i √(u − p_i²), which squared is a quadratic in
    p_i. Σ p_i² = u for every choice of its roots, multiplied out, is a polynomial of degree 16 in u.
    """
    g = machine.geometry
    f, r = np.array(g.proximal), np.array(g.distal)
    offset = np.subtract(g.platform, g.base)
    cosine, sine = np.cos(q), np.sin(q)
    a = offset**2 + f**2 - r**2 - 2 * f * offset * cosine
    b = 2 * (offset - f * cosine)
    s = 2 * f * sine
    choices = np.array(list(itertools.product((1.0, -1.0), repeat=3)))

    def coordinates(u: Array) -> Array:
        """p (choices, N, 3), complex where the quadratic has no real root."""
        w = u[:, None] + a
        inner = (b**2 + s**2) * u[:, None] - w**2 + 0j
        return (-b * w + choices[:, None, :] * s * np.sqrt(inner)) / (b**2 + s**2)

    def polynomial(u: Array) -> Array:
        return np.prod((coordinates(u) ** 2).sum(axis=2) - u, axis=0).real

    largest = machine.reach_radius() ** 2
    series = chebyshev.Chebyshev.interpolate(polynomial, 16, domain=[0.0, largest])
    roots = series.roots()
    real = roots[np.abs(roots.imag) < 1e-3 * largest].real
    starts = coordinates(np.abs(real)).real.reshape(-1, 3)
    ends = [closed(machine, q, start) for start in starts]
    return np.array([end for end in ends if end is not None]).reshape(-1, 3)


def closed(machine: Uru, q: Array, start: Array) -> Array | None:
    """Newton's method on the unsquared closures; None if it ends where they do not vanish."""
    g = machine.geometry
    f, r = np.array(g.proximal), np.array(g.distal)
    offset = np.subtract(g.platform, g.base)
    p = start.copy()
    for _ in range(50):
        beta = np.sqrt(p @ p - p**2)
        along, across = p + offset - f * np.cos(q), beta - f * np.sin(q)
        slopes = np.outer(across / beta, 2 * p)
        np.fill_diagonal(slopes, 2 * along)
        residual = along**2 + across**2 - r**2
        if not np.isfinite(slopes).all() or abs(np.linalg.det(slopes)) < 1e-14:
            return None
        step = np.linalg.solve(slopes, residual)
        p -= step
        if np.abs(step).max() < 1e-14:
            break
    return p if np.abs(residual).max() < 1e-11 and np.abs(p).max() < 10.0 else None


def same_sets(first: Array, second: Array) -> bool:
    """Each pose of one is a pose of the other to 1e-9 m."""
    if not len(first) or not len(second):
        return len(first) == len(second)
    distances = np.abs(first[:, None] - second).max(axis=2)
    return bool(distances.min(axis=1).max() < 1e-9 and distances.min(axis=0).max() < 1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_no_assembly_is_missed(seed: int) -> None:
    """Joint drive: the same poses as by elimination, for joint angles of poses and for any joint angles."""
    random = np.random.default_rng(1000 + seed)
    machine = random_machine(random)
    mode = machine.mode(octant="any", elbows=random_signs(random))
    poses = random_reachable(machine, 5, random)
    chosen = [*machine.ik(poses, mode, drive="joint"), *random.uniform(-math.pi, math.pi, (5, 3))]
    for q in chosen:
        found = machine.fk(q, drive="joint")
        assert same_sets(found, candidates(machine, q))
        assert len(found) <= 16


@pytest.mark.parametrize("drive", ["motor", "joint"])
def test_every_assembly_belongs_to_a_mode(drive: str) -> None:
    """All modes together give what is found without a mode, and ik leads back to the same angles."""
    random = np.random.default_rng(2000)
    seen = 0
    for _ in range(2):
        machine = random_machine(random)
        start = machine.mode(octant="any", elbows="+-+")
        q = machine.ik(random_reachable(machine, 1, random), start, drive=drive)[0]
        parts = []
        for octant, elbows in itertools.product(SIGNS, SIGNS):
            mode = machine.mode(octant=octant, elbows=elbows)
            part = machine.fk(q, mode, drive=drive)
            if len(part):
                difference = machine.ik(part, mode, drive=drive) - q
                if drive == "joint":
                    difference -= 2.0 * math.pi * np.round(difference / (2.0 * math.pi))
                assert np.abs(difference).max() < 1e-9
            parts.append(part)
        everything = machine.fk(q, drive=drive)
        assert same_sets(np.concatenate(parts), everything)
        seen += len(everything)
    assert seen > 2


def test_symmetric_machine() -> None:
    """Assemblies with equal coordinates, and limbs that fold onto the origin (δ = 0, f = r)."""
    machine = mechanism("uru", db=0.1, dp=0.1, f=0.5, r=0.5, k=1.0)
    assert isinstance(machine, Uru)
    mode = machine.mode(octant="+++", elbows="+++")
    for drive in ("motor", "joint"):
        q = machine.ik([(0.3, 0.3, 0.3)], mode, drive=drive)[0]
        assert same_sets(machine.fk(q, mode, drive=drive), np.array([[0.3, 0.3, 0.3]]))


def test_turns_count_for_motors_but_not_for_joints() -> None:
    machine = mechanism("uru", db=0.3, dp=0.1, f=0.6, r=0.5, k=1.0)
    assert isinstance(machine, Uru)
    pose = (0.5, 0.6, 0.4)
    mode = machine.mode(octant="+++", elbows="+++")
    joints = machine.ik([pose], mode, drive="joint")[0]
    turned = joints + np.array([2.0 * math.pi, 0.0, -4.0 * math.pi])
    assert same_sets(machine.fk(turned, drive="joint"), machine.fk(joints, drive="joint"))
    shafts = machine.ik([pose], mode)[0]
    other = machine.fk(shafts + np.array([2.0 * math.pi, 0.0, 0.0]))
    assert not (np.abs(other - pose).max(axis=1) < 1e-3).any()


def test_joint_limits_exclude_assemblies() -> None:
    pose = np.array([[0.5, 0.6, 0.4]])
    for limits, expected in (({"theta3": (-3.0, -0.1)}, 1), ({"theta3": (0.1, 3.0)}, 0)):
        machine = KIND.build({"db": 0.3, "dp": 0.1, "f": 0.6, "r": 0.5, "k": 1.0}, limits)
        free = KIND.build(machine.parameters, {})
        mode = free.mode_of({"octant": "+++", "elbows": "+++"})
        q = free.ik(pose, mode)[0]
        assert len(machine.fk(q, mode)) == expected


@pytest.mark.parametrize("drive", ["motor", "joint"])
def test_each_assembly_is_proved_to_be_alone_in_its_box(drive: str) -> None:
    random = np.random.default_rng(17)
    for _ in range(8):
        machine = random_machine(random)
        pose = random_reachable(machine, 1, random)[0]
        octant = "".join("+" if value > 0.0 else "-" for value in pose)
        mode = machine.mode(octant=octant, elbows=random_signs(random))
        found = machine.assemblies(machine.ik([pose], mode, drive=drive)[0], drive=drive)
        assert found
        for assembly in found:
            assert assembly.unique
            box = np.array(assembly.box)
            # polished beyond the box's bounds by rounding at most
            assert (np.array(assembly.pose) >= box[:, 0] - 1e-12).all()
            assert (np.array(assembly.pose) <= box[:, 1] + 1e-12).all()
        for one, other in itertools.combinations(found, 2):
            apart = np.array(one.box)[:, 0] > np.array(other.box)[:, 1]
            assert (apart | (np.array(one.box)[:, 1] < np.array(other.box)[:, 0])).any()


def test_no_assembly() -> None:
    machine = mechanism("uru", db=0.1, dp=0.4, f=1.0, r=0.5, k=1.0)
    assert machine.fk([0.0, 0.0, 0.0], drive="joint").shape == (0, 3)
    assert machine.fk([100.0, 0.0, 0.0]).shape == (0, 3)


def test_assemblies_that_do_not_stand_apart() -> None:
    """All limbs stretched at once: det V = 0 and a threefold serial singularity."""
    machine = mechanism("uru", db=0.1, dp=0.1, f=1.0, r=1.0, k=1.0)
    mode = machine.mode_of({"octant": "+++", "elbows": "+++"})
    q = machine.ik([np.full(3, 2.0 / math.sqrt(3.0)) * (1.0 - 1e-9)], mode)[0]
    with pytest.raises(ParameterError, match="do not stand apart"):
        machine.fk(q)


def test_at_an_actuation_singularity_no_assembly_is_called_unique() -> None:
    """Two assemblies meet where det W = 0: bisected between poses of opposite signs."""
    machine = mechanism("uru", db=0.3, dp=0.1, f=0.6, r=0.5, k=1.0)
    mode = machine.mode_of({"octant": "+++", "elbows": "-++"})
    poses = np.random.default_rng(4).uniform(0.05, 1.1, (4000, 3))
    margins = machine.margins(poses, mode)
    inside = margins["reach"] > 0.02
    low = poses[inside & (margins["actuation"] > 0.05)][0]
    high = poses[inside & (margins["actuation"] < -0.05)][0]
    for _ in range(60):
        middle = 0.5 * (low + high)
        positive = machine.margins([middle], mode)["actuation"][0] > 0.0
        low, high = (middle, high) if positive else (low, middle)
    q = machine.ik([low], mode)[0]
    assert np.isfinite(q).all()
    try:
        found = machine.assemblies(q)
    except ParameterError as error:
        assert "do not stand apart" in error.what
    else:
        near = [a for a in found if np.max(np.abs(np.array(a.pose) - low)) < 1e-5]
        assert near
        assert not any(assembly.unique for assembly in near)


@pytest.mark.parametrize("q", [[0.1, 0.2], [[0.1, 0.2, 0.3]], [0.1, math.nan, 0.2], "abc", None])
def test_wrong_actuators(q: object) -> None:
    machine = mechanism("uru", db=0.1, dp=0.1, f=1.0, r=1.0, k=1.0)
    with pytest.raises(ParameterError, match="q "):
        machine.fk(q)  # type: ignore[arg-type]


def test_wrong_drive() -> None:
    machine = mechanism("uru", db=0.1, dp=0.1, f=1.0, r=1.0, k=1.0)
    with pytest.raises(ParameterError, match="Unknown drive"):
        machine.fk([0.1, 0.2, 0.3], drive="shaft")
