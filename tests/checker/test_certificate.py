"""A certificate is accepted as it was proved, and refused as soon as a digit of it or a claim is another."""

from __future__ import annotations

import copy
import json
import math
import random
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from prover import CENTRE, CONSTRAINTS, Certificate, prove, signed, unproved, written

from tpm_design.checker import Progress, check_certificate, reproof
from tpm_design.checker.cover import Cover, leaves
from tpm_design.checker.regions import Domain, Region
from tpm_design.errors import UsageError

QUICK = (
    "coverage",
    "conditioning_min ",
    "rotation_singularity_distance",
    "velocity_max",
    "total_link_length",
)


@pytest.fixture(scope="module")
def quick() -> Certificate:
    """Of a few requirements that are proved in a moment."""
    return prove(unproved(QUICK))


def faults(certificate: Certificate, folder: Path) -> tuple[str, ...]:
    result = check_certificate(written(certificate, folder))
    assert result.valid == (not result.faults)
    return result.faults


@pytest.mark.parametrize("metric", CONSTRAINTS)
def test_what_was_proved_is_accepted(metric: str, tmp_path: Path) -> None:
    certificate = prove(unproved([metric]))
    result = check_certificate(written(certificate, tmp_path))
    assert result.faults == ()
    trees = [cover["tree"] for statement in certificate["statements"] for cover in statement["covers"]]
    assert result.leaves == sum(tree.count(letter) for tree in trees for letter in "pon")
    assert len(result.lines) == len(certificate["statements"]) + 1


def test_any_number_of_processes_finds_the_same(
    quick: Certificate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reproof, "WORTH_A_PROCESS", 1)
    monkeypatch.setattr(reproof, "TOGETHER", 3)
    false = copy.deepcopy(quick)
    kind(false, "frobenius")["floor"] = 0.999
    for certificate in (quick, signed(false)):
        found = []
        for workers in (1, 2):
            told: list[Progress] = []
            result = check_certificate(written(certificate, tmp_path), workers=workers, watch=told.append)
            found.append((result.valid, result.lines, result.faults, result.leaves, told))
        assert found[0] == found[1]
    assert "frobenius" in found[0][2][0].lower()


def test_the_watcher_sees_all_leaves_done_in_the_end(quick: Certificate, tmp_path: Path) -> None:
    told: list[Progress] = []
    result = check_certificate(written(quick, tmp_path), watch=told.append)
    assert [progress.done for progress in told] == sorted({progress.done for progress in told})
    assert told[-1] == Progress(result.leaves, result.leaves)


def test_a_contradiction_is_told_before_anything_is_proved_again(quick: Certificate, tmp_path: Path) -> None:
    false = copy.deepcopy(quick)
    false["requirements"][1]["slack"] = 1.0
    kind(false, "frobenius")["floor"] = 0.999
    told: list[Progress] = []
    result = check_certificate(written(signed(false), tmp_path), watch=told.append)
    assert len(result.faults) == 1
    assert "slack" in result.faults[0]
    assert (result.leaves, told) == (0, [])


REGIONS: dict[str, tuple[str, dict[str, Any]]] = {
    "cylinder": (
        "{type: cylinder, radius: 20, height: 60, center: [160, 155, 150]}",
        {"form": "cylinder", "centre": list(CENTRE), "half": [0.02, 0.02, 0.03]},
    ),
    "sphere": (
        "{type: sphere, radius: 25, center: [160, 155, 150]}",
        {"form": "ellipsoid", "centre": list(CENTRE), "half": [0.025, 0.025, 0.025]},
    ),
    "ellipsoid": (
        "{type: ellipsoid, semi_axes: [20, 25, 10], center: free}",
        {"form": "ellipsoid", "centre": list(CENTRE), "half": [0.02, 0.025, 0.01]},
    ),
    "points": (
        "{type: points, points: [[0, 0, 0], [20, 10, -30]], center: [160, 155, 150]}",
        {"form": "points", "points": [list(CENTRE), [0.18, 0.165, 0.12]]},
    ),
}


@pytest.mark.parametrize("shape", REGIONS)
def test_regions_of_every_form(shape: str, tmp_path: Path) -> None:
    asked = ["conditioning_min ", "rotation_singularity_distance"]
    certificate = prove(unproved(asked, *REGIONS[shape]))
    assert faults(certificate, tmp_path) == ()
    region = certificate["region"]
    place = region["points"][1] if shape == "points" else region["centre"]
    place[2] += 0.001
    assert "region" in faults(signed(certificate), tmp_path)[0]


def test_separate_poses_are_not_shown_to_be_in_one_aspect(tmp_path: Path) -> None:
    certificate = prove(unproved(["coverage"], *REGIONS["points"]))
    assert "separate poses" in faults(certificate, tmp_path)[0]


def test_a_file_with_another_digit_is_rejected(quick: Certificate, tmp_path: Path) -> None:
    chance = random.Random(1)
    text = written(quick, tmp_path).read_text(encoding="utf-8")
    digits = [place for place, letter in enumerate(text) if letter.isdigit()]
    path = tmp_path / "altered.json"
    for place in chance.sample(digits, 300):
        other = chance.choice([digit for digit in "0123456789" if digit != text[place]])
        path.write_text(text[:place] + other + text[place + 1 :], encoding="utf-8")
        try:
            accepted = check_certificate(path).valid
        except UsageError:  # no longer JSON, or a key is another
            accepted = False
        assert not accepted, text[place - 40 : place + 40]


def kind(certificate: Certificate, name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(s for s in certificate["statements"] if s["kind"] == name)
    return found


def change(path: str, value: Any) -> Callable[[Certificate], None]:
    """Puts ``value`` at keys and places parted by dots."""
    *way, last = path.split(".")

    def mutate(certificate: Certificate) -> None:
        at: Any = certificate
        for step in way:
            at = at[int(step)] if isinstance(at, list) else at[step]
        at[int(last) if isinstance(at, list) else last] = value

    return mutate


def tree_change(name: str, edit: Callable[[str], str]) -> Callable[[Certificate], None]:
    def mutate(certificate: Certificate) -> None:
        cover = kind(certificate, name)["covers"][0]
        before, cover["tree"] = cover["tree"], edit(cover["tree"])
        assert cover["tree"] != before

    return mutate


def shrink_root(certificate: Certificate) -> None:
    interval = kind(certificate, "fastest")["covers"][0]["root"][1]
    interval[1] = math.nextafter(math.nextafter(interval[1], 0.0), 0.0)


def wider_tolerance(certificate: Certificate) -> None:
    certificate["tolerance"]["f"] = 0.02
    certificate["study"]["certify"]["tolerance"]["f"] = 20


def smaller_machine(certificate: Certificate) -> None:
    certificate["design"]["f"] = 0.16
    certificate["machine"]["parameters"]["f"] = [0.16] * 3


def larger_region(certificate: Certificate) -> None:
    certificate["study"]["region"]["size"] = [40, 50, 64]
    certificate["region"]["half"][2] = 0.032


def moved_region(certificate: Certificate) -> None:
    certificate["design"]["center_x"] = certificate["region"]["centre"][0] = 0.17


def harder_requirement(certificate: Certificate) -> None:
    certificate["study"]["constraints"][1]["min"] = certificate["requirements"][1]["min"] = 0.56


def other_elbows(certificate: Certificate) -> None:
    certificate["mode"]["elbows"] = certificate["study"]["mechanism"]["mode"]["elbows"] = "++-"
    certificate["design"]["mode"] = "+++ ++-"


def narrower_limits(certificate: Certificate) -> None:
    certificate["study"]["mechanism"]["limits"]["theta3"]["max"] = -120
    certificate["machine"]["limits"]["theta3"][1] = math.radians(-120)


FALSE: dict[str, tuple[Callable[[Certificate], None], str]] = {
    "floor of a determinant": (change("statements.1.floor", 0.95), "proved again"),
    "sign of a determinant": (change("statements.2.sign", -1), "proved again"),
    "name of a determinant": (change("statements.1.name", "rotation"), "no proved statement"),
    "floor of reach": (change("statements.0.floor", 0.2), "proved again"),
    "floor of conditioning": (change("statements.4.floor", 0.99), "proved again"),
    "drive of conditioning": (change("statements.4.drive", "joint"), "no proved statement"),
    "distance to a locus": (change("statements.5.distance", 0.2), "leave out"),
    "another requirement's statements": (change("requirements.2.statements", [0, 4]), "no proved statement"),
    "ceiling of a velocity": (change("statements.6.ceiling", 0.1), "proved again"),
    "ceiling of a length": (change("statements.7.ceiling", 1.29), "longer"),
    "statement undecided": (change("statements.1.outcome", "undecided"), "no proved statement"),
    "statement left out": (change("requirements.0.statements", [0, 1, 3]), "no proved statement"),
    "leaf removed": (tree_change("frobenius", lambda tree: tree[:-1]), "ends before"),
    "leaf added": (tree_change("frobenius", lambda tree: tree + "p"), "goes on"),
    "leaf undecided": (tree_change("frobenius", lambda tree: tree[:-1] + "u"), "undecided leaf"),
    "leaf called outside": (tree_change("frobenius", lambda tree: tree[:-1] + "o"), "leaf o"),
    "leaf called unreachable": (tree_change("locus", lambda tree: tree[:-1] + "n"), "leaf n"),
    "unreachable leaf elsewhere": (tree_change("fastest", lambda tree: tree[:-1] + "n"), "leaf n"),
    "unknown letter": (tree_change("fastest", lambda tree: tree[:-1] + "q"), "holds 'q'"),
    "no tree": (tree_change("fastest", lambda _: ""), "ends before"),
    "covers gone": (change("statements.4.covers", []), "leave out"),
    "root shrunk": (shrink_root, "leave out"),
    "tolerance of the machine alone": (change("tolerance.f", 2e-4), "tolerance"),
    "tolerance": (wider_tolerance, "longer"),
    "machine alone": (change("machine.parameters.f.1", 0.2441), "design"),
    "fixed parameter": (change("design.dp", 0.061), "design"),
    "machine": (smaller_machine, "proved again"),
    "design outside its range": (change("study.mechanism.parameters.f.min", 300), "within"),
    "value not listed": (change("study.mechanism.parameters.k.values", [2, 3]), "within"),
    "region alone": (change("region.half.0", 0.01), "region"),
    "centre alone": (change("region.centre.0", 0.161), "centre"),
    "region": (larger_region, "leave out"),
    "place of the region": (moved_region, "leave out"),
    "mode alone": (change("mode.elbows", "++-"), "mode"),
    "mode": (other_elbows, "proved again"),
    "limits alone": (change("machine.limits", {}), "limits"),
    "limits": (narrower_limits, "proved again"),
    "bound alone": (change("requirements.1.min", 0.4), "min"),
    "bound": (harder_requirement, "no proved statement"),
    "metric": (change("requirements.1.metric", "velocity_min"), "constraint in its place"),
    "options": (change("requirements.1.options.norm", "2"), "options"),
    "requirement left out": (change("requirements", []), "constraints"),
    "slack": (change("requirements.1.slack", 0.06), "slack"),
    "requirement undecided": (change("requirements.1.outcome", "undecided"), "prove it"),
    "requirement refuted": (change("requirements.1.outcome", "refuted"), "prove it"),
    "outcome": (change("outcome", "refuted"), "outcome"),
    "assumptions": (change("assumptions", []), "axis directions"),
}


@pytest.mark.parametrize("name", FALSE)
def test_a_false_claim_is_rejected_though_its_hash_is_right(
    name: str, quick: Certificate, tmp_path: Path
) -> None:
    mutate, reason = FALSE[name]
    certificate = copy.deepcopy(quick)
    mutate(certificate)
    found = faults(signed(certificate), tmp_path)
    assert any(reason in fault for fault in found), found


BREAKING: dict[str, tuple[float, tuple[float, float, float]]] = {
    "coverage": (1, (0.5, 0.155, 0.15)),
    "conditioning_min": (0.9, (0.14, 0.13, 0.12)),
    "conditioning_min ": (0.98, (0.14, 0.13, 0.12)),
    "rotation_singularity_distance": (170, (0.16, 0.155, 0.0)),
    "boundary_distance": (130, (0.14, 0.13, 0.12)),
    "singularity_margin_min": (0.9, (0.14, 0.13, 0.12)),
    "velocity_min": (20, (0.16, 0.155, 0.15)),
    "velocity_max": (1, (0.16, 0.155, 0.15)),
    "transmission_min": (0.95, (0.14, 0.13, 0.12)),
    "position_sensitivity": (1, (0.16, 0.155, 0.15)),
    "total_link_length": (1000, (0.16, 0.155, 0.15)),
}
"""Metric → a bound (in the study's units) that is missed, and a pose that shows it."""


def refuted(metric: str, bound: float) -> Certificate:
    certificate = unproved([metric])
    entry, requirement = certificate["study"]["constraints"][0], certificate["requirements"][0]
    side = "min" if requirement["min"] is not None else "max"
    scale = requirement[side] / entry[side]
    entry[side], requirement[side] = bound, bound * scale
    for statement in certificate["statements"]:
        statement["outcome"] = "undecided"
    parameters = copy.deepcopy(certificate["machine"]["parameters"])
    parameters["f"][1] += 1e-4
    requirement |= {
        "outcome": "refuted",
        "breaking": {"pose": list(BREAKING[metric][1]), "parameters": parameters},
    }
    return certificate | {"outcome": "refuted"}


@pytest.mark.parametrize("metric", [metric for metric in BREAKING if metric != "coverage"])
def test_a_refuted_requirement_fails_at_its_breaking_pose(metric: str, tmp_path: Path) -> None:
    certificate = refuted(metric, BREAKING[metric][0])
    assert faults(signed(certificate), tmp_path) == ()
    within = copy.deepcopy(certificate)
    within["requirements"][0]["breaking"]["parameters"]["f"][1] += 1e-6
    assert "tolerance" in faults(signed(within), tmp_path)[0]
    if metric != "total_link_length":
        certificate["requirements"][0]["breaking"]["pose"] = [0.36, 0.155, 0.15]
        assert "not" in faults(signed(certificate), tmp_path)[0]


def test_links_too_long_need_no_pose_to_show_it(tmp_path: Path) -> None:
    certificate = refuted("total_link_length", 1000)
    certificate["requirements"][0]["breaking"]["pose"] = None
    assert faults(signed(certificate), tmp_path) == ()
    certificate = refuted("velocity_max", 1)
    certificate["requirements"][0]["breaking"]["pose"] = None
    assert "no pose" in faults(signed(certificate), tmp_path)[0]


def test_a_statement_that_is_not_proved_may_ask_for_nothing(tmp_path: Path) -> None:
    certificate = refuted("velocity_max", 0)
    for statement in certificate["statements"]:
        statement["ceiling" if statement["kind"] == "fastest" else "floor"] = 0.0
    assert faults(signed(certificate), tmp_path) == ()
    kind(certificate, "determinant")["outcome"] = "proved"
    with pytest.raises(UsageError, match="floor is not greater than 0"):
        faults(signed(certificate), tmp_path)


def test_a_distance_of_nothing_is_kept_by_any_distance(tmp_path: Path) -> None:
    certificate = unproved(["rotation_singularity_distance"])
    certificate["study"]["constraints"][0]["min"] = certificate["requirements"][0]["min"] = 0
    assert faults(prove(certificate), tmp_path) == ()


@pytest.mark.parametrize("metric", BREAKING)
def test_a_pose_that_meets_a_requirement_does_not_refute_it(metric: str, tmp_path: Path) -> None:
    written_bound = unproved([metric])["study"]["constraints"][0]
    certificate = refuted(metric, written_bound.get("min", written_bound.get("max")))
    assert len(faults(signed(certificate), tmp_path)) == 1


def test_a_pose_out_of_reach_refutes_coverage(tmp_path: Path) -> None:
    certificate = refuted("coverage", 1)
    certificate["study"]["region"]["size"] = [600, 50, 60]
    certificate["region"]["half"][0] = 0.3
    certificate["requirements"][0]["breaking"]["pose"] = [0.46, 0.155, 0.15]
    assert faults(signed(certificate), tmp_path) == ()
    certificate["study"]["constraints"][0]["min"] = certificate["requirements"][0]["min"] = 0.9
    assert "no pose alone" in faults(signed(certificate), tmp_path)[0]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "not JSON"),
        ("[1]", "the whole file is not a mapping"),
        ("{}", "sha256 is not there"),
        ("{" * 100_000, "not JSON"),
        (json.dumps(signed({"format": 2, "study": {}})), "format is 2"),
        (json.dumps(signed({"format": 1, "study": {}})), "versions is not there"),
    ],
)
def test_a_file_that_is_no_certificate_is_refused_with_a_word(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "certificate.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match=told) as refusal:
        check_certificate(path)
    assert refusal.value.where == "certificate.json"
    assert refusal.value.remedy


@pytest.mark.parametrize(
    "path",
    ["machine", "machine.parameters.k.0", "region.half", "statements.0.kind", "statements.4.covers.0.root.1"],
)
def test_a_malformed_part_is_named(path: str, quick: Certificate, tmp_path: Path) -> None:
    certificate = copy.deepcopy(quick)
    change(path, None)(certificate)
    with pytest.raises(UsageError, match=path.split(".", maxsplit=1)[0]):
        check_certificate(written(signed(certificate), tmp_path))


def test_a_missing_file_is_refused_with_a_word(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read"):
        check_certificate(tmp_path / "none.json")


TREES = st.recursive(
    st.sampled_from("pou"), lambda half: st.builds("{}{}{}".format, st.sampled_from("xyz"), half, half)
)


@given(TREES)
def test_the_leaves_of_a_tree_fill_its_root(tree: str) -> None:
    root = ((0.1, 0.7), (-0.3, 0.2), (1.0, 1.5))
    boxes = [box for box, _ in leaves(Cover(root, tree))]
    assert sum(volume(box) for box in boxes) == volume(root)
    for index, box in enumerate(boxes):
        for other in boxes[:index]:
            pairs = zip(box, other, strict=True)
            assert any(high <= low or top <= bottom for (bottom, high), (low, top) in pairs)


def volume(box: tuple[tuple[float, float], ...]) -> Fraction:
    return math.prod((Fraction(high) - Fraction(low) for low, high in box), start=Fraction(1))


def test_several_roots_cover_a_region_only_without_a_gap() -> None:
    domain = Domain(Region("box", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), 0.0)
    whole = (-1.0, 1.0)
    lower, upper = ((-1.0, 0.25), whole, whole), ((0.25, 1.0), whole, whole)
    assert domain.covered_by([lower, upper])
    assert not domain.covered_by([lower])
    gap = math.nextafter(0.25, 1.0)
    assert not domain.covered_by([lower, ((gap, 1.0), whole, whole)])
    assert not domain.covered_by([])
