"""The rooms of the house: imports point one way, and nothing heavy is loaded before it is needed.

Every import counts, also inside functions and under TYPE_CHECKING: a room that names another room's types
depends on it. The package's own ``__init__`` is the front door: it names the public things of every room and
nothing inside imports it.
"""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import tpm_design

PACKAGE = Path(tpm_design.__file__).parent
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")

ROOMS = (
    "errors",
    "units",
    "digests",
    "computed_once",
    "worker_threads",
    "checker",
    "arithmetic",
    "mechanisms",
    "workspace",
    "metrics",
    "problem",
    "design_space",
    "evaluation",
    "certificates",
    "optimizers",
    "synthesis",
    "runs",
    "study",
    "report",
    "baselines",
    "cli",
    "__main__",
)
"""From the ground up: a room imports from itself and from rooms before it."""

ONLY = {
    "errors": set(),
    "units": set(),
    "digests": set(),
    "computed_once": set(),
    "worker_threads": set(),
    "checker": {"errors", "worker_threads"},
    "arithmetic": {"errors"},
    "optimizers": {"errors"},
    "design_space": {"problem"},
}
"""Rooms that know less than their place allows. Optimisers see points of a cube: no mechanism, no metric."""

OWNERS = {
    "numba": {"arithmetic", "mechanisms", "workspace"},
    "ruamel": {"study"},
    "pydantic": {"study"},
    "pydantic_core": {"study", "runs"},
    "typer": {"cli"},
    "rich": {"cli"},
    "nlopt": {"optimizers"},
    "pymoo": {"optimizers", "runs"},
    "flint": {"checker"},
    "matplotlib": {"report"},
    "cvxpy": {"optimizers"},
}
"""Libraries that only these rooms know."""

LATE = {"pandas", "cvxpy", "nlopt", "pymoo", "rich", "scipy"}
"""Libraries that are imported inside functions only, but for the report room, which is itself imported so."""

SLOW = {"numba", "numpy", "scipy", "pandas", "matplotlib", "cvxpy", "nlopt", "pymoo", "ruamel.yaml"}


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Full names that are imported anywhere below a node, and their lines; ``from a import b`` is a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: imports are absolute"
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


def at_import(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Imports that are carried out when a module is imported: not in functions, not under TYPE_CHECKING."""
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            waiting.extend(node.orelse)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            yield from imported(node)
        else:
            waiting.extend(ast.iter_child_nodes(node))


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def backward(path: Path, source: str) -> list[str]:
    """Imports of a module that point the wrong way."""
    room = room_of(path)
    allowed = ONLY.get(room, set(ROOMS[: ROOMS.index(room)])) | {room}
    names = [(name.split("."), line) for name, line in imported(ast.parse(source))]
    return [
        f"{path.relative_to(PACKAGE)}:{line}: {room} imports {'.'.join(parts)}"
        for parts, line in names
        if parts[0] == "tpm_design" and parts[1] not in allowed
    ]


def test_every_room_has_its_place() -> None:
    assert {room_of(path) for path in MODULES} == set(ROOMS)


def test_imports_point_one_way() -> None:
    assert [arrow for path in MODULES for arrow in backward(path, path.read_text(encoding="utf-8"))] == []


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("workspace/volume.py", "import tpm_design.metrics"),
        ("mechanisms/uru.py", "def f():\n    from tpm_design.workspace import rays"),
        ("problem.py", "if TYPE_CHECKING:\n    from tpm_design.study import Study"),
        ("optimizers/scipy.py", "from tpm_design.mechanisms import MECHANISMS"),
        ("runs/folder.py", "from tpm_design import study"),
        ("report/write.py", "from tpm_design import load_study"),
    ],
)
def test_an_arrow_that_points_back_is_found(path: str, source: str) -> None:
    assert len(backward(PACKAGE / path, source)) == 1


@pytest.mark.parametrize("library", OWNERS)
def test_libraries_stay_in_their_rooms(library: str) -> None:
    users = {
        room_of(path)
        for path in MODULES
        if any(name.split(".")[0] == library for name, _ in imported(tree_of(path)))
    }
    assert users <= OWNERS[library]


def test_threads_share_no_lock_of_a_property() -> None:
    """Until Python 3.12 ``functools.cached_property`` computes under one lock for all instances."""
    assert [
        path.relative_to(PACKAGE)
        for path in MODULES
        if room_of(path) != "checker"
        and "functools.cached_property" in {name for name, _ in imported(tree_of(path))}
    ] == []


def test_heavy_libraries_and_drawings_are_imported_late() -> None:
    early = [
        f"{path.relative_to(PACKAGE)}:{line}: {name}"
        for path in MODULES
        if room_of(path) != "report"
        for name, line in at_import(tree_of(path))
        if name.split(".")[0] in LATE or name == "tpm_design.report.write"
    ]
    assert early == []


def loaded_by(code: str) -> set[str]:
    """Which slow libraries, and which rooms, a fresh interpreter has loaded after ``code``."""
    show = "import json, sys; print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    program = f"import atexit\natexit.register(lambda: exec({show!r}))\n{code}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(json.loads(done.stderr))


@pytest.mark.parametrize("options", [["--help"], ["optimize", "--help"], ["--version"]])
def test_help_loads_nothing_slow(options: list[str]) -> None:
    modules = loaded_by(
        f"import sys; sys.argv = ['tpm-design', *{options!r}]\nfrom tpm_design.cli import main\nmain()"
    )
    assert "tpm_design.cli.app" in modules
    assert modules & SLOW == set()


def test_reading_a_study_loads_no_library_of_searches_or_reports() -> None:
    study = PACKAGE.parents[1] / "studies" / "01-uru-cube.yaml"
    modules = loaded_by(
        f"import sys; sys.argv = ['tpm-design', 'validate', {str(study)!r}]\n"
        "from tpm_design.cli import main\nmain()"
    )
    assert "tpm_design.study.resolve" in modules
    assert modules & {"pandas", "matplotlib", "cvxpy", "nlopt", "pymoo", "scipy.optimize"} == set()


def test_importing_the_package_loads_nothing_else() -> None:
    modules = loaded_by("import tpm_design; tpm_design.__version__")
    assert modules & SLOW == set()
    assert {name for name in modules if name.startswith("tpm_design")} == {"tpm_design"}


def test_public_names_are_there_and_listed() -> None:
    assert set(dir(tpm_design)) == set(tpm_design.__all__)
    for name in tpm_design.__all__:
        assert getattr(tpm_design, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'mechanisn'"):
        tpm_design.mechanisn  # noqa: B018
