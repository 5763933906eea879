"""Seconds of the first calls with one mechanism; started by itself with an empty kernel cache."""

from __future__ import annotations

import json
import sys
import time

from tpm_design.mechanisms import MECHANISMS
from tpm_design.workspace.certified_volume import certified_volume


def main() -> None:
    kind = MECHANISMS[sys.argv[1]]
    machine = kind.build(kind.example, {})
    mode = machine.mode_of({field.name: "+" * field.length for field in kind.mode_fields})
    pose = [[0.1, 0.1, 0.1]]
    began = time.perf_counter()
    machine.margins(pose, mode)
    machine.ik(pose, mode)
    machine.jacobian(pose, mode)
    pointwise = time.perf_counter() - began
    proofs = None
    if kind.translational:
        began = time.perf_counter()
        certified_volume(machine, mode, boxes=1)
        proofs = time.perf_counter() - began
    print(json.dumps({"pointwise": pointwise, "proofs": proofs}))


if __name__ == "__main__":
    main()
