"""Searches that end with a proof: what breaks a design becomes a sample of the next round."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from small_studies import CERTIFIED
from tpm_design.certificates.document import FILE
from tpm_design.certificates.verdict import Verdict, verdict
from tpm_design.evaluation.contexts import design_context, offset_mechanism
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.problem import Problem, Sample
from tpm_design.report import write_report
from tpm_design.runs.entry import Entry
from tpm_design.runs.executors import Threads
from tpm_design.runs.folder import entry_from_json, entry_to_json, read_run
from tpm_design.runs.optimize import SearchPlan, search
from tpm_design.runs.ranking import best_entry
from tpm_design.runs.rounds import starting_entries, with_counterexamples
from tpm_design.study import Study, load_study
from tpm_design.study.actions import Run, evaluations_frame

# one worker compiles the kernels of all proofs of 3-URUs
pytestmark = pytest.mark.xdist_group("uru")

WITHIN = {"f": 1e-4, "r": 1e-4}


def study_of(folder: Path, text: str = CERTIFIED) -> Study:
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return load_study(path)


def summary(run: Run) -> Mapping[str, object]:
    assert run.folder is not None
    data: dict[str, object] = json.loads((run.folder / "run.json").read_text(encoding="utf-8"))
    return data


def certificate(run: Run) -> Mapping[str, object]:
    assert run.folder is not None
    data: dict[str, object] = json.loads((run.folder / FILE).read_text(encoding="utf-8"))
    return data


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return study_of(tmp_path_factory.mktemp("study"))


@pytest.fixture(scope="module")
def proved(study: Study, tmp_path_factory: pytest.TempPathFactory) -> Run:
    return study.optimize(output=tmp_path_factory.mktemp("proved"))


def timeless(entries: tuple[Entry, ...]) -> list[Entry]:
    return [replace(entry, evaluation=replace(entry.evaluation, seconds=0.0)) for entry in entries]


# ------------------------------------------------------------------------------------------ rounds


def test_a_refuted_optimum_is_searched_again_until_it_is_proved(study: Study, proved: Run) -> None:
    first, second = proved.result.rounds
    assert (first.outcome, second.outcome) == ("refuted", "proved")
    assert first.samples == ()
    (sample,) = second.samples
    # the shortest links within the tolerances are the worst, at the corner farthest from the base
    assert sample.offsets == {"f": (-1e-4,) * 3, "r": (-1e-4,) * 3}
    assert sample.pose == pytest.approx((0.03, 0.03, 0.03), abs=1e-12)
    assert proved.result.ending == "proved"
    assert "Proved in round 2 for every machine within the tolerances." in proved.status
    assert proved.verdict is not None
    assert proved.verdict.outcome == "proved"


def test_the_price_of_the_tolerances_is_a_design_a_little_longer(proved: Run) -> None:
    entries = {entry.number: entry.evaluation for entry in proved.result.entries}
    first, second = (entries[number.best] for number in proved.result.rounds if number.best is not None)
    longer = second.metrics["total_link_length"] - first.metrics["total_link_length"]
    # the tolerances alone take 6 × 0.1 mm of links
    assert 0.0 < longer < 1e-3
    assert proved.best == second


def test_no_machine_at_a_corner_of_the_tolerances_breaks_the_proved_design(study: Study, proved: Run) -> None:
    assert proved.best is not None
    context = design_context(study.problem, proved.best.design)
    (goal,) = study.problem.constraints
    options = {"norm": "frobenius", "drive": "motor", "over": "region"}
    for signs in product((-1e-4, 1e-4), repeat=6):
        offsets = {"f": signs[:3], "r": signs[3:]}
        machine = offset_mechanism(study.problem, context.mechanism, offsets)
        measured = goal.metric.compute(replace(context, mechanism=machine), options)
        assert measured.value + measured.error >= 0.8


def test_entries_are_numbered_through_and_name_their_round(proved: Run) -> None:
    entries = proved.result.entries
    assert [entry.number for entry in entries] == list(range(len(entries)))
    rounds = [entry.round for entry in entries]
    assert rounds == sorted(rounds)
    assert [rounds.count(one.number) for one in proved.result.rounds] == [
        one.evaluations for one in proved.result.rounds
    ]
    assert proved.evaluations["round"].tolist() == rounds
    assert len(entries) <= 120


def test_a_round_begins_with_the_best_designs_of_the_one_before(study: Study, proved: Run) -> None:
    first = [entry for entry in proved.result.entries if entry.round == 1]
    second = [entry for entry in proved.result.entries if entry.round == 2]
    starts = starting_entries(study.problem, first, 10)
    assert starts[0].number == proved.result.rounds[0].best
    designs = [entry.evaluation.design for entry in starts]
    assert [entry.evaluation.design for entry in second[:10]] == designs
    # the optimum without tolerances misses the sample, and the log says so
    again = second[0].evaluation
    assert again.status == "infeasible"
    assert again.reason == "even missed within the tolerances"
    assert again.metrics == starts[0].evaluation.metrics


def test_any_number_of_workers_gives_the_same_rounds(study: Study, proved: Run) -> None:
    other = study.optimize(workers=2)
    assert timeless(other.result.entries) == timeless(proved.result.entries)
    assert other.result.rounds == proved.result.rounds
    assert other.status == proved.status


def test_the_run_folder_keeps_rounds_samples_and_the_certificate(study: Study, proved: Run) -> None:
    assert proved.folder is not None
    data = summary(proved)
    rounds = data["rounds"]
    assert isinstance(rounds, list)
    assert [one["outcome"] for one in rounds] == ["refuted", "proved"]
    stored = rounds[1]["samples"][0]
    offsets = {name: tuple(values) for name, values in stored["offsets"].items()}
    sample = Sample(stored["label"], offsets, tuple(stored["pose"]), stored["margin"])
    assert sample == proved.result.rounds[1].samples[0]
    assert certificate(proved)["outcome"] == "proved"
    assert proved.best is not None
    assert certificate(proved)["design"] == proved.best.design
    # what is stored is enough to evaluate a design of the second round again
    run = read_run(proved.folder)
    assert run.entries == proved.result.entries
    assert run.best == best_entry(study.problem, run.entries)
    again = evaluate(replace(study.problem, samples=(sample,)), run.entries[-1].evaluation.design)
    assert again == replace(run.entries[-1].evaluation, seconds=again.seconds)


def test_the_report_says_what_is_proved_in_the_units_of_the_study(proved: Run) -> None:
    assert proved.folder is not None
    report = write_report(proved.folder)[0].read_text(encoding="utf-8")
    section = report.split("## What is proved")[1].split("\n## ")[0]
    assert "for every machine within f ± 0.1 mm, r ± 0.1 mm" in section
    (row,) = [line for line in section.splitlines() if line.startswith("| `even`")]
    assert "| proved |" in row
    assert "2 rounds" in report


def test_a_round_without_a_feasible_design_leaves_the_best_one_before_with_its_verdict(
    tmp_path: Path,
) -> None:
    """Rough tolerances, and eight evaluations for a second round: it can judge old designs again, no more."""
    text = CERTIFIED.replace("{f: 0.1, r: 0.1}", "{f: 20, r: 20}")
    run = study_of(tmp_path, text).optimize(budget=40, output=tmp_path)
    assert [one.outcome for one in run.result.rounds] == ["refuted", "infeasible"]
    assert run.verdict is not None
    assert run.verdict.outcome == "refuted"
    assert run.best is not None
    assert run.best.status == "feasible"
    assert "Refuted: even breaks for a machine within the tolerances." in run.status
    assert "Round 2 found no feasible design that holds there as well." in run.status
    assert "Raise the budget, ask for less of even or tighten the tolerances." in run.status
    assert certificate(run)["outcome"] == "refuted"
    assert certificate(run)["design"] == run.best.design


def test_too_few_boxes_leave_the_design_not_proved(tmp_path: Path) -> None:
    run = study_of(tmp_path, CERTIFIED.replace("boxes: 20000", "boxes: 20")).optimize(budget=100)
    assert run.verdict is not None
    assert run.verdict.outcome == "undecided"
    assert (
        "Not proved for every machine within the tolerances: even (1/κ_F: 20 boxes were not enough)."
        in run.status
    )
    assert "allow more boxes" in run.status


def test_nothing_is_certified_where_nothing_is_feasible(tmp_path: Path) -> None:
    run = study_of(tmp_path, CERTIFIED.replace("min: 0.8", "min: 0.99999")).optimize(
        budget=40, output=tmp_path
    )
    assert run.folder is not None
    assert run.verdict is None
    assert run.result.rounds[0].outcome == "infeasible"
    assert run.result.rounds[0].evaluations == 40
    assert not (run.folder / FILE).exists()
    assert run.status.endswith("Nothing was certified.")
    assert summary(run)["certificate"] == {"outcome": None, "requirements": {}}


def test_a_requirement_without_a_proof_starts_no_round(tmp_path: Path) -> None:
    text = CERTIFIED.replace("]\noptimizer", ", {metric: conditioning_mean, min: 0.1}]\noptimizer")
    text = text.replace("min: 0.8", "min: 0.2").replace("min: 100", "min: 150")
    run = study_of(tmp_path, text).optimize(budget=40)
    assert len(run.result.rounds) == 1
    assert run.verdict is not None
    assert run.verdict.outcome == "undecided"
    assert [one.outcome for one in run.verdict.requirements] == ["proved", "undecided"]
    assert run.result.ending == "not provable"
    assert "Nothing here proves conditioning_mean" in run.status


def test_without_a_local_method_the_studys_own_searches_near_the_best(tmp_path: Path) -> None:
    text = CERTIFIED.replace(", polish: nlopt.cobyla", "").replace("{f: 0.1, r: 0.1}", "{f: 2, r: 2}")
    run = study_of(tmp_path, text).optimize(budget=240)
    assert len(run.result.rounds) > 1
    designs = [entry.evaluation.design for entry in run.result.entries if entry.round == 2]
    starts, searched = designs[:10], designs[10:]
    middles = [(float(design["f"]), float(design["r"])) for design in starts]
    # within a fiftieth of the ranges of 300 mm around one of the designs that the round began with
    for design in searched:
        assert any(
            max(abs(float(design["f"]) - f), abs(float(design["r"]) - r)) <= 0.006 + 1e-12 for f, r in middles
        )


def test_a_study_that_asks_for_no_proof_is_searched_as_ever(study: Study, tmp_path: Path) -> None:
    plain = study_of(tmp_path, CERTIFIED.split("certify:", maxsplit=1)[0])
    run = plain.optimize(output=tmp_path)
    alone = search(
        plain.problem,
        SearchPlan("scipy.differential_evolution", 120, 1, "nlopt.cobyla"),
        executor=Threads(1),
        record=lambda entry: None,
    )
    assert run.folder is not None
    assert run.verdict is None
    assert timeless(run.result.entries) == timeless(alone.entries)
    assert {"rounds", "certificate"} & set(summary(run)) == set()
    assert not (run.folder / FILE).exists()
    assert set(evaluations_frame(plain, run.result.entries)["round"]) == {1}


# ------------------------------------------------------------------------------------------ samples


def design_of(study: Study, **values: float) -> dict[str, float | str]:
    return {**study.problem.fixed, "f": 0.2, "r": 0.15, **values}


def test_a_sample_takes_part_in_slack_violation_and_status_and_in_no_metric(study: Study) -> None:
    nominal = evaluate(study.problem, design_of(study))
    offsets = {"f": (1e-4, -1e-4, 0.0)}
    sampled = replace(study.problem, samples=(Sample("even", offsets, (0.03, 0.0, -0.03), 0.01),))
    found = evaluate(sampled, design_of(study))
    assert found.metrics == nominal.metrics
    assert found.pieces["even"][: len(nominal.pieces["even"])] == nominal.pieces["even"]
    # the region's eighths once more, and the pose
    assert len(found.pieces["even"]) == 2 * len(nominal.pieces["even"]) + 1
    unequal = {**design_of(study), "f1": 0.2001, "f2": 0.1999, "f3": 0.2}
    del unequal["f"]
    machine = evaluate(study.problem, unequal)
    assert found.slacks["even"] == pytest.approx(
        min(nominal.slacks["even"], machine.slacks["even"] - 0.01), abs=1e-12
    )


def test_a_pose_is_measured_about_the_regions_centre(study: Study) -> None:
    pose = (0.03, 0.01, -0.02)
    sampled = replace(study.problem, samples=(Sample("even", {}, pose, 0.0),))
    design = design_of(study)
    context = design_context(study.problem, design)
    x, y, z = (0.15 + step for step in pose)
    jacobian = context.mechanism.jacobian([(x, y, z)], context.mode)[0]
    inverse = np.linalg.inv(jacobian)
    expected = 3.0 / (np.linalg.norm(jacobian) * np.linalg.norm(inverse))
    assert evaluate(sampled, design).pieces["even"][-1] == pytest.approx(expected - 0.8, abs=1e-9)


def test_a_machine_that_cannot_be_built_misses(study: Study) -> None:
    sampled = replace(study.problem, samples=(Sample("even", {"f": (-0.3, 0.0, 0.0)}, None, 0.0),))
    found = evaluate(sampled, design_of(study))
    assert found.status == "infeasible"
    assert found.reason.startswith("even missed within the tolerances: ")
    assert math.isfinite(found.violation)


def refuted(problem: Problem, study: Study) -> Verdict:
    return verdict(problem, design_of(study, f=0.19, r=0.1), WITHIN, boxes=2000)


def test_the_margin_grows_each_time_a_requirement_fails_again(study: Study) -> None:
    found = refuted(study.problem, study)
    assert found.outcome == "refuted"
    once = with_counterexamples(study.problem, found, ())
    twice = with_counterexamples(study.problem, found, once)
    assert [sample.margin for sample in once] == pytest.approx([5e-4])
    assert [sample.margin for sample in twice] == pytest.approx([1e-3])
    assert [sample.offsets for sample in once] == [sample.offsets for sample in twice]


def test_a_log_line_without_a_round_is_of_the_first(study: Study) -> None:
    entry = Entry(7, evaluate(study.problem, design_of(study)), 2)
    data = entry_to_json(entry)
    assert entry_from_json(data) == entry
    assert entry_from_json({key: value for key, value in data.items() if key != "round"}).round == 1


def test_the_best_entry_is_of_the_last_round_that_has_a_feasible_one(study: Study) -> None:
    short, long = (evaluate(study.problem, design_of(study, f=f)) for f in (0.2, 0.21))
    missed = evaluate(study.problem, design_of(study, f=0.1, r=0.1))
    assert (short.status, long.status, missed.status) == ("feasible", "feasible", "infeasible")
    entries = [Entry(0, short, 1), Entry(1, long, 2), Entry(2, missed, 3)]
    best = best_entry(study.problem, entries)
    assert best is not None
    assert best.number == 1
