"""Mechanisms from a user's own Python file: never run unasked, then as good as those that come along.

What is told of kernels is told of processes of their own: what they find compiled. Where nothing is compiled
the commands run in this one.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from command_line import tpm_design

import tpm_design as tpm
from tpm_design.arithmetic.compilation import follow_plug_ins
from tpm_design.arithmetic.kernel_cache import PLUG_IN
from tpm_design.errors import PlugInError, StudyError
from tpm_design.mechanisms.plug_in import load_kind
from tpm_design.study import load_comparison, study_schema
from tpm_design.study.document import read_document

GANTRY = (Path(__file__).parents[1] / "plug_ins" / "gantry.py").read_text(encoding="utf-8")
STUDY = """\
version: 1
name: gantry
units: {length: mm, angle: deg}
mechanism:
  file: gantry.py
  parameters: {o: 0, h: {min: 90, max: 300}, k: 2}
region: {type: box, size: [200, 200, 200], center: [0, 0, 0]}
objectives: [{metric: total_link_length, sense: minimize}]
constraints: [{metric: total_link_length, label: long, min: 300}]
optimizer: {method: nlopt.cobyla, budget: 30, seed: 1}
"""
NEEDS_ASKING = (
    ("validate", "study.yaml"),
    ("evaluate", "study.yaml"),
    ("optimize", "study.yaml"),
    ("certify", "study.yaml"),
    ("inscribe", "study.yaml", "--body", "box"),
    ("report", "run"),
)

Command = Callable[..., subprocess.CompletedProcess[str]]


def written(folder: Path, source: str = GANTRY, study: str = STUDY, name: str = "gantry.py") -> Path:
    """The folder with a study and its plug-in."""
    folder.mkdir(exist_ok=True)
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(source, encoding="utf-8")
    (folder / "study.yaml").write_text(study, encoding="utf-8")
    return folder


# what processes compile beside plug-ins is kept by one worker
pytestmark = pytest.mark.xdist_group("plug_ins")


def plug_ins() -> list[str]:
    """Modules of this process that are plug-ins."""
    return [name for name in sys.modules if name.startswith(PLUG_IN)]


@pytest.fixture(autouse=True)
def forget_plug_ins() -> Iterator[None]:
    """Afterwards, kernels lie again where tests without plug-ins have them."""
    yield
    for name in plug_ins():
        del sys.modules[name]
    follow_plug_ins()


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all processes of this file keep their kernels: compiled once."""
    return tmp_path_factory.mktemp("home")


@pytest.fixture(scope="module")
def python(home: Path) -> Command:
    """Runs Python in a folder."""
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(sys.path),
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home),
        "LOCALAPPDATA": str(home),
    }

    def run(folder: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, *map(str, arguments)],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            encoding="utf-8",
            check=False,
        )

    return run


@pytest.fixture(scope="module")
def command(python: Command) -> Command:
    """Runs one command in a folder."""
    return lambda folder, *arguments: python(folder, "-m", "tpm_design", *arguments)


def kernels(home: Path) -> dict[str, dict[str, int]]:
    """Folders of kernels, and when each file in them was written."""
    return {
        folder.name: {str(file): file.stat().st_mtime_ns for file in folder.rglob("*.nb[ic]")}
        for folder in home.rglob("kernels-*")
    }


@pytest.fixture(scope="module")
def run_folder(command: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the gantry."""
    folder = written(tmp_path_factory.mktemp("gantry"))
    done = command(folder, "optimize", "study.yaml", "--allow-code", "--workers", "1", "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    (run,) = folder.glob("results/gantry/*")
    return run


# ----------------------------------------------------------------------------------- never unasked


def trapped(folder: Path) -> tuple[str, Path]:
    """The gantry with a line that leaves a trace when it is run, and where."""
    marker = folder / "marker"
    return f"{GANTRY}\nopen({str(marker)!r}, 'a').write('x')\n", marker


def test_no_command_runs_the_file_unasked(command: Command, run_folder: Path, tmp_path: Path) -> None:
    trap, marker = trapped(tmp_path)
    folder = written(tmp_path / "stranger", trap)
    run = written(tmp_path / "stranger" / "run", trap)
    (run / "evaluations.jsonl").write_bytes((run_folder / "evaluations.jsonl").read_bytes())
    for name, place, *options in NEEDS_ASKING:
        refused = tpm_design(name, folder / place, *options)
        assert (refused.code, refused.output) == (2, "")
        assert "study.yaml:5: the mechanism is a Python file, 'gantry.py'" in refused.errors
        assert "--allow-code" in refused.errors
    shown = tpm_design("show", folder / "gantry.py")
    assert (shown.code, shown.output) == (2, "")
    assert "--allow-code" in shown.errors
    refused_process = command(folder, "optimize", "study.yaml")
    assert (refused_process.returncode, refused_process.stdout) == (2, "")
    assert sorted(path.name for path in folder.iterdir()) == ["gantry.py", "run", "study.yaml"]
    assert not marker.exists()
    assert not list(folder.rglob("__pycache__"))
    # the trap works
    allowed = tpm_design("show", folder / "gantry.py", "--allow-code")
    assert (allowed.code, allowed.errors) == (0, "")
    assert "half the stroke" in allowed.output
    assert marker.exists()


def test_python_asks_too(tmp_path: Path) -> None:
    trap, marker = trapped(tmp_path)
    study = written(tmp_path, trap) / "study.yaml"
    with pytest.raises(StudyError, match="running it was not allowed"):
        tpm.load_study(study)
    assert not marker.exists()
    assert tpm.load_study(study, allow_code=True).problem.kind.name == "gantry"
    assert marker.exists()


# ------------------------------------------------------------------------------ as good as built in


def test_architectures_of_a_comparison_may_be_plug_ins_too(tmp_path: Path) -> None:
    study = written(tmp_path) / "study.yaml"
    part = "{mechanism: {file: gantry.py, parameters: {o: 0, h: {min: 90, max: 300}, k: 2}}}"
    lines = study.read_text(encoding="utf-8").splitlines()
    start = lines.index("mechanism:")
    lines[start : start + 3] = ["architectures:", f"  one: {part}", f"  two: {part}"]
    study.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(StudyError, match="the mechanism is a Python file"):
        load_comparison(study)
    comparison = load_comparison(study, allow_code=True)
    assert comparison is not None
    assert [one.problem.kind.name for one in comparison.studies.values()] == ["gantry", "gantry"]


def test_a_search_finds_the_shortest_strokes(run_folder: Path) -> None:
    """Three half strokes of at least 300 mm together."""
    best = json.loads((run_folder / "run.json").read_text(encoding="utf-8"))["best_id"]
    rows = (run_folder / "evaluations.jsonl").read_text(encoding="utf-8").splitlines()
    found = json.loads(rows[best])
    assert found["design"]["h"] == pytest.approx(0.1, rel=1e-6)
    assert found["metrics"]["total_link_length"] == pytest.approx(0.3, rel=1e-6)


def test_a_run_folder_stands_alone(run_folder: Path) -> None:
    copy, study = run_folder / "gantry.py", run_folder / "study.yaml"
    assert copy.read_text(encoding="utf-8") == GANTRY
    resolved = read_document(study).data["mechanism"]
    assert resolved["file"] == "gantry.py"
    assert resolved["sha256"] == hashlib.sha256(copy.read_bytes()).hexdigest()
    original = tpm.load_study(run_folder.parents[2] / "study.yaml", allow_code=True)
    assert tpm.load_study(study, allow_code=True) == original


def test_a_study_is_checked_and_a_run_reported(tmp_path: Path) -> None:
    valid = tpm_design("validate", written(tmp_path) / "study.yaml", "--allow-code")
    assert (valid.code, valid.errors) == (0, "")
    assert "Gantry of three slides" in valid.output
    # a run that was cut short has no maps to be drawn
    run = written(tmp_path / "run")
    (run / "evaluations.jsonl").write_text("", encoding="utf-8")
    report = tpm_design("report", run, "--allow-code", "--quiet")
    assert (report.code, report.errors) == (0, "")
    text = (run / "report.md").read_text(encoding="utf-8")
    assert "# gantry: Gantry of three slides" in text
    assert "(gantry.py)" in text


@pytest.mark.parametrize(("h", "code", "word"), [("101", 0, "Proved"), ("99", 5, "Refuted")])
def test_its_constraints_are_settled_and_no_checker_pretends_to_know_it(
    tmp_path: Path, h: str, code: int, word: str
) -> None:
    study, proof = written(tmp_path) / "study.yaml", tmp_path / "proof.json"
    settled = tpm_design("certify", study, "--set", f"h={h}", "--allow-code", "--quiet", "--output", proof)
    assert (settled.code, settled.errors) == (code, "")
    assert word in settled.output
    assert "--check" not in settled.output
    checked = tpm_design("certify", "--check", proof)
    assert checked.code == 2
    assert "'gantry.py': it cannot be checked" in checked.errors


# ---------------------------------------------------------------------------------- compiled kernels


def test_kernels_are_compiled_once_and_apart(
    command: Command, python: Command, home: Path, run_folder: Path
) -> None:
    """Also for the copy in the run folder: the content counts, not the place."""
    folder = run_folder.parents[2]
    pose = ("--at", "10,20,-30", "--allow-code", "--json")
    first = command(folder, "evaluate", "study.yaml", "--set", "h=100", *pose)
    before = kernels(home)
    assert sum(len(files) for files in before.values()) >= 4
    second = command(folder, "evaluate", run_folder, "--set", "h=100", *pose)
    assert kernels(home) == before
    assert first.stdout == second.stdout
    # x = k q
    assert json.loads(first.stdout)["actuators"]["motor"]["value"] == pytest.approx([5.0, 10.0, -15.0])
    assert knows_nothing(kernels(home), python, folder)


FOLDER = "from tpm_design.arithmetic.kernel_cache import FOLDER; print(FOLDER.name)"


def knows_nothing(found: dict[str, dict[str, int]], python: Command, folder: Path) -> bool:
    """Whether no kernel lies where a program without plug-ins looks."""
    return found.get(python(folder, "-c", FOLDER).stdout.strip(), {}) == {}


def test_a_plug_in_that_is_imported_keeps_its_kernels_apart_too(
    python: Command, home: Path, tmp_path: Path
) -> None:
    folder = written(tmp_path / "imported")
    program = (
        "from gantry import KIND\n"
        "machine = KIND.build(KIND.example, {})\n"
        "print(machine.ik([[0.1, 0.0, 0.0]], machine.mode_of({})).tolist())"
    )
    before = kernels(home)
    done = python(folder, "-c", program)
    assert done.stdout.strip() == "[[0.1, 0.0, 0.0]]", done.stderr
    assert kernels(home) != before
    assert knows_nothing(kernels(home), python, folder)


def test_a_changed_file_is_compiled_anew(command: Command, tmp_path: Path) -> None:
    """Same size, same time of change: the content counts."""
    folder = written(tmp_path / "changed")
    source = folder / "gantry.py"

    def evaluated() -> list[float]:
        done = command(folder, "evaluate", "study.yaml", "--at", "10,20,30", "--allow-code", "--json")
        assert done.returncode == 0, done.stderr
        values: list[float] = json.loads(done.stdout)["actuators"]["motor"]["value"]
        return values

    assert evaluated() == pytest.approx([5.0, 10.0, 15.0])
    status = source.stat()
    source.write_text(GANTRY.replace("SCALE = 1.0", "SCALE = 2.0"), encoding="utf-8")
    os.utime(source, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert evaluated() == pytest.approx([2.5, 5.0, 7.5])


def test_two_contents_in_one_program_are_two_mechanisms(tmp_path: Path) -> None:
    one = tpm.load_study(written(tmp_path / "one") / "study.yaml", allow_code=True)
    text = GANTRY.replace("SCALE = 1.0", "SCALE = 4.0")
    other = tpm.load_study(written(tmp_path / "other", text) / "study.yaml", allow_code=True)
    assert one.study_hash != other.study_hash
    assert one != other
    again = tpm.load_study(written(tmp_path / "again") / "study.yaml", allow_code=True)
    assert (one, one.study_hash) == (again, again.study_hash)


# ------------------------------------------------------------------------------------- what is wrong


@pytest.mark.parametrize(
    ("source", "place", "words"),
    [
        ("x = 1\ndef f(:\n", "gantry.py:2", "not valid Python"),
        ("x = '\0'", "gantry.py", "not valid Python"),
        ("", "gantry.py", "defines no KIND"),
        ("KIND = 'gantry'", "gantry.py", "KIND is a str"),
        ("def f():\n    return 1 / 0\nf()\n", "gantry.py:2", "ZeroDivisionError"),
        ("import sys\nsys.exit(0)", "gantry.py:2", "SystemExit"),
        ("import no_such_module_anywhere", "gantry.py:1", "no_such_module_anywhere"),
        (GANTRY.replace('name="gantry"', 'name="uru"'), "gantry.py", "there is a mechanism of this name"),
        (GANTRY.replace('name="gantry"', 'name="My Gantry"'), "gantry.py", "KIND.name is 'My Gantry'"),
        (GANTRY.replace("limits=()", "limits=None"), "gantry.py", "KIND.limits must be a tuple of Limit"),
        (GANTRY.replace('"h": 0.2', '"h": -1.0'), "gantry.py", "KIND.example cannot be built"),
        (GANTRY.replace('values["h"], values["k"]', 'values["q"]'), "gantry.py:", "KeyError"),
        (GANTRY.replace("return Gantry(", "return str("), "gantry.py", "KIND"),
    ],
)
def test_a_broken_file_is_one_message(tmp_path: Path, source: str, place: str, words: str) -> None:
    study = written(tmp_path, source) / "study.yaml"
    with pytest.raises(PlugInError) as caught:
        tpm.load_study(study, allow_code=True)
    assert str(caught.value).startswith(f"{tmp_path / place}")
    assert words in caught.value.what
    assert caught.value.exit_code == 2
    assert caught.value.remedy
    assert plug_ins() == []


def test_the_command_line_tells_a_broken_file_and_formulas_that_do_not_compile(
    command: Command, tmp_path: Path
) -> None:
    folder = written(tmp_path / "broken", "KIND = 1 / 0\n")
    done = command(folder, "validate", "study.yaml", "--allow-code")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("tpm-design: gantry.py:1: the file cannot be loaded: ZeroDivisionError")
    assert "Traceback" not in done.stderr

    wrong = GANTRY.replace("h1 - magnitude(x - o1)", "h1 - magnitude('x')")
    assert wrong != GANTRY
    folder = written(tmp_path / "formulas", wrong)
    done = command(folder, "evaluate", "study.yaml", "--at", "1,2,3", "--allow-code")
    assert (done.returncode, done.stdout) == (2, "")
    assert "gantry.py" in done.stderr
    assert "the mechanism's formulas fail: there is no magnitude for such arguments" in done.stderr
    assert "This is a bug" not in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("file: gantry.py", "file: other.py", 5, "there is no such Python file"),
        ("file: gantry.py", "file: ../gantry.py", 5, "outside the study's folder"),
        ("file: gantry.py", "file: /etc/gantry.py", 5, "cannot be '/etc"),
        ("file: gantry.py", "file: gantry.yaml", 5, "Name a Python file"),
        ("file: gantry.py", "type: gantry.py", 5, "no mechanism 'gantry.py'"),
        ("file: gantry.py", "file: gantry.py\n  type: uru", 4, "exclude each other"),
        ("  file: gantry.py\n", "", 4, "`type` is missing"),
        ("file: gantry.py", f"file: gantry.py\n  sha256: '{64 * '0'}'", 6, "its SHA-256 is another"),
        ("file: gantry.py", "file: gantry.py\n  sha256: abc", 6, "sha256"),
        ("h: {", "height: {", 6, "gantry has no parameter 'height'"),
    ],
)
def test_what_a_study_says_wrong_of_its_file(
    tmp_path: Path, old: str, new: str, line: int, words: str
) -> None:
    study = written(tmp_path, study=STUDY.replace(old, new)) / "study.yaml"
    with pytest.raises(StudyError) as caught:
        tpm.load_study(study, allow_code=True)
    assert f"study.yaml:{line}: " in str(caught.value)
    assert words in str(caught.value)
    assert caught.value.remedy


def test_a_file_in_a_folder_below_goes_along_with_its_run(tmp_path: Path) -> None:
    text = STUDY.replace("file: gantry.py", "file: ./robots/gantry.py")
    folder = written(tmp_path / "below", study=text, name="robots/gantry.py")
    study = tpm.load_study(folder / "study.yaml", allow_code=True)
    assert study.resolved()["mechanism"]["file"] == "robots/gantry.py"
    assert study.plug_in is not None
    study.plug_in.write_beside(tmp_path / "run" / "study.yaml")
    assert (tmp_path / "run" / "robots" / "gantry.py").read_text(encoding="utf-8") == GANTRY


def test_the_schema_takes_a_file_or_a_type(tmp_path: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft202012Validator(study_schema())
    study = tpm.load_study(written(tmp_path) / "study.yaml", allow_code=True)
    resolved = study.resolved()
    assert list(validator.iter_errors(resolved)) == []
    mechanism = resolved["mechanism"]
    without = {key: value for key, value in mechanism.items() if key != "file"}
    for wrong in ({**mechanism, "type": "uru"}, {**mechanism, "file": "gantry"}, without):
        assert not validator.is_valid({**resolved, "mechanism": wrong})


def test_the_same_content_is_run_once(tmp_path: Path) -> None:
    trap, marker = trapped(tmp_path)
    one, other = (load_kind(trap.encode(), tmp_path / name, ()) for name in ("a.py", "b.py"))
    assert one is other
    assert marker.read_text(encoding="utf-8") == "x"
