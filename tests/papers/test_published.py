"""Published cases of every mechanism, one data file each, to all printed digits.

What is given is a number, what is to be found a string: its last digit is the tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.units import Units

FOLDER = Path(__file__).parent


def published(name: str) -> tuple[Units, list[dict[str, Any]]]:
    """The units and cases of one mechanism's data file."""
    data = YAML(typ="safe").load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"))
    assert data["source"]
    return Units(**data["units"]), data["cases"]


def all_cases() -> list[Any]:
    return [
        pytest.param(MECHANISMS[path.stem], Units(**data["units"]), case, id=f"{path.stem}-{number}")
        for path in sorted(FOLDER.glob("*.yaml"))
        for data in [YAML(typ="safe").load(path.read_text(encoding="utf-8"))]
        for number, case in enumerate(data["cases"])
    ]


def test_every_mechanism_has_published_cases() -> None:
    assert {path.stem for path in FOLDER.glob("*.yaml")} == set(MECHANISMS)


def in_si(value: Any, unit: str, units: Units) -> Any:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(in_si(item, unit, units) for item in value)
    return units.to_si(float(value), unit)


def machine_parameters(kind: MechanismKind, case: dict[str, Any], units: Units) -> dict[str, Any]:
    si = {"length": "m", "angle": "rad", "ratio": "-"}
    return {
        name: in_si(value, si[parameter.dimension], units)
        for name, value in case["parameters"].items()
        if (parameter := kind.parameter(name)) is not None
    }


def to_last_digit(found: Sequence[float], printed: Sequence[str]) -> None:
    for value, text in zip(found, printed, strict=True):
        decimals = len(text.partition(".")[2])
        assert abs(value - float(text)) <= 0.5 * 10.0**-decimals * (1.0 + 1e-9), (value, text)


@pytest.mark.parametrize(("kind", "units", "case"), all_cases())
def test_published_case(kind: MechanismKind, units: Units, case: dict[str, Any]) -> None:
    machine = kind.build(machine_parameters(kind, case, units), {})
    mode = machine.mode_of(case["mode"])
    drive = case.get("drive", kind.drives[0])
    checked = 0
    if isinstance(case["pose"][0], str):
        q = in_si(case["actuators"], kind.actuator_unit, units)
        found = np.array(
            [[units.from_si(v, u) for v, u in zip(pose, kind.pose_units, strict=True)]
             for pose in machine.fk(q, mode, drive=drive)]
        )  # fmt: skip
        nearest = found[np.abs(found - np.array(case["pose"], dtype=float)).sum(axis=1).argmin()]
        to_last_digit(nearest, case["pose"])
        return
    pose = [units.to_si(v, u) for v, u in zip(case["pose"], kind.pose_units, strict=True)]
    if "actuators" in case:
        q = machine.ik([pose], mode, drive=drive)[0]
        to_last_digit([units.from_si(value, kind.actuator_unit) for value in q], case["actuators"])
        checked += 1
    if "velocity" in case:
        values = np.linalg.svd(machine.jacobian([pose], mode, drive=drive)[0], compute_uv=False)
        to_last_digit(sorted(values), case["velocity"])
        checked += 1
    margins = machine.margins([pose], mode)
    for name, printed in case.get("margins", {}).items():
        to_last_digit(margins[name], [printed])
        checked += 1
    assert checked
