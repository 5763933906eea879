"""The reference designs of proofs (lengths in metres, octant +++) with the elbows of their working mode."""

from __future__ import annotations

from typing import Any

from machines import DESIGNS
from tpm_design.mechanisms.mechanism import Mode
from tpm_design.mechanisms.uru import Uru, build

PAVED: dict[str, tuple[Any, str]] = {
    **{name: (parameters, "+++") for name, parameters in DESIGNS.items()},
    "R4": ({"db": 0.0, "dp": 0.25, "f": 0.9, "r": 1.1, "k": -1.0}, "+++"),
    "R5": (
        {"db": 0.2, "dp": 0.0, "f": (1.0, 0.9, 1.1), "r": (1.0, 1.05, 0.95), "k": (1.0, 1.5, 0.8)},
        "++-",
    ),
}


def paved_machine(name: str) -> tuple[Uru, Mode]:
    parameters, elbows = PAVED[name]
    uru = build(parameters, {})
    return uru, uru.mode(octant="+++", elbows=elbows)
