"""`compare` and `reproduce` from the command line, on real runs."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import STUDY, Outcome, tpm_design, written

import tpm_design as tpm
from small_studies import CERTIFIED
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.runs.folder import read_run
from tpm_design.runs.tables import csv_line, designs_table

LENGTH = "total_link_length [mm]"


def searched(folder: Path, *options: str, text: str = STUDY) -> Path:
    """The run folder of a search below ``folder``."""
    study = written(folder, text)
    data = tpm_design("optimize", study, "--output", folder, "--workers", "1", "--json", *options)
    return Path(json.loads(data.output)["run"])


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return searched(tmp_path_factory.mktemp("finished"))


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    """A copy of a run."""
    return shutil.copytree(finished, tmp_path / "run")


@pytest.fixture
def baseline(finished: Path, tmp_path: Path) -> Path:
    """A baseline made from the run."""
    folder = tmp_path / "baselines" / "small"
    assert tpm_design("compare", folder, finished, "--update-baseline").code == 0
    return folder


def edit(path: Path, change: Callable[[dict[str, str]], dict[str, str]]) -> None:
    """Change every row of a table."""
    rows = [change(row) for row in csv.DictReader(io.StringIO(path.read_text(encoding="utf-8")))]
    lines = [list(rows[0]), *(list(row.values()) for row in rows)]
    path.write_text("".join(map(csv_line, lines)), encoding="utf-8")


def scaled(column: str, factor: float) -> Callable[[dict[str, str]], dict[str, str]]:
    return lambda row: {**row, column: repr(float(row[column]) * factor)}


def as_sweep(folder: Path) -> None:
    """What a sweep leaves: every evaluation is its result."""
    path = folder / "run.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(summary | {"sweep": {"shard": "1/1"}}), encoding="utf-8")
    (folder / "designs.csv").unlink()


def test_a_baseline_holds_what_is_compared_and_nothing_else(finished: Path, baseline: Path) -> None:
    assert {path.name for path in baseline.iterdir()} == {"study.yaml", "designs.csv", "run.json"}
    for path in baseline.iterdir():
        assert path.read_bytes() == (finished / path.name).read_bytes()
    outcome = tpm_design("compare", baseline, finished)
    assert (outcome.code, outcome.errors) == (0, "")
    assert outcome.output.startswith("small: within tolerance (designs.csv, 1 row, ")
    assert tpm_design("compare", baseline, finished, "--quiet") == Outcome(0, "", "")


def test_the_same_search_again_is_the_same_result(baseline: Path, tmp_path: Path) -> None:
    again = searched(tmp_path, "--workers", "2")
    assert tpm_design("compare", baseline, again, "--rtol", "0").code == 0


def test_another_search_deviates_and_the_remark_says_why(baseline: Path, tmp_path: Path) -> None:
    other = searched(tmp_path, "--seed", "2")
    outcome = tpm_design("compare", baseline, other, "--quiet")
    assert outcome.code == 4
    assert "Searched otherwise: optimizer.seed 1 → 2." in outcome.output


def test_every_exceedance_is_printed_and_ends_with_4(baseline: Path, run: Path) -> None:
    edit(run / "designs.csv", scaled(LENGTH, 1.001))
    edit(run / "designs.csv", lambda row: {**row, "status": "infeasible"})
    outcome = tpm_design("compare", baseline, run)
    assert outcome.code == 4
    lines = [line for line in outcome.output.splitlines() if line.startswith("rank 1 ")]
    assert [line.split()[2] for line in lines] == ["status", "total_link_length"]
    assert "(0.001 of it)" in lines[1]
    assert "small: outside tolerance, 2 exceedances" in outcome.output
    assert tpm_design("compare", baseline, run, "--rtol", "0.01").code == 4
    edit(run / "designs.csv", lambda row: {**row, "status": "feasible"})
    assert tpm_design("compare", baseline, run, "--rtol", "0.01").code == 0
    assert tpm_design("compare", baseline, run, "--atol", "1e4").code == 0


def test_json_is_all_there_is_on_standard_output(baseline: Path, run: Path) -> None:
    edit(run / "designs.csv", scaled(LENGTH, 1.001))
    outcome = tpm_design("compare", baseline, run, "--rtol", "1e-4", "--json")
    data = json.loads(outcome.output)
    assert (outcome.code, outcome.errors, data["within"], data["written"]) == (4, "", False, [])
    (found,) = data["exceedances"]
    assert (found["row"], found["column"]) == ("rank 1", LENGTH)
    assert found["deviation"] == pytest.approx(10.0 * found["allowed"], rel=1e-6)
    assert data["values"] == data["identical"] + 1


def test_files_for_continuous_integration_are_written_in_both_cases(
    baseline: Path, run: Path, tmp_path: Path
) -> None:
    junit, markdown = tmp_path / "comparison.xml", tmp_path / "comparison.md"
    files = ("--junit", junit, "--markdown", markdown)
    assert tpm_design("compare", baseline, run, *files).code == 0
    assert "<failure" not in junit.read_text(encoding="utf-8")
    assert markdown.read_text(encoding="utf-8").startswith("### small: within tolerance\n")
    edit(run / "designs.csv", scaled(LENGTH, 1.001))
    assert tpm_design("compare", baseline, run, *files).code == 4
    assert junit.read_text(encoding="utf-8").count("<failure") == 1
    assert "| rank 1 | total\\_link\\_length" in markdown.read_text(encoding="utf-8")
    outcome = tpm_design("compare", baseline, run, "--junit", tmp_path / "none" / "comparison.xml")
    assert outcome.code == 2
    assert str(tmp_path / "none" / "comparison.xml") in outcome.errors


def test_a_sweep_is_compared_point_by_point(run: Path, tmp_path: Path) -> None:
    as_sweep(run)
    baseline = tmp_path / "sweep"
    assert tpm_design("compare", baseline, run, "--update-baseline").code == 0
    assert {path.name for path in baseline.iterdir()} == {"study.yaml", "evaluations.csv", "run.json"}
    table = run / "evaluations.csv"
    edit(table, lambda row: {**row, "seconds [s]": "1.0"})
    assert tpm_design("compare", baseline, run).code == 0
    edit(table, lambda row: {**row, "reason": "slipped"} if row["id"] == "3" else row)
    lines = table.read_text(encoding="utf-8").splitlines(keepends=True)
    table.write_text("".join(lines[:-1]), encoding="utf-8")
    data = json.loads(tpm_design("compare", baseline, run, "--json").output)
    assert data["rows"] == len(lines) - 2
    assert [(one["row"], one["column"]) for one in data["exceedances"]] == [
        ("id 3", "reason"),
        (f"id {len(lines) - 2}", ""),
    ]


def test_a_baseline_changes_only_when_asked_and_says_what_it_takes_over(baseline: Path, run: Path) -> None:
    edit(run / "designs.csv", scaled(LENGTH, 1.001))
    before = (baseline / "designs.csv").read_bytes()
    assert tpm_design("compare", baseline, run).code == 4
    assert (baseline / "designs.csv").read_bytes() == before
    outcome = tpm_design("compare", baseline, run, "--update-baseline", "--quiet")
    assert outcome.code == 0
    assert "outside tolerance, 1 exceedance" in outcome.output
    assert f"Baseline written from {run}:\n" in outcome.output
    assert (baseline / "designs.csv").read_bytes() == (run / "designs.csv").read_bytes()
    assert tpm_design("compare", baseline, run, "--rtol", "0").code == 0


def test_a_changed_study_is_refused_until_it_is_made_the_baseline(baseline: Path, tmp_path: Path) -> None:
    other = searched(tmp_path, "--budget", "8", text=STUDY.replace("min: 0.2", "min: 0.21"))
    outcome = tpm_design("compare", baseline, other)
    assert (outcome.code, outcome.output) == (2, "")
    assert "The studies ask something else: constraints.2.min 0.2 → 0.21.\n" in outcome.errors
    assert tpm_design("compare", baseline, other, "--update-baseline").code == 0
    assert tpm_design("compare", baseline, other).code == 0


def test_a_proof_that_is_lost_deviates(baseline: Path, run: Path) -> None:
    for folder, outcome in ((baseline, "proved"), (run, "undecided")):
        path = folder / "run.json"
        summary = json.loads(path.read_text(encoding="utf-8"))
        requirements = {"coverage": {"outcome": "proved"}, "conditioning_min": {"outcome": outcome}}
        path.write_text(
            json.dumps(summary | {"certificate": {"requirements": requirements}}), encoding="utf-8"
        )
    data = tpm_design("compare", baseline, run, "--json")
    (found,) = json.loads(data.output)["exceedances"]
    assert data.code == 4
    assert [found[name] for name in ("row", "column", "baseline", "run")] == [
        *("run.json", "verdict on conditioning_min", "proved", "undecided")
    ]


def renamed(baseline: Path, run: Path) -> None:
    path = run / "study.yaml"
    path.write_text(path.read_text(encoding="utf-8").replace("name: small", "name: other"), encoding="utf-8")


def without_summary(baseline: Path, run: Path) -> None:
    (run / "run.json").unlink()


def interrupted(baseline: Path, run: Path) -> None:
    path = run / "run.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(summary | {"ending": "interrupted"}), encoding="utf-8")


def without_designs(baseline: Path, run: Path) -> None:
    (run / "designs.csv").unlink()


def emptied(baseline: Path, run: Path) -> None:
    shutil.rmtree(run)
    run.mkdir()


def swept(baseline: Path, run: Path) -> None:
    as_sweep(run)


def both_without_rows(baseline: Path, run: Path) -> None:
    for folder in (baseline, run):
        table = folder / "designs.csv"
        table.write_text(table.read_text(encoding="utf-8").splitlines()[0] + "\n", encoding="utf-8")


def cut_short(baseline: Path, run: Path) -> None:
    table = run / "designs.csv"
    table.write_bytes(table.read_bytes()[:-30])


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (renamed, "The studies ask something else: name small → other."),
        (without_summary, "This run did not come to its end."),
        (interrupted, "This run did not come to its end."),
        (without_designs, "There is no designs.csv here."),
        (emptied, "There is no result here."),
        (swept, "Only one of these is a sweep."),
        (both_without_rows, "There is nothing to compare"),
        (cut_short, "designs.csv:2: This table cannot be compared"),
    ],
)
def test_what_cannot_be_compared_is_one_message(
    spoil: Callable[[Path, Path], None], said: str, baseline: Path, run: Path, tmp_path: Path
) -> None:
    spoil(baseline, run)
    junit = tmp_path / "comparison.xml"
    outcome = tpm_design("compare", baseline, run, "--junit", junit)
    assert (outcome.code, outcome.output) == (2, "")
    assert said in outcome.errors
    assert not junit.exists()


@pytest.mark.parametrize("spoil", [renamed, without_summary, interrupted, without_designs, emptied, swept])
def test_no_baseline_is_made_of_what_is_not_a_result_of_its_study(
    spoil: Callable[[Path, Path], None], baseline: Path, run: Path
) -> None:
    before = {path.name: path.read_bytes() for path in baseline.iterdir()}
    spoil(baseline, run)
    outcome = tpm_design("compare", baseline, run, "--update-baseline")
    assert (outcome.code, outcome.output) == (2, "")
    assert {path.name: path.read_bytes() for path in baseline.iterdir()} == before


def test_a_whole_run_is_not_overwritten(finished: Path, run: Path) -> None:
    outcome = tpm_design("compare", run, finished, "--update-baseline")
    assert outcome.code == 2
    assert "This is a whole run" in outcome.errors
    assert tpm_design("compare", run, finished).code == 0


def test_a_run_is_not_held_against_itself(run: Path) -> None:
    outcome = tpm_design("compare", run, run.parent / "." / run.name)
    assert outcome.code == 2
    assert "always equal to itself" in outcome.errors


@pytest.mark.parametrize(("option", "value"), [("--rtol", "-1"), ("--atol", "nan"), ("--rtol", "inf")])
def test_what_is_no_tolerance_is_refused(option: str, value: str, baseline: Path, run: Path) -> None:
    outcome = tpm_design("compare", baseline, run, option, value)
    assert outcome.code == 2
    assert f"{option}: " in outcome.errors


def test_a_run_is_reproduced_to_the_last_digit(finished: Path, baseline: Path) -> None:
    outcome = tpm_design("reproduce", finished, "--json")
    data = json.loads(outcome.output)
    assert (outcome.code, outcome.errors, data["within"], data["rows"]) == (0, "", True, 1)
    assert data["identical"] == data["values"] > 10
    assert "reproduced (designs.csv, 1 row" in tpm_design("reproduce", baseline).output
    assert tpm_design("reproduce", baseline, "--quiet") == Outcome(0, "", "")


@pytest.mark.parametrize("column", ["f [mm]", LENGTH, "conditioning_min [-]", "velocity_max [mm/deg]"])
def test_a_number_that_was_altered_is_not_reproduced(column: str, run: Path) -> None:
    edit(run / "designs.csv", scaled(column, 1.0 + 1e-6))
    outcome = tpm_design("reproduce", run)
    assert outcome.code == 4
    assert column in outcome.output
    assert "not reproduced, outside tolerance, 1 exceedance" in outcome.output


def test_a_design_that_was_altered_has_other_metrics(baseline: Path) -> None:
    edit(baseline / "designs.csv", scaled("f [mm]", 1.0 + 1e-6))
    data = json.loads(tpm_design("reproduce", baseline, "--json").output)
    assert LENGTH in {found["column"] for found in data["exceedances"]}


def test_a_number_may_come_back_anywhere_within_its_numeric_error(run: Path) -> None:
    name = "rotation_singularity_distance"
    (row,) = csv.DictReader(io.StringIO((run / "designs.csv").read_text(encoding="utf-8")))
    value, error = float(row[f"{name} [mm]"]), float(row[f"{name} error [mm]"])
    assert error > 1e-8 * value
    edit(run / "designs.csv", lambda row: {**row, f"{name} [mm]": repr(value + 0.9 * error)})
    assert tpm_design("reproduce", run).code == 0
    edit(run / "designs.csv", lambda row: {**row, f"{name} [mm]": repr(value + 1.1 * error)})
    assert tpm_design("reproduce", run).code == 4


def test_a_design_is_judged_by_the_samples_of_its_round(tmp_path: Path) -> None:
    folder = searched(tmp_path, text=CERTIFIED)
    assert tpm_design("reproduce", folder).code == 0
    study, entries = tpm.load_study(folder / "study.yaml"), read_run(folder).entries
    missed = next(
        entry
        for entry in entries
        if entry.round == 2
        and entry.evaluation.status == "infeasible"
        and evaluate(study.problem, entry.evaluation.design).status == "feasible"
    )
    (folder / "designs.csv").write_text(designs_table(study.problem, study.units, [missed]), encoding="utf-8")
    assert tpm_design("reproduce", folder).code == 0
    (folder / "designs.csv").write_text(
        designs_table(study.problem, study.units, [replace(missed, number=0)]), encoding="utf-8"
    )
    assert tpm_design("reproduce", folder).code == 4


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (without_summary, "This run did not come to its end."),
        (interrupted, "This run did not come to its end."),
        (without_designs, "There is no designs.csv here."),
        (emptied, "There is no result here."),
        (swept, "This is a sweep"),
        (cut_short, "designs.csv:2: "),
    ],
)
def test_what_cannot_be_reproduced_is_one_message(
    spoil: Callable[[Path, Path], None], said: str, baseline: Path, run: Path
) -> None:
    spoil(baseline, run)
    outcome = tpm_design("reproduce", run)
    assert (outcome.code, outcome.output) == (2, "")
    assert said in outcome.errors


@pytest.mark.parametrize(
    ("column", "cell", "said"),
    [
        ("mode", "---", "has no mode that the study knows"),
        ("r [mm]", "", "has no r [mm] that the study knows"),
        ("id", "seven", "has no id"),
    ],
)
def test_a_row_that_is_no_design_is_one_message(column: str, cell: str, said: str, baseline: Path) -> None:
    edit(baseline / "designs.csv", lambda row: {**row, column: cell})
    outcome = tpm_design("reproduce", baseline)
    assert outcome.code == 2
    assert said in outcome.errors


def test_a_design_that_is_not_in_the_log_is_one_message(run: Path) -> None:
    edit(run / "designs.csv", lambda row: {**row, "id": "60"})
    outcome = tpm_design("reproduce", run)
    assert outcome.code == 2
    assert "evaluation 60, which is not in the log" in outcome.errors


def test_a_mechanism_of_one_s_own_is_run_by_reproduce_alone_and_only_where_allowed(
    baseline: Path, run: Path
) -> None:
    for folder in (baseline, run):
        study = folder / "study.yaml"
        text = study.read_text(encoding="utf-8").replace("type: uru", "file: robot.py")
        study.write_text(text, encoding="utf-8")
        (folder / "robot.py").write_text("raise SystemExit(99)\n", encoding="utf-8")
    assert tpm_design("compare", baseline, run).code == 0
    outcome = tpm_design("reproduce", run)
    assert outcome.code == 2
    assert "--allow-code" in outcome.errors
