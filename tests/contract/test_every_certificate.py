"""Every mechanism is proved and its certificate checked by other means, without naming any."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_every_enclosure import tolerances
from test_every_mechanism import KINDS
from test_every_metric import good_centre

import tpm_design as tpm
from tpm_design.certificates.document import document, write_document
from tpm_design.certificates.verdict import verdict
from tpm_design.checker import check_certificate
from tpm_design.checker.mechanisms import MECHANISMS as KNOWN_TO_THE_CHECKER
from tpm_design.errors import UsageError
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.study import choose_design, dump_yaml

# of the reach: wide enough that the region is more than one box
EDGE, TOLERANCE = 0.06, 0.02


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> MechanismKind:
    found: MechanismKind = request.param
    if not found.translational:
        pytest.skip("its poses are not positions")
    return found


def study_file(kind: MechanismKind, folder: Path) -> Path:
    edge = EDGE * kind.build(kind.example, {}).reach_radius()
    data = {
        "version": 1,
        "name": "contract",
        "units": {"length": "m", "angle": "rad"},
        "mechanism": {
            "type": kind.name,
            "parameters": dict(kind.example),
            "mode": {field.name: "+" * field.length for field in kind.mode_fields} or None,
        },
        "region": {"type": "box", "size": [edge] * 3, "center": [float(v) for v in good_centre(kind.name)]},
        "objectives": [{"metric": "total_link_length", "sense": "minimize"}],
        "constraints": [
            {"metric": "coverage", "min": 1},
            {"metric": "conditioning_min", "norm": "frobenius", "min": 0.05},
        ],
        "certify": {"tolerance": {name: TOLERANCE * value for name, value in tolerances(kind).items()}},
    }
    path = folder / "study.yaml"
    path.write_text(dump_yaml({key: value for key, value in data.items() if value is not None}))
    return path


def test_a_region_is_proved_and_the_proof_checked(kind: MechanismKind, tmp_path: Path) -> None:
    study = tpm.load_study(study_file(kind, tmp_path))
    assert study.certification is not None
    design, _ = choose_design(study, {})
    found = verdict(study.problem, design, study.certification.tolerance, boxes=50_000)
    assert found.outcome == "proved", [requirement.reason for requirement in found.requirements]
    path = tmp_path / "certificate.json"
    write_document(path, document(study.problem, study.resolved(), study.study_hash, found))
    if kind.name in KNOWN_TO_THE_CHECKER:
        result = check_certificate(path)
        assert result.valid, result.faults
    else:
        with pytest.raises(UsageError, match=kind.name):
            check_certificate(path)
