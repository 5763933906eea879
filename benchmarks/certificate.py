"""A certificate of study 01: proved by the engine, and proved again by the independent checker."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from row import Row, seconds
from tpm_design import load_study
from tpm_design.certificates.document import document
from tpm_design.certificates.verdict import Verdict, verdict
from tpm_design.checker import check_certificate

STUDY = Path(__file__).resolve().parents[1] / "studies" / "01-uru-cube.yaml"
# the result of the study with its tolerances, to 0.001 mm (lengths in m)
DESIGN = {
    "db": 0.185768, "f": 0.231877, "r": 0.1763, "k": 1.0,
    "center_x": 0.155874, "center_y": 0.155857, "center_z": 0.155926,
}  # fmt: skip
SECONDS_TARGET, CHECK_TARGET = 10.0, 600.0


def rows() -> list[Row]:
    study = load_study(STUDY)
    if study.certification is None:
        raise SystemExit("study 01 asks for no proof")
    tolerance, boxes = study.certification.tolerance, study.certification.boxes
    design = study.evaluate(DESIGN).design

    def proved() -> Verdict:
        return verdict(study.problem, design, tolerance, boxes=boxes)

    found = proved()
    ours = seconds(proved, 1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "certificate.json"
        data = document(study.problem, study.resolved(), study.study_hash, found)
        path.write_text(json.dumps(data), encoding="utf-8")
        checked = check_certificate(path)
    return [
        Row(
            "certificate of study 01",
            f"{found.outcome}: {found.boxes:,} boxes in {ours:.1f} s",
            f"{'valid' if checked.valid else 'rejected'}: {checked.leaves:,} boxes, {checked.seconds:.0f} s",
            f"{ours / checked.seconds:.3f}",
            f"≤ {SECONDS_TARGET:g} s, ≤ {CHECK_TARGET:g} s",
            found.outcome == "proved"
            and checked.valid
            and ours <= SECONDS_TARGET
            and checked.seconds <= CHECK_TARGET,
        )
    ]
