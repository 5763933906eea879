"""A limb's fold inside the region breaks a requirement: told by the package, checked by the checker."""

from __future__ import annotations

from pathlib import Path

import pytest
from prover import signed, written

from tpm_design.certificates.document import document
from tpm_design.certificates.verdict import verdict
from tpm_design.checker import check_certificate
from tpm_design.study import choose_design, load_study

pytestmark = pytest.mark.xdist_group("crr")

STUDY = """\
version: 1
name: fold
units: {length: mm, angle: deg}
mechanism:
  type: crr
  parameters: {f: 200, r: {equals: f}}
  mode: {elbows: "+++"}
region: {type: REGION, center: [3, 5, 7]}
objectives:
  - {metric: total_link_length, sense: minimize}
constraints:
  - {metric: coverage, min: 1}
"""
REGIONS = (
    "box, size: [300, 200, 300]",
    "cylinder, radius: 120, height: 200",
    "ellipsoid, semi_axes: [100, 120, 80]",
)


@pytest.mark.parametrize("region", REGIONS)
def test_a_fold_inside_the_region_is_a_refutation_that_is_checked(tmp_path: Path, region: str) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(STUDY.replace("REGION", region), encoding="utf-8")
    study = load_study(path)
    design, _ = choose_design(study, {})
    found = verdict(study.problem, design, {}, boxes=10_000)
    assert found.outcome == "refuted"
    data = document(study.problem, study.resolved(), study.study_hash, found)
    assert check_certificate(written(data, tmp_path)).valid
    breaking = data["requirements"][0]["breaking"]
    x, y, z = breaking["pose"]
    half = [0.5 * 0.3, 0.5 * 0.2, 0.5 * 0.3]
    # off the line; on the surface of the region or outside
    for pose in ([x + 1e-6, y + 1e-6, z + 1e-6], [0.003 + half[0], 0.0, 0.0], [0.5, 0.0, 0.0]):
        data["requirements"][0]["breaking"] = {**breaking, "pose": pose}
        assert not check_certificate(written(signed(data), tmp_path)).valid


def test_the_fold_ignored_breaks_nothing(tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    text = STUDY.replace("REGION", REGIONS[0])
    path.write_text(text, encoding="utf-8")
    study = load_study(path)
    design, _ = choose_design(study, {})
    refuted = document(
        study.problem,
        study.resolved(),
        study.study_hash,
        verdict(study.problem, design, {}, boxes=10_000),
    )
    refuted["machine"]["limits"] = refuted["study"]["mechanism"]["limits"] = {"fold": False}
    assert not check_certificate(written(signed(refuted), tmp_path)).valid
    path.write_text(text.replace('"+++"}', '"+++"}\n  limits: {fold: false}'), encoding="utf-8")
    study = load_study(path)
    found = verdict(study.problem, design, {}, boxes=10_000)
    assert found.outcome == "proved"
    proved = document(study.problem, study.resolved(), study.study_hash, found)
    assert check_certificate(written(proved, tmp_path)).valid
