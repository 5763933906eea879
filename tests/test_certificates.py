"""Requirements settled over a region: what is proved, what is refuted, and what is said where neither is."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tpm_design as tpm
from tpm_design.certificates.demands import NoProofError, demands
from tpm_design.certificates.document import document
from tpm_design.certificates.machines import perturbed
from tpm_design.certificates.tolerances import largest_tolerance
from tpm_design.certificates.verdict import Requirement, Verdict, check_tolerances, verdict
from tpm_design.errors import ParameterError
from tpm_design.mechanisms import mechanism, mechanism_kind
from tpm_design.metrics import METRICS
from tpm_design.problem import Goal
from tpm_design.study import Study

# one worker compiles the kernels of all proofs of 3-URUs
pytestmark = pytest.mark.xdist_group("uru")

BOXES = 100_000
TOLERANCE = {"db": 1e-4, "f": 1e-4, "r": 1e-4}
GOOD = """\
version: 1
name: small-cube
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters: {db: 190, dp: 60, f: {min: 200, max: 300}, r: {min: 150, max: 250}, k: 1}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [100, 100, 100], center: [160, 160, 160]}
objectives: [{metric: total_link_length, sense: minimize}]
constraints:
  - {metric: coverage, min: 1}
  - {metric: conditioning_min, min: 0.3}
  - {metric: actuation_singularity_distance, min: 20}
  - {metric: total_link_length, label: length, max: 1500}
certify: {tolerance: {db: 0.1, f: 0.1, r: 0.1}, boxes: 100000}
"""
DESIGN = {"f": 0.24, "r": 0.18}


def study_of(folder: Path, text: str) -> Study:
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return tpm.load_study(path)


def settled(study: Study, tolerance: dict[str, float], **values: float) -> Verdict:
    design = study.evaluate({**DESIGN, **values}).design
    return verdict(study.problem, design, tolerance, boxes=BOXES)


def by_label(found: Verdict) -> dict[str, Requirement]:
    return {requirement.goal.label: requirement for requirement in found.requirements}


def test_a_good_design_is_proved_for_every_machine_within_tolerance(tmp_path: Path) -> None:
    found = settled(study_of(tmp_path, GOOD), TOLERANCE)
    assert found.outcome == "proved"
    assert {requirement.outcome for requirement in found.requirements} == {"proved"}
    slack = by_label(found)["length"].slack
    # six links, each longer by its tolerance
    assert slack == pytest.approx(1.5 - 3.0 * 0.42 - 6e-4, abs=1e-12)


def test_machines_within_tolerance_keep_the_proved_slack(tmp_path: Path) -> None:
    """Machines with unequal limbs, anywhere within the tolerances, measured by search."""
    study = study_of(tmp_path, GOOD)
    found = settled(study, TOLERANCE)
    proved = {requirement.goal.label: requirement.slack for requirement in found.requirements}
    random = np.random.default_rng(5)
    for _ in range(40):
        offsets = {
            name: tuple(random.choice([-1.0, 1.0, random.uniform(-1.0, 1.0)], 3) * bound)
            for name, bound in TOLERANCE.items()
        }
        machine = perturbed(study.problem, found.context.mechanism, offsets)
        assert machine is not None
        context = replace(found.context, mechanism=machine)
        for goal in study.problem.constraints:
            value = goal.metric.compute(context, goal.options).value
            if goal.label == "coverage":
                assert value == 1.0
            elif goal.minimum is not None:
                assert value >= goal.minimum + (proved[goal.label] or 0.0) - 1e-9
            else:
                assert goal.maximum is not None
                assert value <= goal.maximum - (proved[goal.label] or 0.0) + 1e-9


def test_a_broken_requirement_is_refuted_at_a_pose_that_breaks_it(tmp_path: Path) -> None:
    study = study_of(tmp_path, GOOD.replace("conditioning_min, min: 0.3", "conditioning_min, min: 0.7"))
    found = settled(study, {})
    requirement = by_label(found)["conditioning_min"]
    assert (found.outcome, requirement.outcome) == ("refuted", "refuted")
    assert requirement.breaking is not None and requirement.breaking.pose is not None
    jacobian = found.context.mechanism.jacobian([requirement.breaking.pose], found.context.mode)[0]
    values = np.linalg.svd(jacobian, compute_uv=False)
    assert values[-1] / values[0] < 0.7
    assert by_label(found)["coverage"].outcome == "proved"


def test_a_distance_that_is_asked_for_in_vain_is_refuted_at_a_singular_pose(tmp_path: Path) -> None:
    study = study_of(tmp_path, GOOD.replace("distance, min: 20", "distance, min: 200"))
    found = settled(study, {})
    requirement = by_label(found)["actuation_singularity_distance"]
    assert requirement.outcome == "refuted"
    assert requirement.breaking is not None and requirement.breaking.pose is not None
    pose = requirement.breaking.pose
    assert abs(found.context.mechanism.margins([pose], found.context.mode)["actuation"][0]) < 1e-4
    assert np.linalg.norm(np.maximum(np.abs(np.array(pose) - 0.16) - 0.05, 0.0)) < 0.2


def test_a_region_out_of_reach_is_refuted(tmp_path: Path) -> None:
    found = settled(study_of(tmp_path, GOOD.replace("[160, 160, 160]", "[260, 260, 260]")), {})
    assert by_label(found)["coverage"].outcome == "refuted"


def test_a_bound_between_the_nominal_and_the_worst_machine(tmp_path: Path) -> None:
    """Proved for the exact machine, refuted within the tolerances, by a machine that is within them."""
    study = study_of(tmp_path, GOOD)
    worst = {s.demand.kind: s for s in settled(study, TOLERANCE).settlements}["condition"]
    exact = {s.demand.kind: s for s in settled(study, {}).settlements}["condition"]
    bound = 0.3 + 0.5 * (worst.found + exact.found)
    asked = study_of(tmp_path, GOOD.replace("conditioning_min, min: 0.3", f"conditioning_min, min: {bound}"))
    assert by_label(settled(asked, {}))["conditioning_min"].outcome == "proved"
    found = settled(asked, TOLERANCE)
    requirement = by_label(found)["conditioning_min"]
    assert requirement.outcome == "refuted"
    assert requirement.breaking is not None
    nominal = found.context.mechanism.parameters
    for name, values in requirement.breaking.parameters.items():
        off = np.abs(np.array(values) - np.array(nominal[name]))
        assert (off <= TOLERANCE.get(name, 0.0) * (1 + 1e-9)).all()


def test_what_has_no_proof_is_undecided_and_says_so(tmp_path: Path) -> None:
    study = study_of(
        tmp_path, GOOD.replace("total_link_length, label: length, max: 1500", "conditioning_mean, min: 0.1")
    )
    found = settled(study, {})
    requirement = by_label(found)["conditioning_mean"]
    assert (found.outcome, requirement.outcome) == ("undecided", "undecided")
    assert "no proof" in requirement.reason


def test_too_few_boxes_leave_a_requirement_undecided(tmp_path: Path) -> None:
    study = study_of(tmp_path, GOOD)
    design = study.evaluate(DESIGN).design
    found = verdict(study.problem, design, {}, boxes=20)
    requirement = by_label(found)["conditioning_min"]
    assert requirement.outcome == "undecided"
    assert "20 boxes" in requirement.reason


def test_the_result_does_not_depend_on_the_number_of_threads(tmp_path: Path) -> None:
    study = study_of(tmp_path, GOOD)
    design = study.evaluate(DESIGN).design
    texts = [
        json.dumps(
            document(
                study.problem,
                study.resolved(),
                study.study_hash,
                verdict(study.problem, design, TOLERANCE, boxes=BOXES, workers=workers),
            )
        )
        for workers in (1, 4)
    ]
    assert texts[0] == texts[1]


def test_the_largest_tolerance_lies_between_a_proof_and_a_failure(tmp_path: Path) -> None:
    study = study_of(tmp_path, GOOD)
    design = study.evaluate(DESIGN).design
    attempts: list[tuple[float, str]] = []
    found = largest_tolerance(
        study.problem, design, TOLERANCE, boxes=5000, watch=lambda *attempt: attempts.append(attempt)
    )
    assert found.failed is not None
    assert 1.0 < found.factor < found.failed <= 1.02 * found.factor
    assert max(factor for factor, outcome in attempts if outcome == "proved") == found.factor
    assert min(factor for factor, outcome in attempts if outcome != "proved") == found.failed


def test_tolerances_of_one_limb_are_its_own(tmp_path: Path) -> None:
    study = study_of(tmp_path, GOOD)
    one = settled(study, {"f2": 1e-4}).context.mechanism.enclosed_geometry({"f2": 1e-4})
    widths = [length.hi - length.lo for length in one.proximal]
    assert widths[0] == widths[2] == 0.0
    assert widths[1] == pytest.approx(2e-4)


@pytest.mark.parametrize("name", sorted(METRICS))
def test_every_metric_has_demands_or_says_that_it_has_none(name: str) -> None:
    metric = METRICS[name]
    kind = mechanism_kind("uru")
    options = {option.name: option.default for option in metric.options}
    bound = {"minimum": 0.5} if metric.better == "maximize" else {"maximum": 0.5}
    goal = Goal(metric, name, options, **bound)  # type: ignore[arg-type]
    try:
        needed = demands(goal, kind, [1.0] * len(kind.determinants))
    except NoProofError as reason:
        assert name in str(reason)
    else:
        assert needed[-1].bound == 0.5 or name == "coverage"
    both = Goal(metric, name, options, minimum=0.1, maximum=0.9)
    with pytest.raises(NoProofError):
        demands(both, kind, [1.0] * len(kind.determinants))


@pytest.mark.parametrize(("name", "bound"), [("f", 0.5), ("r", 0.2), ("k", 1.0), ("db", 0.2)])
def test_a_tolerance_that_is_as_large_as_its_parameter_is_refused(name: str, bound: float) -> None:
    machine = mechanism("uru", db=0.1, dp=0.06, f=0.2, r=0.2, k=1.0)
    with pytest.raises(ParameterError, match=f"tolerance of {name}"):
        check_tolerances(machine, {name: bound})
    check_tolerances(machine, {name: 0.05})
