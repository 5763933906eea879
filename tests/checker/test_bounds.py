"""The checker's balls against the package's own numbers, which are computed by other code."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from flint import arb
from numba import njit

from tpm_design.checker.balls import Enclosure, Symmetric, constant, full, wide_product
from tpm_design.checker.claims import Machine
from tpm_design.checker.definite import congruent, positive_definite, positive_definite_throughout
from tpm_design.checker.mechanisms import MECHANISMS
from tpm_design.checker.mechanisms.configuration import Machines
from tpm_design.checker.proof import all_positive, graded, natural, proved, spans_of
from tpm_design.checker.regions import Box, Domain, Region
from tpm_design.checker.spectrum import eigenpairs, singular_pairs, unit_frame
from tpm_design.checker.statements import (
    Condition,
    Determinant,
    Fastest,
    Frobenius,
    Goal,
    Locus,
    Reach,
    Sensitivity,
    Serial,
    Slowest,
    Statement,
    Transmission,
)
from tpm_design.mechanisms import mechanism_kind
from tpm_design.workspace.indices import (
    CONDITION_2,
    CONDITION_FROBENIUS,
    DETERMINANT,
    FASTEST,
    REACH,
    SENSITIVITY,
    SERIAL,
    SLOWEST,
    TRANSMISSION,
    Index,
    index_values,
)
from tpm_design.workspace.region_geometry import PlacedRegion, place, signed_distance
from tpm_design.workspace.regions import Box as BoxShape
from tpm_design.workspace.regions import Cylinder, Ellipsoid, Shape

LIMITS = {"theta1": (-2.0, 2.6), "theta2": (-1.5, 3.5), "theta3": (-2.9, 2.9), "theta4": (-2.8, 2.7)}


def uru(parameters: Any, tolerance: Any, limits: Any, octant: str, elbows: str) -> Machine:
    return Machine(MECHANISMS["uru"], parameters, tolerance, limits, {"octant": octant, "elbows": elbows})


def random_machine(random: np.random.Generator, limits: dict[str, Any]) -> Machine:
    signs = ["".join(random.choice(["+", "-"], 3)) for _ in range(2)]
    values: dict[str, list[float]] = {
        "db": random.uniform(0.01, 0.3, 3).tolist(),
        "dp": random.uniform(0.0, 0.2, 3).tolist(),
        "f": random.uniform(0.4, 0.8, 3).tolist(),
        "r": random.uniform(0.4, 0.8, 3).tolist(),
        "k": (random.uniform(0.5, 2.0, 3) * random.choice([-1.0, 1.0], 3)).tolist(),
    }
    parameters = {name: (three[0], three[1], three[2]) for name, three in values.items()}
    tolerance = {"db": 1e-3, "f": 2e-3, "r1": 1e-3, "k": 1e-3}
    return uru(parameters, tolerance, limits, signs[0], signs[1])


def reachable_pose(random: np.random.Generator, machine: Machine) -> tuple[Any, Any, np.ndarray]:
    """The package's mechanism and mode, and a pose well inside its reach."""
    built = mechanism_kind("uru").build(machine.parameters, machine.limits)
    mode = built.mode_of(machine.mode)
    sides = np.asarray([1.0 if sign == "+" else -1.0 for sign in machine.mode["octant"]])
    poses = random.uniform(0.1, 0.8, (4000, 3)) * sides
    reach = built.margins(poses, mode)["reach"]
    return built, mode, poses[reach > 0.03]


def quantities(machines: Machines) -> dict[str, Goal]:
    """Everything statements are made of."""
    found: dict[str, Goal] = {}
    for name in ("translation", "actuation", "rotation"):
        found[name] = lambda at, name=name: at.unit_determinant(name)  # type: ignore[misc]
    for drive in ("motor", "joint"):
        for i in range(3):
            found[f"{drive} b{i}"] = lambda at, d=drive, i=i: at.velocity(d).b[i]  # type: ignore[misc]
            found[f"{drive} |a{i}|²"] = lambda at, d=drive, i=i: at.velocity(d).squares[i]  # type: ignore[misc]
            for j in range(3):
                found[f"{drive} a{i}{j}"] = (
                    lambda at, d=drive, i=i, j=j: at.velocity(d).rows[i][j]  # type: ignore[misc]
                )
    for i in range(3):
        found[f"serial{i}"] = lambda at, i=i: at.serial_squared(i)  # type: ignore[misc]
        found[f"gain{i}"] = lambda at, i=i: at.length_error_gain_squared(i)  # type: ignore[misc]
    for which in (*machines.setting.reach, *machines.setting.within):
        found[f"{which.name}{which.limb}"] = lambda at, w=which: at.margin(w)  # type: ignore[misc]
    return found


def package_values(machine: Machine, parameters: Any, pose: np.ndarray) -> dict[str, float]:
    """The same quantities from the package's mechanism, as far as it gives them singly."""
    built = mechanism_kind("uru").build(parameters, machine.limits)
    mode = built.mode_of(machine.mode)
    margins = built.margins(pose, mode)
    found = {name: float(margins[name][0]) for name in ("translation", "actuation", "rotation")}
    centres = built.joint_centres(pose, mode)
    for i in range(3):
        base, elbow, end = centres[i]
        rho = float(np.linalg.norm(end - base))
        f, r = parameters["f"][i], parameters["r"][i]
        found |= {f"stretched{i}": f + r - rho, f"folded{i}": rho - abs(f - r)}
        distal, proximal = (end - elbow) / r, (elbow - base) / f
        found |= {f"joint a{i}{j}": float(distal[j]) for j in range(3)}
        found[f"serial{i}"] = 1.0 - float(distal @ proximal) ** 2
        found[f"gain{i}"] = 2.0 * float(distal[i]) ** 2 + float(distal @ proximal) ** 2 + 1.0
    for drive in ("motor", "joint"):
        jacobian = built.jacobian(pose, mode, drive=drive)[0]
        for i in range(3):
            # the rows of J⁻¹ are a_i/b_i, and a_i·v_i = 1
            row = np.linalg.inv(jacobian)[i]
            v = np.asarray([found[f"joint a{i}{j}"] for j in range(3)])
            found[f"{drive} b{i}"] = 1.0 / float(row @ v)
            found |= {f"{drive} a{i}{j}": float(row[j] / (row @ v)) for j in range(3)}
            found[f"{drive} |a{i}|²"] = float(row @ row) / float(row @ v) ** 2
    return found


def around(pose: np.ndarray, half: float) -> Box:
    x, y, z = ((float(p) - half, float(p) + half) for p in pose)
    return x, y, z


@pytest.mark.parametrize("half", [1e-4, 1e-2, 0.1])
def test_balls_hold_the_values_of_machines_and_poses_within(half: float) -> None:
    random = np.random.default_rng(5)
    seen = 0
    while seen < 12:
        machine = random_machine(random, {})
        _, _, poses = reachable_pose(random, machine)
        if len(poses) == 0:
            continue
        seen += 1
        box = around(poses[0], half)
        machines = machine.within_tolerance()
        spans = spans_of(machines, box)
        whole, (slopes, _) = natural(machines, spans), graded(machines, spans)
        tolerances = machine.tolerances()
        for _ in range(4):
            parameters = {
                name: tuple(
                    v + t * random.uniform(-1.0, 1.0) for v, t in zip(values, tolerances[name], strict=True)
                )
                for name, values in machine.parameters.items()
            }
            pose = poses[0] + half * random.uniform(-1.0, 1.0, 3)
            built = mechanism_kind("uru").build(parameters, {})
            mode = built.mode_of(machine.mode)
            if not built.margins(pose, mode)["reach"][0] > 1e-3:
                continue
            known = quantities(machines)
            for name, value in package_values(machine, parameters, pose).items():
                rounding = arb(value, 1e-9 * max(1.0, abs(value)))
                for configuration in (whole, slopes):
                    found = known[name](configuration).value
                    assert not found.is_finite() or found.overlaps(rounding), name


def test_slopes_hold_the_differences_between_any_two_points() -> None:
    random = np.random.default_rng(6)
    bounded = 0
    for _ in range(30):
        machine = random_machine(random, LIMITS)
        built, _, poses = reachable_pose(random, machine)
        del built
        if len(poses) == 0:
            continue
        machines = machine.within_tolerance()
        spans = spans_of(machines, around(poses[0], 5e-3))
        slopes, _ = graded(machines, spans)
        ends = []
        for _ in range(2):
            share = {name: arb(random.uniform(0.0, 1.0)) for name in spans}
            ends.append({n: s.low + share[n] * (s.high - s.low) for n, s in spans.items()})
        first, second = (machines.at({n: Enclosure(v, {}) for n, v in end.items()}) for end in ends)
        for name, quantity in quantities(machines).items():
            spread = sum(
                (part * (ends[1][v] - ends[0][v]) for v, part in quantity(slopes).slope.items()), arb(0)
            )
            if not spread.is_finite():
                continue
            bounded += 1
            assert (quantity(second).value - quantity(first).value).overlaps(spread), name
    assert bounded > 200


CASES: list[tuple[Any, Index, bool]] = [
    (Serial, Index(SERIAL), True),
    (Transmission, Index(TRANSMISSION, motor=0.0), True),
    *(
        (lambda bound, kind=kind, drive=drive: kind(drive, bound), Index(quantity, motor=motor), rising)
        for drive, motor in (("motor", 1.0), ("joint", 0.0))
        for kind, quantity, rising in (
            (Condition, CONDITION_2, True),
            (Frobenius, CONDITION_FROBENIUS, True),
            (Slowest, SLOWEST, True),
            (Fastest, FASTEST, False),
            (Sensitivity, SENSITIVITY, False),
        )
    ),
]


@pytest.mark.parametrize(("statement", "index", "rising"), CASES)
def test_a_statement_holds_up_to_the_value_at_a_pose_and_no_further(
    statement: Any, index: Index, rising: bool
) -> None:
    random = np.random.default_rng(7)
    seen = 0
    while seen < 10:
        machine = random_machine(random, {})
        built, mode, poses = reachable_pose(random, machine)
        if len(poses) == 0:
            continue
        seen += 1
        value = float(index_values(built.geometry, mode.signs, index, poses[:1])[0])
        machines = machine.exactly(machine.parameters)
        spans = spans_of(machines, around(poses[0], 0.0))
        within, beyond = (value * (1.0 - 1e-6), value * (1.0 + 1e-6))
        assert all_positive(statement(within if rising else beyond), machines, spans)
        assert not all_positive(statement(beyond if rising else within), machines, spans)


def test_reach_and_sides_hold_up_to_the_value_at_a_pose_and_no_further() -> None:
    random = np.random.default_rng(8)
    seen = 0
    while seen < 15:
        machine = random_machine(random, LIMITS)
        built, mode, poses = reachable_pose(random, machine)
        if len(poses) == 0:
            continue
        seen += 1
        pose = poses[:1]
        machines = machine.exactly(machine.parameters)
        spans = spans_of(machines, around(pose[0], 0.0))
        reach = float(index_values(built.geometry, mode.signs, Index(REACH), pose)[0])
        assert reach > 0.0
        assert all_positive(Reach(0.0), machines, spans)
        for part, name in enumerate(("translation", "actuation", "rotation")):
            value = float(index_values(built.geometry, mode.signs, Index(DETERMINANT, part=part), pose)[0])
            sign = 1 if value > 0.0 else -1
            held: list[Statement] = [Determinant(name, sign, abs(value) * (1.0 - 1e-9)), Locus(name, 1.0)]
            assert all(all_positive(one, machines, spans) for one in held)
            for false in (Determinant(name, sign, abs(value) * (1 + 1e-9)), Determinant(name, -sign, 0.0)):
                assert not all_positive(false, machines, spans)


def test_joint_limits_are_those_of_the_package() -> None:
    random = np.random.default_rng(9)
    inside = outside = 0
    for _ in range(12):
        free = random_machine(random, {})
        _, _, poses = reachable_pose(random, free)
        limited = Machine(free.mechanism, free.parameters, {}, LIMITS, free.mode)
        built = mechanism_kind("uru").build(free.parameters, LIMITS)
        mode = built.mode_of(free.mode)
        machines = limited.exactly(free.parameters)
        for pose in poses[:10]:
            reach = float(built.margins(pose, mode)["reach"][0])
            if abs(reach) > 1e-9:
                spans = spans_of(machines, around(pose, 0.0))
                assert all_positive(Reach(0.0), machines, spans) == (reach > 0.0)
                inside, outside = inside + (reach > 0.0), outside + (reach < 0.0)
    assert inside > 5
    assert outside > 5


@njit
def _distances(region, points):  # type: ignore[no-untyped-def]
    out = np.empty(len(points))
    for n in range(len(points)):
        out[n] = signed_distance(region, points[n, 0], points[n, 1], points[n, 2])
    return out


def signed_distances(region: PlacedRegion, poses: np.ndarray) -> np.ndarray:
    return np.asarray(_distances(region, poses))


SHAPES: list[tuple[Shape, str, tuple[float, float, float]]] = [
    (BoxShape((0.2, 0.4, 0.6)), "box", (0.1, 0.2, 0.3)),
    (Cylinder(0.2, 0.6), "cylinder", (0.2, 0.2, 0.3)),
    (Ellipsoid((0.1, 0.2, 0.4)), "ellipsoid", (0.1, 0.2, 0.4)),
]


@pytest.mark.parametrize(("shape", "form", "half"), SHAPES)
@pytest.mark.parametrize("distance", [0.0, 0.07])
def test_poses_outside_a_region_are_those_farther_than_the_distance(
    shape: Shape, form: str, half: tuple[float, float, float], distance: float
) -> None:
    random = np.random.default_rng(10)
    centre = (0.3, 0.1, -0.2)
    placed = place(shape, centre)
    domain = Domain(Region(form, centre, half), distance)
    poses = np.asarray(centre) + random.uniform(-0.6, 0.6, (300, 3))
    for pose, away in zip(poses, signed_distances(placed, poses), strict=True):
        if abs(away - distance) > 1e-7:
            point = (float(pose[0]), float(pose[1]), float(pose[2]))
            assert domain.outside(around(pose, 0.0)) == (away > distance)
            assert domain.holds(point, 0.0) == (away < distance)
            # a box is outside only with all its poses
            if domain.outside(around(pose, 0.05)):
                corners = pose + 0.05 * random.uniform(-1.0, 1.0, (20, 3))
                assert (signed_distances(placed, corners) > distance).all()


def test_eigenvalues_and_singular_values_are_those_of_lapack() -> None:
    random = np.random.default_rng(11)
    for _ in range(50):
        matrix = random.normal(size=(3, 3))
        symmetric = matrix + matrix.T
        pairs = eigenpairs(symmetric.tolist())
        assert [value for value, _ in pairs] == pytest.approx(np.linalg.eigvalsh(symmetric).tolist())
        for value, vector in pairs:
            assert symmetric @ vector == pytest.approx(value * np.asarray(vector))
        b = random.uniform(0.1, 2.0, 3)
        jacobian = np.linalg.inv(matrix) @ np.diag(b)
        values = np.linalg.svd(jacobian, compute_uv=False)[::-1] ** 2
        found = singular_pairs(matrix.tolist(), b.tolist())
        assert [value for value, _, _ in found] == pytest.approx(values.tolist(), rel=1e-6)


def test_a_symmetric_matrix_is_told_to_be_positive_definite_exactly_when_it_is() -> None:
    random = np.random.default_rng(12)
    for _ in range(200):
        matrix = random.normal(size=(3, 3))
        matrix = matrix + matrix.T + random.uniform(-1.0, 6.0) * np.eye(3)
        entries = [float(matrix[place]) for place in ENTRIES]
        p, q, r, u, v, w = (constant(arb(entry)) for entry in entries)
        symmetric = Symmetric((p, q, r), (u, v, w))
        assert [[float(entry.value) for entry in row] for row in full(symmetric)] == matrix.tolist()
        definite = bool(np.linalg.eigvalsh(matrix).min() > 0.0)
        frame = unit_frame(matrix.tolist())
        assert positive_definite([arb(entry) for entry in entries]) == definite == (frame is not None)
        if frame is not None:
            turned = congruent([[arb(part) for part in row] for row in frame], [arb(e) for e in entries])
            unit = np.asarray(frame) @ matrix @ np.asarray(frame).T
            assert unit == pytest.approx(np.eye(3), abs=1e-6)
            assert [float(part) for part in turned] == pytest.approx([1, 1, 1, 0, 0, 0], abs=1e-6)


def test_a_product_of_balls_keeps_the_signs_of_its_factors() -> None:
    near, far = arb(0.01).union(arb(1)), arb(0.02).union(arb(3))
    for one, other, sign in ((near, far, 1), (-near, far, -1), (-near, -far, 1)):
        found = wide_product(one, other) * sign
        assert found > 0
        assert found.contains(arb(0.01) * arb(0.02))
        assert found.contains(arb(3))
    assert wide_product(near, arb(0, 1)).contains(-1)


def test_the_rotation_determinant_has_one_sign_in_a_large_box_of_an_octant() -> None:
    machines = MADE.within_tolerance()
    wide = (0.01, 0.3)
    assert all_positive(Locus("rotation", 0.0), machines, spans_of(machines, (wide, wide, wide)))


ENTRIES = ((0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1))


def test_a_matrix_is_positive_definite_throughout_a_cube_exactly_when_it_is_at_the_corners() -> None:
    random = np.random.default_rng(14)
    signs = np.asarray(list(itertools.product((-1.0, 1.0), repeat=6)))
    told = {True: 0, False: 0}
    for _ in range(60):
        swings = random.normal(size=(6, 3, 3))
        swings += np.swapaxes(swings, 1, 2)
        swings *= random.uniform(0.05, 0.12)
        corners = np.eye(3) + np.tensordot(signs, swings, axes=1)
        least = float(np.linalg.eigvalsh(corners).min())
        balls = [[arb(float(swing[place])) for place in ENTRIES] for swing in swings]
        for unknown in (0.0, 1e-3):
            middle = [arb(float(np.eye(3)[place]), unknown) for place in ENTRIES]
            if abs(least) > 1e-12 and not 0.0 < least < 3.0 * unknown:
                assert positive_definite_throughout(middle, balls) == (least > 0.0)
                told[least > 0.0] += 1
        # the least eigenvalue of all is what may be taken away, by what is unknown too
        short = [arb(float(np.eye(3)[place]), 0.34 * least if least > 0.0 else 0.0) for place in ENTRIES]
        assert not positive_definite_throughout(short, balls)
    assert min(told.values()) > 20


SIZES = {"db": 0.185804, "dp": 0.06, "f": 0.232357, "r": 0.176357, "k": 1.0}
NOMINAL = {name: (value, value, value) for name, value in SIZES.items()}
MADE = uru(NOMINAL, {"db": 1e-4, "f": 1e-4, "r": 1e-4}, {}, "+++", "+++")
"""Made so precisely, it has two singular values that are equal where x = y = z."""


def least_conditioning(pose: float) -> float:
    """Least 1/κ₂ at (x, x, x) of the machines at the ends of the tolerances."""
    least = 1.0
    for signs in itertools.product((-1e-4, 1e-4), repeat=9):
        moved = dict(zip(("db", "f", "r"), np.reshape(signs, (3, 3)), strict=True))
        worst = {name: np.add(NOMINAL[name], moved.get(name, 0.0)).tolist() for name in NOMINAL}
        built = mechanism_kind("uru").build(worst, {})
        mode = built.mode_of({"octant": "+++", "elbows": "+++"})
        values = index_values(built.geometry, mode.signs, Index(CONDITION_2), np.full((1, 3), pose))
        least = min(least, float(values[0]))
    return least


@pytest.mark.parametrize("pose", [0.2, 0.24, 0.256133])
def test_conditioning_is_proved_close_to_its_least_value_for_every_machine_within_tolerance(
    pose: float,
) -> None:
    """Each machine parts the two equal singular values otherwise."""
    least = least_conditioning(pose)
    machines = MADE.within_tolerance()
    spans = spans_of(machines, around(np.full(3, pose), 1e-6))
    assert all_positive(Condition("motor", 0.996 * least), machines, spans)
    assert not all_positive(Condition("motor", least * (1.0 + 1e-6)), machines, spans)


def test_a_leaf_at_a_double_singular_value_is_proved_again_by_halving_it() -> None:
    """The corner of a cube, with the slack that a certificate leaves."""
    machines = MADE.within_tolerance()
    corner = 0.256133
    box: Box = ((corner - 4e-4, corner), (corner - 2e-4, corner), (corner - 4e-4, corner))
    domain = Domain(Region("box", (0.156133,) * 3, (0.1, 0.1, 0.1)), 0.0)
    floor = 0.995 * least_conditioning(corner)
    assert proved(Condition("motor", floor), machines, domain, box)
    assert not proved(Condition("motor", 1.01 * floor), machines, domain, box)


@pytest.mark.parametrize(("statement", "index", "rising"), CASES)
def test_what_is_proved_on_a_box_holds_at_poses_and_machines_within(
    statement: Any, index: Index, rising: bool
) -> None:
    random = np.random.default_rng(13)
    proofs = 0
    while proofs < 12:
        machine = random_machine(random, {})
        built, mode, poses = reachable_pose(random, machine)
        if len(poses) == 0:
            continue
        value = float(index_values(built.geometry, mode.signs, index, poses[:1])[0])
        bound = value * float(random.uniform(0.7, 1.0) if rising else random.uniform(1.0, 1.4))
        half = float(random.choice([1e-4, 1e-3, 4e-3]))
        machines = machine.within_tolerance()
        if not all_positive(statement(bound), machines, spans_of(machines, around(poses[0], half))):
            continue
        proofs += 1
        tolerances = machine.tolerances()
        for _ in range(6):
            within = {
                name: np.add(values, np.multiply(tolerances[name], random.uniform(-1.0, 1.0, 3))).tolist()
                for name, values in machine.parameters.items()
            }
            other = mechanism_kind("uru").build(within, {})
            near = poses[0] + half * random.uniform(-1.0, 1.0, (50, 3))
            found = index_values(other.geometry, mode.signs, index, near)
            assert (found >= bound).all() if rising else (found <= bound).all()
