"""The checker's mechanisms against loops closed in plain numbers, published poses and closed forms."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import closures
import numpy as np
import pytest
from flint import arb
from prover import letters, outer_box

from tpm_design.checker.balls import Enclosure
from tpm_design.checker.claims import Machine
from tpm_design.checker.mechanisms import MECHANISMS
from tpm_design.checker.mechanisms.angles import exact_angle
from tpm_design.checker.mechanisms.configuration import LIMBS, Machines
from tpm_design.checker.mechanisms.mechanism import ANGLE, LENGTH, RATIO
from tpm_design.checker.proof import all_positive, graded, natural, out_of_reach, proved, spans_of
from tpm_design.checker.regions import Box, Domain, Region
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
    LEGS,
    SENSITIVITY,
    SERIAL,
    SLOWEST,
    TRANSMISSION,
    Index,
    index_values,
)

NEW = ("crr", "prrr", "crrr", "delta", "linear_delta", "orthoglide")
QUARTER = math.pi / 2
TOLERANCES = {
    "orthoglide": {"L": 1e-3, "d": 1e-3},
    "linear_delta": {"R": 1e-3, "l2": 5e-4, "rail": 1e-3},
    "delta": {"w": 1e-3, "L": 1e-3, "l3": 1e-3},
}
TOLERANCES |= {name: {"f": 1e-3, "r1": 1e-3, "ax": 5e-4, "bz2": 1e-3} for name in ("crr", "prrr", "crrr")}
LOWEST: dict[str, Any] = {
    "delta": ((-0.3, 0.3), (-0.3, 0.3), (-1.2, -0.5)),
    "linear_delta": ((-0.3, 0.3), (-0.3, 0.3), (-1.3, -0.6)),
}


def about(random: np.random.Generator, *middles: float, spread: float = 0.1) -> tuple[float, float, float]:
    one, two, three = (float(middle) for middle in np.add(middles, random.uniform(-spread, spread, 3)))
    return one, two, three


def random_parameters(name: str, random: np.random.Generator) -> dict[str, tuple[float, float, float]]:
    """Near the usual arrangement, each limb by itself."""
    if name == "orthoglide":
        return {"L": about(random, 1, 1, 1), "d": about(random, 0, 0, 0)}
    if name == "linear_delta":
        return {
            "R": about(random, 0.5, 0.5, 0.5),
            "r": about(random, 0.1, 0.1, 0.1, spread=0.05),
            "l": about(random, 0.9, 0.9, 0.9),
            "rail": about(random, 2.5, 2.5, 2.5),
            "azimuth": about(random, -5 * QUARTER / 3, -QUARTER / 3, QUARTER),
            "tilt": about(random, 0.1, 0.1, 0.1, spread=0.2),
        }
    if name == "delta":
        return {
            "w": about(random, 0.2, 0.2, 0.2),
            "u": about(random, 0.05, 0.05, 0.05, spread=0.05),
            "L": about(random, 0.5, 0.5, 0.5),
            "l": about(random, 1.0, 1.0, 1.0),
            "azimuth": about(random, -QUARTER, QUARTER / 3, 5 * QUARTER / 3),
        }
    found = {"f": about(random, 0.6, 0.6, 0.6), "r": about(random, 0.5, 0.5, 0.5)}
    for prefix in ("", *({"prrr": ("slide_",), "crrr": ("idle_",)}.get(name, ()))):
        turned = 0.3 if prefix else 0.2
        azimuths, elevations = (0.0, QUARTER, 0.0), (0.0, 0.0, QUARTER)
        if prefix == "idle_":
            azimuths, elevations = (QUARTER, 0.0, 0.0), (0.0, QUARTER, 0.0)
        found |= {
            f"{prefix}azimuth": about(random, *azimuths, spread=turned),
            f"{prefix}elevation": about(random, *elevations, spread=turned),
        }
    return found | {f"{end}{along}": about(random, 0, 0, 0) for end in "ab" for along in "xyz"}


class Case(NamedTuple):
    """A machine of the checker, the same in plain numbers, and poses well inside its reach."""

    machine: Machine
    plain: closures.Machine
    poses: np.ndarray


def random_case(name: str, random: np.random.Generator, limits: dict[str, Any] | None = None) -> Case:
    mechanism = MECHANISMS[name]
    while True:
        parameters = random_parameters(name, random)
        signs = [int(sign) for sign in random.choice([1, -1], 3)]
        text = "".join("+" if sign > 0 else "-" for sign in signs)
        machine = Machine(
            mechanism, parameters, TOLERANCES[name], limits or {}, {mechanism.mode[0].name: text}
        )
        plain = closures.Machine(name, parameters, signs)
        low, high = np.transpose(LOWEST.get(name, ((-0.6, 0.6),) * 3))
        poses = [
            pose
            for pose in random.uniform(low, high, (60, 3))
            if all(min(*limb.reach, limb.serial - 0.1, on_rail(limb)) > 0.05 for limb in plain.limbs(pose))
        ]
        if poses:
            return Case(machine, plain, np.asarray(poses))


def on_rail(limb: closures.Limb) -> float:
    """How far a carriage is from the start of its rail, which is long."""
    return limb.limited.get("rail", math.inf)


def around(pose: Any, half: float) -> Box:
    x, y, z = ((float(p) - half, float(p) + half) for p in pose)
    return x, y, z


def moved(machine: Machine, random: np.random.Generator) -> dict[str, tuple[float, float, float]]:
    """A machine within the tolerance."""
    found = {}
    for name, tolerances in machine.tolerances().items():
        one, two, three = np.add(
            machine.parameters[name], np.multiply(tolerances, random.uniform(-1, 1, 3))
        ).tolist()
        found[name] = (one, two, three)
    return found


def quantities(machines: Machines, determinants: tuple[str, ...]) -> dict[str, Goal]:
    found: dict[str, Goal] = {}
    for name in determinants:
        found[name] = lambda at, name=name: at.unit_determinant(name)  # type: ignore[misc]
    for i in LIMBS:
        found[f"b{i}"] = lambda at, i=i: at.velocity("motor").b[i]  # type: ignore[misc]
        found[f"serial{i}"] = lambda at, i=i: at.serial_squared(i)  # type: ignore[misc]
        found[f"gain{i}"] = lambda at, i=i: at.length_error_gain_squared(i)  # type: ignore[misc]
        for j in range(3):
            found[f"a{i}{j}"] = lambda at, i=i, j=j: at.velocity("motor").rows[i][j]  # type: ignore[misc]
    for which in (*machines.setting.reach, *machines.setting.within):
        found[f"{which.name}{which.limb}"] = lambda at, w=which: at.margin(w)  # type: ignore[misc]
    return found


def plain_values(
    plain: closures.Machine, pose: np.ndarray, determinants: tuple[str, ...]
) -> dict[str, float]:
    limbs = plain.limbs(pose)
    found = {"actuation": float(np.linalg.det(np.asarray([limb.push for limb in limbs])))}
    if "rotation" in determinants:
        found["rotation"] = float(np.linalg.det(np.asarray([limb.normal for limb in limbs])))
    for i, limb in enumerate(limbs):
        found |= {f"a{i}{j}": float(limb.push[j]) for j in range(3)}
        found |= {f"b{i}": plain.b(i, pose), f"serial{i}": limb.serial**2}
        found[f"gain{i}"] = plain.gain_squared(i, pose)
        names = ("stretched", "folded") if len(limb.reach) == 2 else ("strut",)
        found |= {f"{name}{i}": value for name, value in zip(names, limb.reach, strict=True)}
    return found


@pytest.mark.parametrize("name", NEW)
def test_rows_margins_and_gains_are_those_of_the_closed_loops(name: str) -> None:
    """At a pose; a = b ∂q/∂p and c = −b ∂q/∂L by differences."""
    random = np.random.default_rng(1)
    determinants = MECHANISMS[name].determinants
    for _ in range(8):
        machine, plain, poses = random_case(name, random)
        machines = machine.exactly(machine.parameters)
        known = quantities(machines, determinants)
        at = natural(machines, spans_of(machines, around(poses[0], 0.0)))
        expected = plain_values(plain, poses[0], determinants)
        assert set(expected) <= set(known)
        for quantity, value in expected.items():
            assert float(known[quantity](at).value) == pytest.approx(value, rel=2e-7, abs=2e-7), quantity
        for i in LIMBS:
            row, b = plain.limb(i, poses[0]).push, plain.b(i, poses[0])
            assert b * plain.slope(i, poses[0]) == pytest.approx(row, abs=1e-7)
            assert abs(b) == pytest.approx(
                plain.limb(i, poses[0]).serial * plain.limb(i, poses[0]).crank
            ) or name in ("crr", "prrr", "crrr")


@pytest.mark.parametrize("half", [1e-4, 1e-2, 0.1])
@pytest.mark.parametrize("name", NEW)
def test_balls_hold_the_values_of_machines_and_poses_within(name: str, half: float) -> None:
    random = np.random.default_rng(2)
    determinants = MECHANISMS[name].determinants
    bounded = 0
    for _ in range(5):
        machine, plain, poses = random_case(name, random)
        machines = machine.within_tolerance()
        spans = spans_of(machines, around(poses[0], half))
        known = quantities(machines, determinants)
        configurations = (natural(machines, spans), graded(machines, spans)[0])
        for _ in range(4):
            other = closures.Machine(name, moved(machine, random), plain.signs)
            pose = poses[0] + half * random.uniform(-1, 1, 3)
            if min(min(limb.reach) for limb in other.limbs(pose)) < 1e-3:
                continue
            for quantity, value in plain_values(other, pose, determinants).items():
                for at in configurations:
                    found = known[quantity](at).value
                    bounded += found.is_finite()
                    assert not found.is_finite() or found.overlaps(arb(value, 1e-6)), quantity
    assert bounded > 100


@pytest.mark.parametrize("name", NEW)
def test_slopes_hold_the_differences_between_any_two_points(name: str) -> None:
    random = np.random.default_rng(3)
    bounded = 0
    for _ in range(6):
        machine, _, poses = random_case(name, random, limits_of(name, 0.2, 2.0))
        machines = machine.within_tolerance()
        spans = spans_of(machines, around(poses[0], 5e-3))
        slopes, _ = graded(machines, spans)
        ends = []
        for _ in range(2):
            share = {size: arb(random.uniform(0.0, 1.0)) for size in spans}
            ends.append({n: s.low + share[n] * (s.high - s.low) for n, s in spans.items()})
        first, second = (machines.at({n: Enclosure(v, {}) for n, v in end.items()}) for end in ends)
        for title, quantity in quantities(machines, MECHANISMS[name].determinants).items():
            spread = sum(
                (part * (ends[1][v] - ends[0][v]) for v, part in quantity(slopes).slope.items()), arb(0)
            )
            bounded += spread.is_finite()
            if spread.is_finite():
                assert (quantity(second).value - quantity(first).value).overlaps(spread), title
    assert bounded > 100


def limits_of(name: str, low: float, high: float) -> dict[str, Any]:
    """Every limit that a mechanism has."""
    values = {"range": (low, high), "number": low}
    limits = MECHANISMS[name].limits.items()
    return {key: values[limit.form] for key, limit in limits if limit.form in values}


@pytest.mark.parametrize("name", NEW)
def test_each_limit_holds_exactly_where_the_joint_is_within_it(name: str) -> None:
    random = np.random.default_rng(4)
    told = {True: 0, False: 0}
    for limit, form in MECHANISMS[name].limits.items():
        if limit in ("link_radius", "fold"):
            continue
        for _ in range(6):
            free = random_case(name, random)
            values = [limb.limited[limit] for pose in free.poses for limb in free.plain.limbs(pose)]
            low, high = np.quantile(values, [0.1, 0.9]).tolist()
            if form.form == "number":
                low = -1.0
            limits = {limit: (low, high) if form.form == "range" else high}
            machine = Machine(free.machine.mechanism, free.machine.parameters, {}, limits, free.machine.mode)
            machines = machine.within_tolerance()
            for pose in free.poses[:10]:
                limbs = free.plain.limbs(pose)
                found = [limb.limited[limit] for limb in limbs]
                if min(abs(value - end) for value in found for end in (low, high)) < 1e-9:
                    continue  # on the limit itself
                inside = all(low <= value <= high for value in found)
                spans = spans_of(machines, around(pose, 0.0))
                assert all_positive(Reach(0.0), machines, spans) == inside
                assert out_of_reach(machines, around(pose, 0.0), spans) != inside
                told[inside] += 1
    assert min(told.values()) > 5


def test_carriages_of_the_linear_delta_stay_on_their_rails() -> None:
    random = np.random.default_rng(7)
    told = {True: 0, False: 0}
    for _ in range(10):
        case = random_case("linear_delta", random)
        q = [[limb.q for limb in case.plain.limbs(pose)] for pose in case.poses]
        one, two, three = np.quantile(q, 0.8, axis=0).tolist()
        parameters = {**case.machine.parameters, "rail": (one, two, three)}
        machines = case.machine.exactly(parameters)
        low = np.asarray(case.poses) + np.asarray([0.0, 0.0, 0.5])  # some carriages above the start
        for pose in (*case.poses[:10], *low[:10]):
            limbs = case.plain.limbs(pose)
            if min(min(limb.reach) for limb in limbs) > 1e-3:
                inside = all(0 < limb.q < rail for limb, rail in zip(limbs, (one, two, three), strict=True))
                assert all_positive(Reach(0.0), machines, spans_of(machines, around(pose, 0.0))) == inside
                told[inside] += 1
    assert min(told.values()) > 5


class Values(NamedTuple):
    """Metrics at a pose, from J = A⁻¹ B by numpy."""

    condition: float
    frobenius: float
    slowest: float
    fastest: float
    sensitivity: float
    transmission: float
    serial: float
    reach: float


def metrics_at(name: str, plain: closures.Machine, pose: np.ndarray) -> Values:
    limbs = plain.limbs(pose)
    a = np.asarray([limb.push for limb in limbs])
    jacobian = np.linalg.inv(a) @ np.diag([plain.b(i, pose) for i in LIMBS])
    values = np.linalg.svd(jacobian, compute_uv=False)
    gains = np.sqrt([plain.gain_squared(i, pose) for i in LIMBS])
    outputs = [
        abs(np.linalg.det(a)) / np.linalg.norm(np.cross(a[(i + 1) % 3], a[(i + 2) % 3])) for i in LIMBS
    ]
    inputs = [limb.serial for limb in limbs]
    if name in ("crr", "prrr", "crrr"):
        inputs = [abs(plain.b(i, pose)) for i in LIMBS]
    return Values(
        condition=values[2] / values[0],
        frobenius=float(3 / (np.linalg.norm(jacobian) * np.linalg.norm(np.linalg.inv(jacobian)))),
        slowest=values[2],
        fastest=values[0],
        sensitivity=np.linalg.svd(np.linalg.inv(a) @ np.diag(gains), compute_uv=False)[0],
        transmission=min(*outputs, *inputs, 2.0),
        serial=min(limb.serial for limb in limbs),
        reach=min(min(limb.reach) for limb in limbs),
    )


STATEMENTS: dict[str, Any] = {
    "condition": lambda level: Condition("motor", level),
    "frobenius": lambda level: Frobenius("motor", level),
    "slowest": lambda level: Slowest("motor", level),
    "fastest": lambda level: Fastest("motor", level),
    "sensitivity": lambda level: Sensitivity("motor", level),
    "transmission": Transmission,
    "serial": Serial,
    "reach": Reach,
}


@pytest.mark.parametrize("name", NEW)
def test_a_statement_holds_up_to_the_value_at_a_pose_and_no_further(name: str) -> None:
    random = np.random.default_rng(5)
    for _ in range(6):
        machine, plain, poses = random_case(name, random)
        machines = machine.exactly(machine.parameters)
        spans = spans_of(machines, around(poses[0], 0.0))
        for title, value in metrics_at(name, plain, poses[0])._asdict().items():
            statement, rising = STATEMENTS[title], title not in ("fastest", "sensitivity")
            within, beyond = value * (1 - 1e-5), value * (1 + 1e-5)
            assert all_positive(statement(within if rising else beyond), machines, spans), title
            assert not all_positive(statement(beyond if rising else within), machines, spans), title
        for determinant in machine.mechanism.determinants:
            value = plain_values(plain, poses[0], machine.mechanism.determinants)[determinant]
            sign = 1 if value > 0 else -1
            assert all_positive(Determinant(determinant, sign, abs(value) * (1 - 1e-9)), machines, spans)
            assert all_positive(Locus(determinant, 0.1), machines, spans)
            assert not all_positive(Determinant(determinant, sign, abs(value) * (1 + 1e-9)), machines, spans)
            assert not all_positive(Determinant(determinant, -sign, 0.0), machines, spans)


INDICES = {
    "condition": Index(CONDITION_2),
    "frobenius": Index(CONDITION_FROBENIUS),
    "slowest": Index(SLOWEST),
    "fastest": Index(FASTEST),
    "sensitivity": Index(SENSITIVITY),
    "transmission": Index(TRANSMISSION),
    "serial": Index(SERIAL),
    "reach": Index(LEGS),
}


@pytest.mark.parametrize("name", NEW)
def test_statements_hold_up_to_the_values_of_the_package_and_no_further(name: str) -> None:
    """The package computes them by other code, which makes the certificates."""
    random = np.random.default_rng(8)
    for _ in range(4):
        machine, _, poses = random_case(name, random)
        machine = Machine(machine.mechanism, machine.parameters, {}, {}, machine.mode)
        built = mechanism_kind(name).build(machine.parameters, {})
        mode = built.mode_of(machine.mode)
        machines = machine.within_tolerance()
        for pose in poses[:3]:
            spans = spans_of(machines, around(pose, 0.0))
            for title, index in INDICES.items():
                value = float(index_values(built.geometry, mode.signs, index, pose[None])[0])
                rising = title not in ("fastest", "sensitivity")
                within, beyond = value * (1 - 1e-9), value * (1 + 1e-9)
                statement = STATEMENTS[title]
                assert all_positive(statement(within if rising else beyond), machines, spans), title
                assert not all_positive(statement(beyond if rising else within), machines, spans), title
            for part, determinant in enumerate(machine.mechanism.determinants):
                index = Index(DETERMINANT, part=part)
                value = float(index_values(built.geometry, mode.signs, index, pose[None])[0])
                found = natural(machines, spans).unit_determinant(determinant).value
                assert found.overlaps(arb(value, 1e-13))


@pytest.mark.parametrize("name", NEW)
def test_parameters_limits_and_modes_are_those_of_the_package(name: str) -> None:
    known, kind = MECHANISMS[name], mechanism_kind(name)
    powers = {"length": LENGTH, "angle": ANGLE, "ratio": RATIO}
    assert {p.name: (p.powers, p.domain, p.default) for p in known.parameters} == {
        p.name: (powers[p.dimension], p.domain, p.default) for p in kind.parameters
    }
    assert {n: (limit.form, limit.powers) for n, limit in known.limits.items()} == {
        limit.name: (limit.kind, powers[limit.dimension]) for limit in kind.limits
    }
    assert [(f.name, f.any_allowed) for f in known.mode] == [
        (f.name, f.any_allowed) for f in kind.mode_fields
    ]
    assert (tuple(known.drives), known.determinants) == (kind.drives, kind.determinants)
    assert known.transmission_drive == kind.transmission_drive


@pytest.mark.parametrize("name", NEW)
def test_limits_are_those_of_the_package(name: str) -> None:
    random = np.random.default_rng(9)
    told = {True: 0, False: 0}
    for _ in range(7):
        free = random_case(name, random)
        limits: dict[str, Any] = {}
        for limit, form in MECHANISMS[name].limits.items():
            values = [limb.limited.get(limit, 0) for pose in free.poses for limb in free.plain.limbs(pose)]
            low, high = np.quantile(values, [0.03, 0.97]).tolist()
            if limit not in ("fold", "link_radius"):
                limits[limit] = (low - 1e-3, high + 1e-3) if form.form == "range" else high + 1e-3
        machine = Machine(free.machine.mechanism, free.machine.parameters, {}, limits, free.machine.mode)
        built = mechanism_kind(name).build(machine.parameters, limits)
        mode, machines = built.mode_of(machine.mode), machine.within_tolerance()
        for pose in free.poses[:6]:
            reach = float(built.margins(pose, mode)["reach"][0])
            if abs(reach) > 1e-9:
                spans = spans_of(machines, around(pose, 0.0))
                assert all_positive(Reach(0.0), machines, spans) == (reach > 0.0)
                told[reach > 0.0] += 1
    assert min(told.values()) > 2, told


@pytest.mark.parametrize("name", NEW)
def test_what_is_proved_on_a_box_holds_at_poses_and_machines_within(name: str) -> None:
    random = np.random.default_rng(6)
    proofs = dict.fromkeys(STATEMENTS, 0)
    for _ in range(8):
        machine, plain, poses = random_case(name, random)
        values = metrics_at(name, plain, poses[0])._asdict()
        machines = machine.within_tolerance()
        half = float(random.choice([1e-3, 4e-3]))
        others = [
            metrics_at(name, closures.Machine(name, moved(machine, random), plain.signs), pose)._asdict()
            for pose in poses[0] + half * random.uniform(-1, 1, (8, 3))
        ]
        for title, value in values.items():
            rising = title not in ("fastest", "sensitivity")
            level = value * float(random.uniform(0.8, 1.0) if rising else random.uniform(1.0, 1.25))
            if all_positive(STATEMENTS[title](level), machines, spans_of(machines, around(poses[0], half))):
                proofs[title] += 1
                slack = 1e-6 * value
                assert all(
                    other[title] >= level - slack if rising else other[title] <= level + slack
                    for other in others
                )
    assert min(proofs.values()) > 2, proofs


def of_equal_limbs(name: str, signs: str, limits: dict[str, Any] | None = None, **sizes: Any) -> Machine:
    """Parameters that are not given have their defaults."""
    mechanism = MECHANISMS[name]
    parameters = {}
    for parameter in mechanism.parameters:
        given = sizes.get(parameter.name, parameter.default)
        parameters[parameter.name] = given if isinstance(given, tuple) else (given,) * 3
    return Machine(mechanism, parameters, {}, limits or {}, {mechanism.mode[0].name: signs})


IRB_360: dict[str, Any] = {"w": 567 * math.sqrt(3) / 6, "u": 76 / math.sqrt(3), "L": 524, "l": 1244}
DELTA_POSES = [
    ((0, 0, 0), (0, 0, -1064.4517)),
    ((10, 20, 30), (108.1354, -180.3484, -1243.5413)),
    ((-20.5, -20.5, -20.5), (0, 0, -900.3195)),
    ((47.5, -11.6, 21.4), (300.4598, 499.9385, -1099.8281)),
]


@pytest.mark.parametrize(("angles", "pose"), DELTA_POSES)
def test_published_poses_of_the_delta(angles: Any, pose: Any) -> None:
    """ABB IRB 360-1/1600, mm and degrees: R. L. Williams II, The Delta Parallel Robot."""
    for limb, angle in enumerate(angles):
        for off, inside in ((0.001, True), (-0.001, False)):
            low = math.radians(angle - off)
            machine = of_equal_limbs("delta", "+++", {"theta": (low, low + 3)}, **IRB_360)
            machines = machine.within_tolerance()
            at = natural(machines, spans_of(machines, around(pose, 0.0)))
            margin = next(which for which in machines.setting.within if which.limb == limb)
            assert (at.margin(margin).value > 0) == inside


RAIL_POSES = [
    ((0, 0, -500), (245.1, 245.1, 245.1)),
    ((30, 50, -400), (166.4, 151.6, 138.4)),
    ((0, 0, -454.9), (200, 200, 200)),
]


@pytest.mark.parametrize(("pose", "positions"), RAIL_POSES)
def test_published_poses_of_the_linear_delta(pose: Any, positions: Any) -> None:
    """DeltaMaker, mm, from the same source: its effective radius is R − r."""
    sizes: dict[str, Any] = {"R": 246 / math.sqrt(3), "r": 127 / math.sqrt(3), "l": 264, "rail": 1000}
    machines = of_equal_limbs("linear_delta", "+++", **sizes).within_tolerance()
    at = natural(machines, spans_of(machines, around(pose, 0.0)))
    starts = [which for which in machines.setting.within if which.name == "rail start"]
    assert [float(at.margin(which).value) for which in starts] == pytest.approx(positions, abs=0.06)


def orthoglide_cube(scale: float) -> Domain:
    """The cube whose corners attain both bounds of the singular values, scaled about its middle; L = 1."""
    low, high = -1 / math.sqrt(6), 1 / (3 * math.sqrt(2))
    middle, half = (low + high) / 2, scale * (high - low) / 2
    return Domain(Region("box", (middle,) * 3, (half,) * 3), 0.0)


@pytest.mark.parametrize("signs", ["+++", "---"])
def test_the_cube_of_the_orthoglide_with_singular_values_between_one_half_and_two(signs: str) -> None:
    machines = of_equal_limbs("orthoglide", signs, L=1.0).within_tolerance()
    # the carriages behind the platform: the mirrored machine
    side = 1 if signs == "+++" else -1
    bounds: tuple[Statement, ...] = (Fastest("motor", 2.0), Slowest("motor", 0.5))
    for statement in bounds:
        domain = orthoglide_cube(0.97)
        body = Region("box", tuple(side * c for c in domain.body.centre), domain.body.half)  # type: ignore[arg-type]
        domain = Domain(body, 0.0)
        tree = letters(statement, machines, domain, outer_box(domain), 0)
        assert "p" in tree
    for scale, held in ((1 - 1e-6, True), (1 + 1e-6, False)):
        domain = orthoglide_cube(scale)
        corners = [
            [side * (c + sign * h) for c, h in zip(domain.body.centre, domain.body.half, strict=True)]
            for sign in (1, -1)
        ]
        verdicts = [
            all_positive(statement, machines, spans_of(machines, around(corner, 0.0)))
            for statement, corner in zip(bounds, corners, strict=True)
        ]
        assert verdicts == [held, held]


def test_singular_values_of_the_orthoglide_on_its_diagonal() -> None:
    """1/(1 + 2a) and twice 1/(1 − a), a = −t/√(L² − 2t²)."""
    machines = of_equal_limbs("orthoglide", "+++", L=1.0).within_tolerance()
    for t in (-0.3, -0.1, 0.1, 0.2):
        a = -t / math.sqrt(1 - 2 * t * t)
        values = sorted((1 / (1 + 2 * a), 1 / (1 - a)))
        spans = spans_of(machines, around((t, t, t), 0.0))
        for factor, held in ((1 - 1e-9, True), (1 + 1e-9, False)):
            assert all_positive(Slowest("motor", values[0] * factor), machines, spans) == held
            assert all_positive(Fastest("motor", values[1] / factor), machines, spans) == held


@pytest.mark.parametrize("name", ["crr", "prrr", "crrr"])
def test_orthogonal_axes_are_isotropic_in_the_whole_tricylinder(name: str) -> None:
    machine = of_equal_limbs(name, "+++", {"fold": False}, f=0.5, r=0.5)
    machines = machine.within_tolerance()
    cube: Box = ((-0.7, 0.7),) * 3
    domain = Domain(Region("box", (0.0, 0.0, 0.0), (0.7, 0.7, 0.7)), 0.0)
    held_everywhere: list[Statement] = [
        Reach(0.0),
        Condition("motor", 0.999999),
        Frobenius("motor", 0.999999),
        Slowest("motor", 0.999999),
        Transmission(0.999999),
        Locus("actuation", 0.1),
    ]
    for statement in held_everywhere:
        assert proved(statement, machines, domain, cube)
    # the corners are fully stretched where the edge is √2 (f + r)
    corner = math.sqrt(0.5)
    for scale, held in ((1 - 1e-9, True), (1 + 1e-9, False)):
        spans = spans_of(machines, around((scale * corner,) * 3, 0.0))
        assert all_positive(Reach(0.0), machines, spans) == held


@pytest.mark.parametrize(
    ("limits", "f", "tolerance", "held"),
    [
        ({}, 0.5, {}, False),
        ({"fold": True}, 0.5, {}, False),
        ({"fold": False}, 0.5, {}, True),
        ({"fold": False}, 0.501, {}, False),
        ({"fold": False}, 0.5, {"f": 1e-6}, False),
    ],
)
def test_a_limb_passes_its_fold_only_where_it_may_and_its_links_are_equal(
    limits: Any, f: float, tolerance: Any, held: bool
) -> None:
    made = of_equal_limbs("crr", "+++", limits, f=f, r=0.5)
    machine = Machine(made.mechanism, made.parameters, tolerance, limits, made.mode)
    box = around((0.3, 0.0, 0.0), 0.001)  # on the line of the first limb's axis
    machines = machine.within_tolerance()
    assert all_positive(Reach(0.0), machines, spans_of(machines, box)) == held


def test_parallel_slides_of_a_prrr_carry_its_workspace_along() -> None:
    """All P joints along (1, 1, 1)/√3: the reach is that of the pose moved along it."""
    along = (math.atan2(1.0, 1.0),) * 3, (math.atan2(1.0, math.sqrt(2.0)),) * 3
    machine = of_equal_limbs(
        "prrr", "+++", {"fold": False}, f=0.5, r=0.5, slide_azimuth=along[0], slide_elevation=along[1]
    )
    machines = machine.within_tolerance()
    for far in (0.0, 10.0, -20.0):
        at = natural(machines, spans_of(machines, around((far + 0.1, far - 0.2, far), 0.0)))
        for margin, expected in zip(machines.setting.reach, reach_at((0.1, -0.2, 0.0)), strict=True):
            assert float(at.margin(margin).value) == pytest.approx(expected, abs=1e-12)


def reach_at(pose: tuple[float, float, float]) -> list[float]:
    """1 − |p − p_i (1, 1, 1)| of each limb, its S d with S = √3 p_i, times |s·d|."""
    return [(1.0 - math.dist(pose, (pose[i],) * 3)) / math.sqrt(3) for i in LIMBS]


def test_coplanar_axes_prove_nothing() -> None:
    flat: dict[str, Any] = {"azimuth": (0.0, QUARTER, 0.5), "elevation": (0.0, 0.0, 0.0)}
    machines = of_equal_limbs("crr", "+++", f=0.5, r=0.4, **flat).within_tolerance()
    spans = spans_of(machines, around((0.1, 0.2, 0.3), 0.0))
    assert all_positive(Reach(0.0), machines, spans)
    assert not any(all_positive(Determinant("actuation", sign, 0.0), machines, spans) for sign in (1, -1))
    assert not all_positive(Locus("actuation", 0.1), machines, spans)


@pytest.mark.parametrize("quarters", range(-9, 10))
def test_multiples_of_a_right_angle_are_exact(quarters: int) -> None:
    angle = exact_angle(math.radians(90 * quarters))
    expected = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarters % 4]
    assert [angle.cos - expected[0], angle.sin - expected[1]] == [arb(0), arb(0)]
    near = exact_angle(math.radians(90 * quarters) + 1e-9)
    assert near.cos != expected[0] or near.sin != expected[1]


def test_a_swing_of_a_right_angle_holds_nothing_back() -> None:
    made: dict[str, dict[str, Any]] = {
        "delta": {"w": 0.2, "u": 0.1, "L": 0.5, "l": 1.0},
        "orthoglide": {"L": 1.0},
    }
    for name, sizes in made.items():
        for swing, held_back in ((1.5, 3), (QUARTER, 0), (1.5708, 0), (3.0, 0)):
            machines = of_equal_limbs(name, "+++", {"swing": swing}, **sizes).within_tolerance()
            assert len(machines.setting.within) == held_back
