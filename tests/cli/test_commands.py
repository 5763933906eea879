"""Commands that write no run: what they print, and one clear message for whatever is wrong."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
from command_line import STUDY, Outcome, command, process, tpm_design, written
from ruamel.yaml import YAML

import tpm_design as tpm
from tpm_design.cli.catalogue import ROOMS
from tpm_design.mechanisms import MECHANISMS

COMMANDS = ("init", "validate", "schema", "list", "show", "evaluate", "optimize", "report")


def refused(outcome: Outcome) -> str:
    """The message of a refused command: exit code 2, one message, nothing else."""
    assert outcome.code == 2
    assert outcome.output == ""
    assert "Traceback" not in outcome.errors
    assert outcome.errors.count("tpm-design: ") == 1
    return outcome.errors


def test_help_names_every_command() -> None:
    outcome = tpm_design("--help")
    assert outcome.code == 0
    for name in COMMANDS:
        assert f"\n  {name} " in outcome.output


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name: str) -> None:
    outcome = tpm_design(name, "--help")
    assert outcome.code == 0
    assert f"Usage: tpm-design {name}" in outcome.output


def test_version() -> None:
    assert tpm_design("--version").output == f"tpm-design {tpm.__version__}\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ("nope",),
        ("optimize",),
        ("optimize", "--bduget", "3", "x.yaml"),
        ("optimize", "x.yaml", "--seed", "x"),
    ],
)
def test_wrong_usage_is_one_error(arguments: tuple[str, ...]) -> None:
    outcome = tpm_design(*arguments)
    assert (outcome.code, outcome.output) == (2, "")
    assert outcome.errors.startswith("Usage: tpm-design")
    assert outcome.errors.count("Error: ") == 1


def test_list_names_everything_registered() -> None:
    text, data = tpm_design("list").output, json.loads(tpm_design("list", "--json").output)
    assert {room: list(things) for room, things in data.items()} == {r: list(t) for r, t in ROOMS.items()}
    for things in ROOMS.values():
        for name in things:
            assert f"\n{name} " in text


@pytest.mark.parametrize("room", ROOMS)
def test_list_of_one_room(room: str) -> None:
    outcome = tpm_design("list", room)
    assert outcome.code == 0
    assert len(outcome.output.splitlines()) == len(ROOMS[room]) + 2


@pytest.mark.parametrize("name", [name for things in ROOMS.values() for name in things])
def test_show_explains_everything_registered(name: str) -> None:
    outcome = tpm_design("show", name)
    assert outcome.code == 0
    assert name in outcome.output.splitlines()[0]
    assert json.loads(tpm_design("show", name, "--json").output)["name"] == name


def test_unknown_names_get_a_remedy() -> None:
    assert "'metrics'" in refused(tpm_design("list", "metric"))
    assert "'coverage'" in refused(tpm_design("show", "covrage"))
    assert "'uru'" in refused(tpm_design("init", "new", "--mechanism", "urx"))


@pytest.mark.parametrize("mechanism", MECHANISMS)
def test_a_new_study_does_what_its_first_lines_say(
    mechanism: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert tpm_design("init", "new", "--mechanism", mechanism).code == 0
    assert tpm_design("validate", "new.yaml").code == 0
    assert tpm_design("evaluate", "new.yaml").code == 0
    outcome = tpm_design("optimize", "new.yaml", "--budget", "12", "--workers", "1", "--quiet")
    assert outcome.code in (0, 3)
    assert "of 12 evaluations" in outcome.output or "in 12 evaluations" in outcome.output
    jsonschema.validate(
        YAML(typ="safe", pure=True).load(Path("new.yaml")), json.loads(tpm_design("schema").output)
    )


def test_the_best_design_of_a_new_study_is_not_one_of_its_limits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert tpm_design("init", "new", "--mechanism", "orthoglide").code == 0
    best = json.loads(tpm_design("optimize", "new.yaml", "--json", "--quiet").output)["best"]
    (limits,) = (v for v in tpm.load_study("new.yaml").problem.variables if v.name == "L")
    assert best["status"] == "feasible"
    assert 1.2 * limits.lower < 1e-3 * best["design"]["L"]["value"] < limits.upper / 1.2


def test_init_keeps_an_existing_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("study.yaml").write_text("mine", encoding="utf-8")
    assert "study.yaml" in refused(tpm_design("init"))
    assert Path("study.yaml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("name", ["../escape", "two words", ".hidden", "", "a" * 65])
def test_init_refuses_names_that_are_no_names(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    refused(tpm_design("init", name))
    assert list(tmp_path.iterdir()) == []


def test_validate_points_at_the_line(tmp_path: Path) -> None:
    path = written(tmp_path, STUDY.replace("metric: coverage", "metric: covrage"))
    line = next(n for n, text in enumerate(STUDY.splitlines(), 1) if "metric: coverage" in text)
    message = refused(tpm_design("validate", path))
    assert f"{path}:{line}" in message
    assert "'coverage'" in message


def test_the_resolved_study_is_the_same_study(tmp_path: Path) -> None:
    path = written(tmp_path)
    resolved = written(tmp_path, tpm_design("validate", path, "--resolved").output, "resolved.yaml")
    assert tpm.load_study(resolved) == tpm.load_study(path)
    assert tpm_design("validate", resolved, "--quiet") == Outcome(0, "", "")


def test_evaluate_gives_the_numbers_of_the_python_interface(tmp_path: Path) -> None:
    path = written(tmp_path)
    outcome = tpm_design("evaluate", path, "--set", "f=200", "--set", "k=1", "--json")
    data = json.loads(outcome.output)
    expected = tpm.load_study(path).evaluate({"f": 0.2, "k": 1.0})
    si = {"mm": 1e-3, "mm/deg": 1e-3 * 180.0 / math.pi, "-": 1.0}
    assert data["status"] == expected.status
    assert data["assumed"] == ["r = 250 mm (its initial value)"]
    assert data["design"]["f"] == {"value": 200.0, "unit": "mm"}
    assert set(data["metrics"]) == set(expected.metrics)
    for label, entry in data["metrics"].items():
        assert entry["value"] * si[entry["unit"]] == pytest.approx(expected.metrics[label], rel=1e-12)
        assert entry["error"] * si[entry["unit"]] == pytest.approx(expected.errors[label], rel=1e-12)
    assert data["metrics"]["total_link_length"] == {"value": 1350.0, "error": 0.0, "unit": "mm"}
    assert data["metrics"]["velocity_max"]["unit"] == "mm/deg"


def test_evaluate_prints_units_errors_and_slacks(tmp_path: Path) -> None:
    lines = tpm_design("evaluate", written(tmp_path)).output.splitlines()
    assert lines[0].startswith("Assumed: f = 250 mm (its initial value)")
    rows = {line.split()[0]: line for line in lines if line}
    assert "1500 mm" in rows["total_link_length"]
    assert "± 0" in rows["total_link_length"]
    assert "minimise" in rows["total_link_length"]
    assert "≥ 20 mm" in rows["rotation_singularity_distance"]
    assert "met by" in rows["coverage"]
    assert lines[-1].startswith("This design is feasible")


def test_at_gives_joint_values_jacobian_and_margins(tmp_path: Path) -> None:
    path = written(tmp_path)
    outcome = tpm_design("evaluate", path, "--set", "k=2", "--at", "120,130,140", "--json")
    data = json.loads(outcome.output)
    machine = tpm.mechanism("uru", db=0.1, dp=0.06, f=0.25, r=0.25, k=2.0)
    mode, pose = machine.mode(octant="+++", elbows="+++"), [[0.12, 0.13, 0.14]]
    assert data["pose"] == {"value": [120.0, 130.0, 140.0], "unit": "mm"}
    for drive in ("motor", "joint"):
        actuators, jacobian = data["actuators"][drive], data["jacobian"][drive]
        assert (actuators["unit"], jacobian["unit"]) == ("deg", "mm/deg")
        degrees = [math.degrees(value) for value in machine.ik(pose, mode, drive=drive)[0]]
        assert actuators["value"] == pytest.approx(degrees, rel=1e-12)
        expected = machine.jacobian(pose, mode, drive=drive)[0] * 1000.0 * math.pi / 180.0
        for row, expected_row in zip(jacobian["value"], expected, strict=True):
            assert row == pytest.approx(list(expected_row), rel=1e-12)
    margins = machine.margins(pose, mode)
    assert set(data["margins"]) == set(margins)
    assert data["margins"]["reach"]["value"] == pytest.approx(1000.0 * margins["reach"][0], rel=1e-12)
    assert data["margins"]["actuation"]["value"] == pytest.approx(margins["actuation"][0], rel=1e-12)


def test_a_pose_out_of_reach_has_no_joint_values(tmp_path: Path) -> None:
    path = written(tmp_path)
    data = json.loads(tpm_design("evaluate", path, "--at", "3000,0,0", "--json").output)
    assert data["actuators"]["motor"]["value"] == [None, None, None]
    assert data["margins"]["reach"]["value"] < 0.0
    assert "not reachable" in tpm_design("evaluate", path, "--at", "3000,0,0").output


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("f", "sets nothing"),
        ("=3", "sets nothing"),
        ("f=", "number"),
        ("f=abc", "number"),
        ("f=nan", "number"),
        ("f=1e999", "number"),
        ("f=-3", "greater than 0"),
        ("q=3", "no quantity 'q'"),
        ("f1=3", "Set f"),
        ("mode=+++", "mode"),
    ],
)
def test_settings_without_meaning_are_refused(setting: str, said: str, tmp_path: Path) -> None:
    assert said in refused(tpm_design("evaluate", written(tmp_path), "--set", setting))


def test_a_quantity_is_set_once(tmp_path: Path) -> None:
    assert "twice" in refused(tpm_design("evaluate", written(tmp_path), "--set", "f=200", "--set", "f=300"))


@pytest.mark.parametrize("pose", ["1,2", "1,2,3,4", "a,b,c", "1,2,nan", "1,2,inf", ""])
def test_poses_without_meaning_are_refused(pose: str, tmp_path: Path) -> None:
    assert "x,y,z in mm" in refused(tpm_design("evaluate", written(tmp_path), "--at", pose))


@pytest.mark.parametrize("name", ["evaluate", "optimize", "validate"])
def test_what_is_no_study_is_refused(name: str, tmp_path: Path) -> None:
    missing, binary = tmp_path / "missing.yaml", tmp_path / "binary.yaml"
    binary.write_bytes(b"\x00\xff\xfe")
    for path in (missing, binary, tmp_path):
        assert str(path) in refused(tpm_design(name, path))


def test_a_design_that_cannot_be_measured_has_a_reason(tmp_path: Path) -> None:
    text = STUDY.replace("rotation_singularity_distance, min: 20", "velocity_max, label: speed, max: 5")
    text = text.replace("record: [{metric: velocity_max}]\n", "")
    outcome = tpm_design("evaluate", written(tmp_path, text), "--set", "f=20", "--set", "r=20")
    assert outcome.code == 0
    assert "speed: the region is not reachable" in outcome.output
    assert outcome.output.rstrip().splitlines()[-1].startswith("This design is infeasible")


@pytest.mark.skipif(os.name == "nt", reason="pipes end otherwise there")
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [("list",), ("schema",), ("evaluate", "study.yaml")])
def test_a_reader_that_leaves_is_no_error(
    arguments: tuple[str, ...], unbuffered: str, tmp_path: Path
) -> None:
    written(tmp_path)
    left, end = os.pipe()
    os.close(left)
    try:
        done = subprocess.run(
            command(*arguments),
            cwd=tmp_path,
            stdout=end,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
            check=False,
        )
    finally:
        os.close(end)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
def test_output_that_cannot_be_written_is_one_message(tmp_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            command("list"), cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert done.stderr.startswith("tpm-design: The output cannot be written: ")
    assert len(done.stderr.splitlines()) == 1


def test_the_installed_command_and_the_module_are_the_same(tmp_path: Path) -> None:
    script = Path(sys.executable).with_name("tpm-design")
    done = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == process(["--version"], tmp_path).stdout
