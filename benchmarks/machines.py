"""The reference designs that the benchmarks work on (lengths in metres, octant and elbows +++)."""

from __future__ import annotations

from tpm_design.mechanisms.uru import Uru, build

DESIGNS = {
    "R1": {"db": 0.0, "dp": 0.0, "f": 1.0, "r": 1.0, "k": 1.0},
    "R2": {"db": 0.3, "dp": 0.0, "f": 1.0, "r": 1.0, "k": 1.0},
    "R3": {"db": 0.3, "dp": 0.0, "f": 1.0, "r": 0.8, "k": 0.5},
}


def machine(name: str) -> Uru:
    return build(DESIGNS[name], {})
