"""A study with a ratio and a log scale, from its file to a run that was cut short and goes on."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest
from command_line import STUDY, tpm_design, written

from tpm_design.report.reported import read_reported
from tpm_design.report.sweep_figures import map_figure, scatter_figure
from tpm_design.runs.folder import entry_to_json, read_run

SHARES = STUDY
for old, new in (
    ("name: small", "name: shares"),
    ("db: 100", "db: {ratio: f, min: 0.2, max: 0.9}"),
    ("dp: 60", "dp: {ratio: db, min: 0.1, max: 1, scale: log}"),
    ("f: {min: 100, max: 500, initial: 250}", "f: {min: 100, max: 500, scale: log}"),
    ("r: {min: 100, max: 500, initial: 250}", "r: {equals: f}"),
    ("{metric: rotation_singularity_distance, min: 20}", "{metric: singularity_margin_min, min: 0.01}"),
    ("budget: 60, seed: 1", "budget: 90, seed: 1, polish: nlopt.cobyla"),
    ("record: [{metric: velocity_max}]", "accuracy: {region_samples: 5}"),
):
    assert old in SHARES
    SHARES = SHARES.replace(old, new)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the study and one whole run of it are."""
    folder = tmp_path_factory.mktemp("shares")
    study = written(folder, SHARES)
    assert tpm_design("optimize", study, "--output", folder / "results", "--quiet").code == 0
    return folder


def run_in(folder: Path) -> Path:
    (run,) = (folder / "results" / "shares").iterdir()
    return run


def test_every_row_is_a_design_of_the_study(folder: Path) -> None:
    with (run_in(folder) / "evaluations.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 90
    for row in rows:
        base, platform, link = (float(row[f"{name} [mm]"]) for name in ("db", "dp", "f"))
        assert 100.0 <= link <= 500.0
        assert 0.2 * (1 - 1e-12) <= base / link <= 0.9 * (1 + 1e-12)
        assert 0.1 * (1 - 1e-12) <= platform / base <= 1.0 + 1e-12
        assert row["r [mm]"] == row["f [mm]"]


def test_a_run_that_was_cut_short_ends_the_same(folder: Path, tmp_path: Path) -> None:
    """The log is cut off in the polish, whose starts are points found again from designs."""
    whole = run_in(folder)
    part = tmp_path / "results" / "shares" / whole.name
    part.mkdir(parents=True)
    lines = (whole / "evaluations.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    (part / "evaluations.jsonl").write_text("".join(lines[:75]), encoding="utf-8")
    for name in ("study.yaml", "run.json"):
        (part / name).write_bytes((whole / name).read_bytes())
    outcome = tpm_design(
        "optimize", folder / "study.yaml", "--resume", "latest", "--output", tmp_path / "results", "--quiet"
    )
    assert outcome.code == 0
    assert json.loads((part / "run.json").read_text(encoding="utf-8"))["resumed_after"] == 75
    assert (part / "designs.csv").read_bytes() == (whole / "designs.csv").read_bytes()
    logs = [[entry_to_json(e) | {"seconds": 0} for e in read_run(run).entries] for run in (part, whole)]
    assert logs[0] == logs[1]


def test_a_run_is_a_study_and_a_design(folder: Path) -> None:
    run = run_in(folder)
    assert tpm_design("validate", run / "study.yaml").code == 0
    with (run / "designs.csv").open(encoding="utf-8", newline="") as file:
        (best,) = csv.DictReader(file)
    told = json.loads(tpm_design("evaluate", run, "--json").output)
    for name in ("db", "dp", "f", "r"):
        assert told["design"][name]["value"] == float(best[f"{name} [mm]"])
    longer = 2.0 * float(best["f [mm]"])
    told = json.loads(tpm_design("evaluate", run, "--set", f"f={longer!r}", "--json").output)
    assert told["design"]["db"]["value"] == pytest.approx(2.0 * float(best["db [mm]"]), rel=1e-14)
    assert told["design"]["dp"]["value"] == pytest.approx(2.0 * float(best["dp [mm]"]), rel=1e-14)
    told = json.loads(tpm_design("evaluate", run, "--set", "db=77", "--json").output)
    assert (told["design"]["db"]["value"], told["design"]["f"]["value"]) == (77.0, float(best["f [mm]"]))
    shown = tpm_design("evaluate", run).output
    assert "0.2 … 0.9 × f" in shown
    assert "100 … 500 mm, log scale" in shown
    assert tpm_design("reproduce", run).code == 0


def test_a_report_tells_the_ranges(folder: Path) -> None:
    run = run_in(folder)
    assert tpm_design("report", run).code == 0
    text = (run / "report.md").read_text(encoding="utf-8").replace("\\", "")
    assert "0.2 … 0.9 × f" in text
    assert "0.1 … 1 × db, log scale" in text


def test_a_sweep_over_a_log_range_is_drawn_on_a_log_scale(tmp_path: Path) -> None:
    plan = "sweep: {type: grid, parameters: {f: {num: 5}, k: {values: [1, 2]}}}\n"
    study = written(tmp_path, SHARES + plan)
    assert tpm_design("sweep", study, "--output", tmp_path, "--quiet").code in (0, 3)
    (run,) = (tmp_path / "shares").iterdir()
    with (run / "designs.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    lengths = [float(row["f [mm]"]) for row in rows[::2]]
    assert lengths == pytest.approx([100.0 * 5.0 ** (step / 4) for step in range(5)], rel=1e-11)
    for row in rows:
        assert float(row["db [mm]"]) == pytest.approx(0.55 * float(row["f [mm]"]), rel=1e-14)
        assert float(row["dp [mm]"]) == pytest.approx(math.sqrt(0.1) * float(row["db [mm]"]), rel=1e-14)
    reported = read_reported(run)
    for figure in (scatter_figure(reported), map_figure(reported)):
        assert figure is not None
        assert {axes.get_xscale() for axes in figure.axes if axes.get_xlabel() == "f [mm]"} == {"log"}
        assert all(axes.get_xscale() == "linear" for axes in figure.axes if axes.get_xlabel() == "k")
