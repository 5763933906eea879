"""Whole certificates of mechanisms other than the 3-URU, proved by bisection with the checker's bounds."""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from closures import Machine as PlainMachine
from prover import Certificate, prove, signed, written
from test_mechanisms import metrics_at, plain_values

from tpm_design.checker import check_certificate
from tpm_design.checker.mechanisms import MECHANISMS
from tpm_design.errors import UsageError


class Case(NamedTuple):
    """Sizes in mm and degrees, as a study writes them; the rest are defaults."""

    parameters: dict[str, float]
    limits: dict[str, Any]
    tolerance: dict[str, float]
    centre: tuple[float, float, float]


LINKS: dict[str, float] = {"f": 300, "r": 250}
CASES: dict[str, Case] = {
    "crr": Case(LINKS, {"stroke": {"min": -300, "max": 400}}, {"f": 0.1, "ax2": 0.05}, (150, 170, 190)),
    "prrr": Case(
        {**LINKS, "slide_azimuth1": 20, "slide_azimuth2": 90, "slide_azimuth3": 10, "slide_elevation": 30},
        {"fold": False, "elbow": {"min": 20, "max": 170}},
        {"r": 0.1},
        (150, 170, 190),
    ),
    "crrr": Case({**LINKS, "azimuth1": 5}, {"fold": True, "link_radius": 10}, {"f1": 0.1}, (150, 170, 190)),
    "delta": Case(
        {"w": 164, "u": 44, "L": 524, "l": 1244},
        {"theta": {"min": -60, "max": 100}, "swing": 60},
        {"w": 0.1, "L": 0.1, "l2": 0.05},
        (40, 20, -900),
    ),
    "linear_delta": Case(
        {"R": 142, "r": 73, "l": 264, "rail": 600, "tilt": 10},
        {"swing": 50},
        {"r": 0.1, "rail": 1},
        (10, 20, -400),
    ),
    "orthoglide": Case({"L": 310}, {"stroke": {"min": 0, "max": 500}, "swing": 60}, {"L": 0.1}, (-20, 10, 5)),
}  # fmt: skip
HALF = 0.015
PLACED = ("boundary_distance", "actuation_singularity_distance", "translation_singularity_distance")


def in_si(mechanism: Any, case: Case) -> dict[str, list[float]]:
    found = {}
    for parameter in mechanism.parameters:
        scale = 0.001 if parameter.powers == (1, 0) else math.radians(1)
        given = [case.parameters.get(n, case.parameters.get(parameter.name)) for n in parameter.limb_names]
        found[parameter.name] = [
            float(parameter.default[limb] if value is None else scale * value)
            for limb, value in enumerate(given)
        ]
    return found


def limits_in_si(case: Case, mechanism: Any) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in case.limits.items():
        scale = 0.001 if mechanism.limits[name].powers == (1, 0) else math.radians(1)
        if isinstance(value, dict):
            found[name] = [scale * value["min"], scale * value["max"]]
        else:
            found[name] = value if isinstance(value, bool) else scale * value
    return found


@cache
def proved(name: str) -> Certificate:
    """Of every metric that has a proof, at 0.9 of the least value at the region's corners (1.1 of the
    greatest)."""
    case, mechanism = CASES[name], MECHANISMS[name]
    parameters = in_si(mechanism, case)
    plain = PlainMachine(name, parameters, (1, 1, 1))
    centre = [0.001 * part for part in case.centre]
    corners = np.asarray(centre) + HALF * np.asarray(list(itertools.product((-1, 1), repeat=3)))
    values = [metrics_at(name, plain, corner) for corner in corners]
    least = {key: 0.9 * min(getattr(v, key) for v in values) for key in values[0]._fields}
    most = {key: 1.1 * max(getattr(v, key) for v in values) for key in values[0]._fields}
    middle = plain_values(plain, np.asarray(centre), mechanism.determinants)
    shared: list[dict[str, Any]] = [
        {"kind": "determinant", "name": n, "sign": 1 if middle[n] > 0 else -1, "floor": 0.5 * abs(middle[n])}
        for n in mechanism.determinants
    ]
    drive = {"drive": "motor"}
    links = 3 * sum(parameters[link][0] for link in mechanism.links)
    asked: list[tuple[str, dict[str, Any], str, dict[str, Any]]] = [
        ("coverage", {}, "min", shared[-1]),
        ("conditioning_min", {"norm": "2", "over": "region", **drive}, "min",
         {"kind": "condition", "floor": least["condition"], **drive}),
        ("conditioning_min", {"norm": "frobenius", "over": "region", **drive}, "min",
         {"kind": "frobenius", "floor": least["frobenius"], **drive}),
        ("actuation_singularity_distance", {}, "min",
         {"kind": "locus", "name": "actuation", "distance": 0.01}),
        ("translation_singularity_distance", {}, "min", {"kind": "reach", "floor": 0.0}),
        ("boundary_distance", {}, "min", {"kind": "reach", "floor": least["reach"]}),
        ("singularity_margin_min", {}, "min", {"kind": "serial", "floor": least["serial"]}),
        ("velocity_min", drive, "min", {"kind": "slowest", "floor": least["slowest"], **drive}),
        ("velocity_max", drive, "max", {"kind": "fastest", "ceiling": most["fastest"], **drive}),
        ("transmission_min", drive, "min", {"kind": "transmission", "floor": least["transmission"]}),
        ("position_sensitivity", drive, "max",
         {"kind": "sensitivity", "ceiling": most["sensitivity"], **drive}),
        ("total_link_length", {}, "max", {"kind": "length", "ceiling": links + 0.001}),
    ]  # fmt: skip
    statements: list[dict[str, Any]] = [{"kind": "reach", "floor": 0.0}, *shared]
    constraints, requirements = [], []
    for index, (metric, options, side, statement) in enumerate(asked):
        statements.append(statement)
        proved_level = next(statement[key] for key in ("floor", "ceiling", "distance") if key in statement)
        level = {"coverage": 1.0, "translation_singularity_distance": 0.5}.get(metric, proved_level)
        if metric == "singularity_margin_min":
            level = min(level, *(float(determinant["floor"]) for determinant in shared))
        metre, radian = (1, 0) if metric in (*PLACED, "total_link_length") else (0, 0)
        if metric.startswith("velocity"):
            metre, radian = (1, -1) if name == "delta" else (0, 0)
        written_level = level * 1000**metre * (180 / math.pi) ** radian
        label = f"{metric} {index}"
        constraints.append({"metric": metric, "label": label, side: written_level, **options})
        places = [*range(1 + len(shared)), len(statements) - 1]
        requirements.append(
            {
                "label": label,
                "metric": metric,
                "options": options,
                "min": level if side == "min" else None,
                "max": level if side == "max" else None,
                "outcome": "proved",
                "slack": 0.0,
                "statements": places[-1:] if metric == "total_link_length" else places,
                "breaking": None,
                "reason": "",
            }
        )
    statements = [{**statement, "outcome": "proved", "covers": []} for statement in statements]
    design: dict[str, Any] = {}
    for parameter in mechanism.parameters:
        together = parameter.name in case.parameters
        names = [parameter.name] if together else parameter.limb_names
        design |= dict(zip(names, parameters[parameter.name], strict=False))
    return prove(
        {
            "format": 1,
            "versions": {},
            "study": {
                "units": {"length": "mm", "angle": "deg"},
                "mechanism": {
                    "type": name,
                    "parameters": case.parameters,
                    "mode": {mechanism.mode[0].name: "+++"},
                    "limits": case.limits,
                },
                "region": {"type": "box", "size": [2000 * HALF] * 3, "center": list(case.centre)},
                "constraints": constraints,
                "certify": {"tolerance": case.tolerance},
            },
            "design": design | dict(zip(("center_x", "center_y", "center_z"), centre, strict=True))
            | {"mode": "+++"},
            "machine": {"type": name, "parameters": parameters, "limits": limits_in_si(case, mechanism)},
            "mode": {mechanism.mode[0].name: "+++"},
            "tolerance": {key: 0.001 * value for key, value in case.tolerance.items()},
            "assumptions": ["axis directions are exact: misaligned axes are not covered"],
            "region": {"form": "box", "centre": centre, "half": [HALF] * 3},
            "statements": statements,
            "requirements": requirements,
            "outcome": "proved",
        }
    )  # fmt: skip


def faults(certificate: Certificate, folder: Path) -> tuple[str, ...]:
    return check_certificate(written(signed(certificate), folder)).faults


@pytest.mark.parametrize("name", CASES)
def test_every_requirement_of_a_mechanism_is_proved_again(name: str, tmp_path: Path) -> None:
    assert faults(proved(name), tmp_path) == ()


def requirement(certificate: Certificate, metric: str) -> Any:
    return next(r for r in certificate["requirements"] if r["metric"] == metric)


def statement(certificate: Certificate, kind: str) -> Any:
    return [s for s in certificate["statements"] if s["kind"] == kind][-1]


@pytest.mark.parametrize("kind", ["condition", "slowest", "fastest", "transmission", "serial", "sensitivity"])
@pytest.mark.parametrize("name", CASES)
def test_a_bound_that_does_not_hold_is_not_proved_again(name: str, kind: str, tmp_path: Path) -> None:
    certificate = copy.deepcopy(proved(name))
    found = statement(certificate, kind)
    if kind in ("fastest", "sensitivity"):
        found["ceiling"] *= 0.8
    else:
        found["floor"] *= 1.25
    assert any("proved again" in fault for fault in faults(certificate, tmp_path))


def other_default(certificate: Certificate) -> None:
    certificate["machine"]["parameters"]["azimuth"][1] += 1e-6
    certificate["design"]["azimuth2"] += 1e-6


def other_limit(certificate: Certificate) -> None:
    certificate["machine"]["limits"]["swing"] = 1.0


def other_mode(certificate: Certificate) -> None:
    certificate["mode"]["elbows"] = certificate["study"]["mechanism"]["mode"]["elbows"] = "++-"
    certificate["design"]["mode"] = "++-"


def nowhere_is_far(certificate: Certificate) -> None:
    requirement(certificate, "translation_singularity_distance")["slack"] = 0.1


CHANGED: dict[str, tuple[Callable[[Certificate], None], str]] = {
    "a default": (other_default, "where the study does not give it"),
    "a limit": (other_limit, "machine.limits.swing"),
    "a working mode": (other_mode, "proved again"),
    "slack of a singularity that it has not": (nowhere_is_far, "slack"),
}


@pytest.mark.parametrize("what", CHANGED)
def test_a_false_claim_about_a_delta_is_rejected(what: str, tmp_path: Path) -> None:
    change, reason = CHANGED[what]
    certificate = copy.deepcopy(proved("delta"))
    change(certificate)
    assert any(reason in fault for fault in faults(certificate, tmp_path))


@pytest.mark.parametrize(("fold", "told"), [(True, False), (None, True)])
def test_a_switch_is_on_where_it_is_not_written(fold: bool | None, told: bool, tmp_path: Path) -> None:
    certificate = copy.deepcopy(proved("prrr"))
    certificate["machine"]["limits"] |= {"fold": True}
    given = certificate["study"]["mechanism"]["limits"]
    del given["fold"]
    if not told:
        given["fold"] = fold
    assert faults(certificate, tmp_path) == ()
    certificate["machine"]["limits"]["fold"] = False
    assert any("machine.limits.fold" in fault for fault in faults(certificate, tmp_path))


def test_a_design_may_leave_out_what_the_study_leaves_out(tmp_path: Path) -> None:
    certificate = copy.deepcopy(proved("delta"))
    for limb in (1, 2, 3):
        del certificate["design"][f"azimuth{limb}"]
    assert faults(certificate, tmp_path) == ()


def test_a_mechanism_that_the_checker_does_not_know_is_refused_with_a_word(tmp_path: Path) -> None:
    certificate = copy.deepcopy(proved("orthoglide"))
    certificate["machine"]["type"] = certificate["study"]["mechanism"]["type"] = "puu"
    with pytest.raises(UsageError, match="the mechanism puu is not known to the checker"):
        faults(certificate, tmp_path)
    plugged = copy.deepcopy(proved("orthoglide"))
    plugged["study"]["mechanism"]["file"] = "mine.py"
    with pytest.raises(UsageError, match="it cannot be checked"):
        faults(plugged, tmp_path)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"tolerance": {"azimuth": 0.001}}, "tolerance.azimuth is not a tolerance of a length"),
        ({"mode": {"elbows": "+-"}}, "mode.elbows is not three signs"),
        ({"mode": {"elbows": "any"}}, "mode.elbows is not three signs"),
        ({"mode": {"carriages": "+++"}}, "mode.elbows is not there"),
    ],
)
def test_what_a_delta_has_not_is_named(change: dict[str, Any], told: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=told):
        faults({**copy.deepcopy(proved("delta")), **change}, tmp_path)


@pytest.mark.parametrize("name", CASES)
def test_a_statement_about_a_drive_or_determinant_of_others_is_refused(name: str, tmp_path: Path) -> None:
    for kind, key, other in (("slowest", "drive", "joint"), ("determinant", "name", "translation")):
        certificate = copy.deepcopy(proved(name))
        statement(certificate, kind)[key] = other
        with pytest.raises(UsageError, match=f"{key} is not one of"):
            faults(certificate, tmp_path)


def refuted(name: str, metric: str, bound: float, pose: list[float]) -> Certificate:
    """The certificate with one requirement that asks for more than there is."""
    certificate = copy.deepcopy(proved(name))
    place = next(i for i, r in enumerate(certificate["requirements"]) if r["metric"] == metric)
    constraint, found = certificate["study"]["constraints"][place], certificate["requirements"][place]
    side = "min" if found["min"] is not None else "max"
    constraint[side] *= bound / found[side]
    machine = copy.deepcopy(certificate["machine"]["parameters"])
    found |= {
        side: bound,
        "outcome": "refuted",
        "slack": None,
        "breaking": {"pose": pose, "parameters": machine},
    }
    for entry in certificate["statements"]:
        entry |= {"outcome": "undecided", "covers": []}
    for other in certificate["requirements"]:
        if other is not found:
            other |= {"outcome": "undecided", "slack": None}
    return certificate | {"outcome": "refuted"}


REFUTABLE = (
    "conditioning_min",
    "velocity_min",
    "velocity_max",
    "transmission_min",
    "position_sensitivity",
    "boundary_distance",
    "singularity_margin_min",
)


@pytest.mark.parametrize("metric", REFUTABLE)
@pytest.mark.parametrize("name", ["delta", "linear_delta", "orthoglide"])
def test_a_refuted_requirement_fails_at_its_breaking_pose(name: str, metric: str, tmp_path: Path) -> None:
    certificate = proved(name)
    found = requirement(certificate, metric)
    pose = certificate["region"]["centre"]
    high = metric in ("velocity_max", "position_sensitivity")
    hard = 0.5 * found["max"] if high else 2.5 * found["min"]
    assert faults(refuted(name, metric, hard, pose), tmp_path) == ()
    easy = found["max"] if high else found["min"]
    assert faults(refuted(name, metric, easy, pose), tmp_path)


def test_nothing_in_reach_breaks_the_distance_to_a_singularity_that_is_nowhere(tmp_path: Path) -> None:
    metric = "translation_singularity_distance"
    certificate = refuted("delta", metric, 5.0, [0.04, 0.02, -0.9])
    assert any("no translation singularity" in fault for fault in faults(certificate, tmp_path))
