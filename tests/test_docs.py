"""The documentation says what is there: commands, options, links, examples and numbers."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer

import tpm_design as tpm
from tpm_design.cli.app import app
from tpm_design.cli.catalogue import show_thing
from tpm_design.cli.inscribe import inscribe_one
from tpm_design.mechanisms import MECHANISMS
from tpm_design.metrics import METRICS
from tpm_design.optimizers import OPTIMIZERS
from tpm_design.report.escape import text
from tpm_design.study.sweep_points import sweep_points

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md")]
MECHANISM_PAGES = sorted((ROOT / "docs" / "mechanisms").glob("*.md"))
CODE = re.compile(r"```[a-z]*\n(.*?)```|`([^`\n]+)`", re.DOTALL)
COMMAND = re.compile(r"(?<![\w-])tpm-design ([a-z]+)([^\n&]*)")
OPTION = re.compile(r"--[a-z-]+")
LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]+)(?:#[^)]*)?\)")


def options() -> dict[str, set[str]]:
    """Command → its options, as the program has them."""
    group = typer.main.get_command(app)
    assert hasattr(group, "commands")
    return {
        name: {option for parameter in command.params for option in parameter.opts if option.startswith("--")}
        for name, command in group.commands.items()
    }


def code_of(text: str) -> list[str]:
    return [fenced or inline for fenced, inline in CODE.findall(text)]


def blocks(language: str) -> list[str]:
    """Fenced blocks of the README in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_commands_and_options_that_are_named_exist(page: Path) -> None:
    known = options()
    for code in code_of(page.read_text(encoding="utf-8")):
        for name, rest in COMMAND.findall(code):
            assert name in known
            assert set(OPTION.findall(rest)) <= known[name] | {"--help"}


def test_the_table_of_commands_is_complete() -> None:
    table = {
        name: set(OPTION.findall(rest))
        for name, rest in re.findall(r"^\| `tpm-design ([a-z]+)([^`]*)` \|", README, re.MULTILINE)
    }
    assert table == options()


@pytest.mark.parametrize(
    "page",
    [*PAGES, ROOT / "results" / "README.md", *MECHANISM_PAGES],
    ids=lambda path: f"{path.parent.name}/{path.name}",
)
def test_links_lead_somewhere(page: Path) -> None:
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        assert target.startswith("https://") or (page.parent / target).exists(), target


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `docs/generate.py` writes now, README.md with the table included."""
    folder = tmp_path_factory.mktemp("generated")
    text = re.sub(r"(?<=<!-- mechanisms -->\n\n).*?(?=\n<!-- end)", "", README, flags=re.DOTALL)
    assert text != README
    (folder / "README.md").write_text(text, encoding="utf-8")
    subprocess.run([sys.executable, ROOT / "docs" / "generate.py", folder], check=True)
    return folder


def test_the_pages_and_the_table_of_mechanisms_are_what_the_program_knows(generated: Path) -> None:
    assert (generated / "README.md").read_text(encoding="utf-8") == README
    names = ["README.md", *(f"{name}{suffix}" for name in MECHANISMS for suffix in (".md", ".svg"))]
    for folder in (generated, ROOT):
        assert sorted(path.name for path in (folder / "docs" / "mechanisms").iterdir()) == sorted(names)
    for page in MECHANISM_PAGES:
        now = (generated / "docs" / "mechanisms" / page.name).read_text(encoding="utf-8")
        assert page.read_text(encoding="utf-8") == now, f"{page.name}: run `python docs/generate.py`"


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_drawing_in_the_docs_holds_every_word_that_is_drawn_now(name: str, generated: Path) -> None:
    """Outlines of letters may change with the library that draws them, words do not."""
    kept, now = (
        re.findall("<!-- (.*?) -->", (folder / "docs/mechanisms" / f"{name}.svg").read_text(encoding="utf-8"))
        for folder in (ROOT, generated)
    )
    assert {"$O$", "$x$", "driven joint"} <= set(now)
    assert kept == now, f"{name}.svg: run `python docs/generate.py`"


def test_the_page_of_a_mechanism_says_all_that_it_declares(capsys: pytest.CaptureFixture[str]) -> None:
    for kind in MECHANISMS.values():
        page = (ROOT / "docs" / "mechanisms" / f"{kind.name}.md").read_text(encoding="utf-8")
        show_thing(kind.name, None, allow_code=False, as_json=False)
        shown = capsys.readouterr().out
        names = [p.name for p in kind.parameters] + [f.name for f in kind.mode_fields]
        names += [x.name for x in kind.limits] + [s.name for s in kind.singularities]
        for name in names:
            assert f"| `{name}` |" in page
            assert re.search(rf"^{name} ", shown, re.MULTILINE)
        for words in (kind.source, *(s.equation for s in kind.singularities), *kind.remarks):
            assert words in shown
            assert text(words) in page
        row = next(line for line in README.splitlines() if f"docs/mechanisms/{kind.name}.md" in line)
        for words in (kind.title, *kind.pose, *(s.name for s in kind.singularities)):
            assert text(words) in row


def test_the_main_command_is_one_line_that_runs_a_valid_study() -> None:
    main, test = blocks("sh")
    for command in (main, test):
        assert command.count("\n") == 1
        assert command.startswith("python3 -m venv .venv")
    (study,) = re.findall(r"tpm-design optimize (\S+)", main)
    assert tpm.load_study(ROOT / study).problem.variables


def test_continuous_integration_runs_the_test_command_of_the_readme(tmp_path: Path) -> None:
    """The script as it is, where the command it reads out is `echo`."""
    (tmp_path / ".ci").mkdir()
    script = tmp_path / ".ci" / "run"
    script.write_bytes((ROOT / ".ci" / "run").read_bytes())
    script.chmod(0o755)
    command = blocks("sh")[1]
    (tmp_path / "README.md").write_text(
        README.replace(command, f"echo '{command.strip()}'\n".replace("'.[test]'", ".[test]")),
        encoding="utf-8",
    )
    done = subprocess.run([script], capture_output=True, text=True, check=True)
    assert done.stdout == command.replace("'.[test]'", ".[test]")


def test_the_study_shown_is_the_study_there_is() -> None:
    (shown,) = blocks("yaml")
    study = " ".join(
        line.split("#")[0].strip()
        for line in (ROOT / "studies/01-uru-cube.yaml").read_text(encoding="utf-8").splitlines()
    )
    for line in shown.splitlines():
        assert line.split("#")[0].strip() in study


def test_the_plans_shown_are_plans(tmp_path: Path) -> None:
    plans = re.findall(r"^\| `(\{type: .*\})` \|", README, re.MULTILINE)
    study = (ROOT / "studies/01-uru-cube.yaml").read_text(encoding="utf-8")
    sizes = []
    for plan in plans:
        path = tmp_path / "study.yaml"
        path.write_text(re.sub("^sweep: .*$", f"sweep: {plan}", study, flags=re.MULTILINE), encoding="utf-8")
        sizes.append(len(sweep_points(tpm.load_study(path))))
    assert sizes == [9 * 4 * 2, 2, 256, 100]


def test_the_python_example_runs() -> None:
    (example,) = blocks("python")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", example], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "of 100 evaluations" in done.stdout or "in 100 evaluations" in done.stdout


def test_the_numbers_shown_are_those_of_the_design_shown() -> None:
    """To the digits of the table; the design itself is given to six."""
    shown = blocks("text")[0]
    rows = {line.split()[0]: line.split()[1:] for line in shown.splitlines() if line.strip()}
    design = {
        name: float(rows[name][0]) / 1000.0
        for name in ("db", "dp", "f", "r", "center_x", "center_y", "center_z")
    }
    study = tpm.load_study(ROOT / "studies" / "01-uru-cube.yaml")
    found = study.evaluate(design | {"k": float(rows["k"][0])})
    for label, value in found.metrics.items():
        scale = 1000.0 if rows[label][1] == "mm" else 1.0
        assert scale * value == pytest.approx(float(rows[label][0]), rel=1e-3)


def test_the_largest_body_shown_is_that_of_the_design_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """To five digits; the design itself is given to six."""
    design, _, body = blocks("text")
    rows = [line.split() for line in design.splitlines()[2:] if line.strip()]
    settings = [f"{row[0]}={row[1]}" for row in rows if row[0] in ("db", "f", "r", "k")]
    inscribe_one(
        ROOT / "studies" / "01-uru-cube.yaml", settings, "box", 0.1, None, True, tmp_path / "body.json", 1,
        allow_code=False, as_json=False, quiet=True,
    )  # fmt: skip
    now = capsys.readouterr().out
    for shown in ("size x", "size y", "size z", "volume", "reach", "translation", "actuation", "rotation"):
        was, found = (re.search(rf"^{shown} +(\S+)", text, re.MULTILINE) for text in (body, now))
        assert was is not None and found is not None
        assert float(found[1]) == pytest.approx(float(was[1]), rel=2e-5)
    assert "Proved at every pose of the body" in now


def test_names_in_code_are_registered() -> None:
    """Whatever looks like a metric, a method or a plan in the README's studies and output is one."""
    names = re.findall(r"(?:metric|method|polish|type): ([a-z_.]+)", README)
    plans = {"grid", "list", "sobol", "latin_hypercube"}
    known = {*METRICS, *OPTIMIZERS, *MECHANISMS, *plans, "box"}
    assert names
    assert set(names) <= known
