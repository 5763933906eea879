"""Problems whose optima are known: closed forms, published test functions, and the best values found by long
runs of several methods. All of them are ``Problem``s, so that every method meets the same evaluator."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any, cast

from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.mechanism import Mechanism
from tpm_design.metrics.base import Measurement, Metric
from tpm_design.metrics.context import Context
from tpm_design.problem import Goal, Problem, Variable
from tpm_design.study import load_study

STUDIES = Path(__file__).resolve().parents[1] / "studies"

Formula = Callable[[Mapping[str, float]], float]


@dataclass(frozen=True)
class KnownOptimum:
    """``optimum``: the first objective's best value, SI, and where it is known from; ``budget``: evaluations,
    those of the study where there is one."""

    name: str
    problem: Problem
    optimum: float
    source: str
    budget: int = 2000


def known_optima() -> tuple[KnownOptimum, ...]:
    """The problems of the table."""
    return (
        KnownOptimum(
            "orthoglide edge",
            load_study(STUDIES / "04-orthoglide-velocity.yaml").problem,
            3.0 * 0.2 / 0.6439506,
            "closed form, edge/L = 0.6439506",
            3000,
        ),
        KnownOptimum(
            "crr cube",
            load_study(STUDIES / "03-crr-cube.yaml").problem,
            3.0 * 0.3 * math.sqrt(5.0) / 2.0,
            "closed form, f + r = a√5/2",
            1500,
        ),
        KnownOptimum(
            "crr cube, folded", folded_crr(), 3.0 * 0.3 / math.sqrt(2.0), "convex, f + r = a/√2", 1500
        ),
        KnownOptimum("uru reach", uru_reach(), 3.0 * 0.326803, "convex, f + r = √(a²/4 + 2(a+μ)²)"),
        KnownOptimum(
            "uru cube", load_study(STUDIES / "01-uru-cube.yaml").problem, BEST_URU_CUBE, "best known", 4000
        ),
        KnownOptimum(
            "uru volume", load_study(STUDIES / "02-uru-volume.yaml").problem, BEST_URU_VOLUME, "best known"
        ),
        KnownOptimum("spring", spring(), 0.012665233, "Arora 1989; Coello 2000"),
        KnownOptimum("pressure vessel", pressure_vessel(), 6059.714335, "Sandgren 1990; Kannan, Kramer 1994"),
        KnownOptimum("speed reducer", speed_reducer(), 2994.471066, "Golinski 1973; Mezura-Montes 2007"),
    )


BEST_URU_CUBE = 1.2179884
BEST_URU_VOLUME = 0.2208859
"""Best values (m, m³) of differential evolution with COBYLA, 16,000 evaluations each; its seeds agree to six
digits."""


def _changed(study: str, *pairs: tuple[str, str]) -> Problem:
    text = (STUDIES / study).read_text(encoding="utf-8")
    for old, new in pairs:
        if old not in text:
            raise ValueError(f"{study} holds no {old!r}")
        text = text.replace(old, new)
    with TemporaryDirectory() as folder:
        path = Path(folder) / study
        path.write_text(text, encoding="utf-8")
        return load_study(path).problem


def folded_crr() -> Problem:
    """Study 03 with the fold ignored: then the axes pass through the cube's centre."""
    return _changed(
        "03-crr-cube.yaml", ('mode: {elbows: "+++"}', 'mode: {elbows: "+++"}\n  limits: {fold: false}')
    )


def uru_reach() -> Problem:
    """A cube of 0.2 m at least 20 mm from the coordinate planes, within outer and inner reach alone."""
    study = (STUDIES / "01-uru-cube.yaml").read_text(encoding="utf-8")
    constraints = study[study.index("constraints:") : study.index("optimizer:")]
    return _changed(
        "01-uru-cube.yaml",
        (constraints, "constraints:\n  - {metric: boundary_distance, min: 0}\n"),
        (
            "center: free",
            "center: {x: {min: 120, max: 900}, y: {min: 120, max: 900}, z: {min: 120, max: 900}}",
        ),
        ("record: [{metric: conditioning_mean, label: gci}]", "record: []"),
    )


def spring() -> Problem:
    """Weight of a tension spring: wire d, coil D, N active coils (inches)."""

    def shear(v: Mapping[str, float]) -> float:
        d, coil = v["d"], v["D"]
        curved = (4 * coil**2 - d * coil) / (12566 * (coil * d**3 - d**4))
        return 1 - curved - 1 / (5108 * d**2)

    return function_problem(
        "spring",
        (_number("d", 0.05, 2.0), _number("D", 0.25, 1.3), _number("N", 2.0, 15.0)),
        lambda v: (v["N"] + 2) * v["D"] * v["d"] ** 2,
        0.01,
        {
            "deflection": lambda v: v["D"] ** 3 * v["N"] / (71785 * v["d"] ** 4) - 1,
            "shear": shear,
            "surge": lambda v: 140.45 * v["d"] / (v["D"] ** 2 * v["N"]) - 1,
            "diameter": lambda v: 1 - (v["d"] + v["D"]) / 1.5,
        },
    )


def pressure_vessel() -> Problem:
    """Cost of a vessel: shell and head of plates in sixteenths of an inch, radius R, length L (inches)."""
    plates = tuple(0.0625 * count for count in range(1, 100))
    return function_problem(
        "pressure vessel",
        (
            Variable("shell", "ratio", values=plates),
            Variable("head", "ratio", values=plates),
            _number("R", 10.0, 200.0),
            _number("L", 10.0, 200.0),
        ),
        lambda v: (
            0.6224 * v["shell"] * v["R"] * v["L"]
            + 1.7781 * v["head"] * v["R"] ** 2
            + 3.1661 * v["shell"] ** 2 * v["L"]
            + 19.84 * v["shell"] ** 2 * v["R"]
        ),
        6000.0,
        {
            "shell_stress": lambda v: v["shell"] - 0.0193 * v["R"],
            "head_stress": lambda v: v["head"] - 0.00954 * v["R"],
            "volume": lambda v: (
                (math.pi * v["R"] ** 2 * v["L"] + 4 / 3 * math.pi * v["R"] ** 3) / 1_296_000 - 1
            ),
            "length": lambda v: 1 - v["L"] / 240,
        },
    )


def speed_reducer() -> Problem:
    """Weight of a gear box: face b, module m, z teeth, shafts of length l and diameter d (cm)."""

    def first_shaft(v: Mapping[str, float]) -> float:
        bending = math.hypot(745 * v["l1"] / (v["m"] * v["z"]), math.sqrt(16.9e6))
        return 1 - bending / (110 * v["d1"] ** 3)

    def second_shaft(v: Mapping[str, float]) -> float:
        bending = math.hypot(745 * v["l2"] / (v["m"] * v["z"]), math.sqrt(157.5e6))
        return 1 - bending / (85 * v["d2"] ** 3)

    def weight(v: Mapping[str, float]) -> float:
        gear = 0.7854 * v["b"] * v["m"] ** 2 * (3.3333 * v["z"] ** 2 + 14.9334 * v["z"] - 43.0934)
        squares, cubes = v["d1"] ** 2 + v["d2"] ** 2, v["d1"] ** 3 + v["d2"] ** 3
        shafts = 0.7854 * (v["l1"] * v["d1"] ** 2 + v["l2"] * v["d2"] ** 2)
        return gear - 1.508 * v["b"] * squares + 7.4777 * cubes + shafts

    return function_problem(
        "speed reducer",
        (
            _number("b", 2.6, 3.6),
            _number("m", 0.7, 0.8),
            Variable("z", "ratio", values=tuple(float(count) for count in range(17, 29))),
            _number("l1", 7.3, 8.3),
            _number("l2", 7.3, 8.3),
            _number("d1", 2.9, 3.9),
            _number("d2", 5.0, 5.5),
        ),
        weight,
        3000.0,
        {
            "bending": lambda v: 1 - 27 / (v["b"] * v["m"] ** 2 * v["z"]),
            "contact": lambda v: 1 - 397.5 / (v["b"] * v["m"] ** 2 * v["z"] ** 2),
            "first_deflection": lambda v: 1 - 1.93 * v["l1"] ** 3 / (v["m"] * v["z"] * v["d1"] ** 4),
            "second_deflection": lambda v: 1 - 1.93 * v["l2"] ** 3 / (v["m"] * v["z"] * v["d2"] ** 4),
            "first_shaft": first_shaft,
            "second_shaft": second_shaft,
            "space": lambda v: 1 - v["m"] * v["z"] / 40,
            "narrow": lambda v: v["b"] / v["m"] / 5 - 1,
            "wide": lambda v: 1 - v["b"] / v["m"] / 12,
            "first_length": lambda v: 1 - (1.5 * v["d1"] + 1.9) / v["l1"],
            "second_length": lambda v: 1 - (1.1 * v["d2"] + 1.9) / v["l2"],
        },
    )


def _number(name: str, lower: float, upper: float) -> Variable:
    return Variable(name, "ratio", lower, upper)


def function_problem(
    name: str,
    variables: tuple[Variable, ...],
    objective: Formula,
    scale: float,
    constraints: Mapping[str, Formula],
) -> Problem:
    """Minimise a function of numbers where others are ≥ 0: a problem whose "mechanism" is its variables."""
    names = [variable.name for variable in variables]
    kind = replace(
        MECHANISMS["crr"],
        name=name,
        parameters=tuple(
            replace(MECHANISMS["crr"].parameters[0], name=n, per_limb=False, dimension="ratio") for n in names
        ),
        build=_numbers,
    )

    def goal(label: str, formula: Formula, scale: float, **asked: Any) -> Goal:
        metric = Metric(label, "-", "minimize", scale, label, name, _measured(formula), needs_region=False)
        return Goal(metric, label, **asked)

    return Problem(
        kind=kind,
        fixed={"mode": "only"},
        variables=variables,
        modes={"only": {}},
        limits={},
        region=None,
        objectives=(goal("objective", objective, scale, sense="minimize"),),
        constraints=tuple(goal(label, f, 1.0, minimum=0.0) for label, f in constraints.items()),
        record=(),
    )


def _numbers(values: Mapping[str, Any], limits: Mapping[str, Any]) -> Mechanism:
    machine = SimpleNamespace(values=dict(values), mode_of=lambda fields: None)
    return cast(Mechanism, machine)


def _measured(formula: Formula) -> Callable[[Context, Mapping[str, Any]], Measurement]:
    def compute(context: Context, options: Mapping[str, Any]) -> Measurement:
        return Measurement(formula(cast(Any, context.mechanism).values))

    return compute
