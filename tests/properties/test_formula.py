"""One source of a formula serves floats, intervals and duals; kernels survive the process that made them."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from toy_formula import Arm, Rail, bounds, reach, slopes, values

from tpm_design.arithmetic import Interval, formula
from tpm_design.arithmetic.kernel_cache import PACKAGE, source_hash

ARM = Arm(links=(0.5, 0.4, 0.3), offset=(0.1, -0.2), gain=0.7)


def by_hand(arm: Arm, x: float, y: float) -> float:
    rho = math.hypot(x - arm.offset[0], y - arm.offset[1])
    return min(sum(arm.links) - rho, arm.gain * rho * x) + max(y, 0) / 3


def exact(number: float) -> Interval:
    return Interval(number, number)


def enclosed(arm: Arm, tolerance: float) -> Arm:
    def around(number: float) -> Interval:
        return exact(number) + Interval(-tolerance, tolerance)

    first, second, third = map(around, arm.links)
    return Arm((first, second, third), (around(arm.offset[0]), around(arm.offset[1])), around(arm.gain))


def test_floats() -> None:
    x = np.linspace(-1, 2, 101)
    out = np.empty_like(x)
    values(ARM, x, 0.4, out)
    np.testing.assert_allclose(out, [by_hand(ARM, u, 0.4) for u in x], rtol=1e-14, atol=1e-15)


def test_the_geometry_class_selects_the_formula() -> None:
    out = np.empty(1)
    values(Rail(2.0), np.array([0.5]), 0.0, out)
    assert out[0] == 1.5


def test_intervals_with_toleranced_parameters() -> None:
    generator = np.random.default_rng(1)
    toleranced = enclosed(ARM, 0.01)
    for x, y in generator.uniform(-1, 1, (200, 2)).tolist():
        box = Interval(x, x + 0.05), Interval(y, y + 0.02)
        result = bounds(toleranced, *box)
        for _ in range(5):
            shift = generator.uniform(-0.01, 0.01, 6)
            arm = Arm(
                tuple(np.add(ARM.links, shift[:3])),
                tuple(np.add(ARM.offset, shift[3:5])),
                ARM.gain + shift[5],
            )
            u, v = x + 0.05 * generator.random(), y + 0.02 * generator.random()
            assert result.lo <= by_hand(arm, u, v) <= result.hi
        point = bounds(enclosed(ARM, 0.0), exact(x), exact(y))
        assert point.hi - point.lo < 1e-14
        assert by_hand(ARM, x, y) == pytest.approx(point.lo, abs=1e-14)


def test_duals_of_floats() -> None:
    for x, y in [(0.3, 0.5), (1.1, 0.2), (0.6, -0.7)]:
        found = slopes(ARM, x, y)
        assert found.value == pytest.approx(by_hand(ARM, x, y), rel=1e-14)
        for derivative, (dx, dy) in zip(found.derivatives, [(1, 0), (0, 1)], strict=True):
            errors = [
                (by_hand(ARM, x + h * dx, y + h * dy) - by_hand(ARM, x - h * dx, y - h * dy)) / (2 * h)
                - derivative
                for h in (2e-3, 1e-3)
            ]
            assert errors[0] / errors[1] == pytest.approx(4, rel=0.01)


def test_duals_of_intervals() -> None:
    result = slopes(enclosed(ARM, 0.001), Interval(0.3, 0.31), Interval(0.5, 0.52))
    for x, y in [(0.3, 0.5), (0.305, 0.51), (0.31, 0.52)]:
        found = slopes(ARM, x, y)
        assert found.value in result.value
        for derivative, enclosure in zip(found.derivatives, result.derivatives, strict=True):
            assert derivative in enclosure
            assert enclosure.hi - enclosure.lo < 0.1


def test_a_formula_has_the_parameters_of_its_stub() -> None:
    with pytest.raises(TypeError, match="parameters of reach"):

        @formula(reach, Rail)
        def wrong(geometry: Rail, y: float, x: float) -> float:
            return x + y


SCRIPT = """
import json, os
import numpy as np
import toy_formula as toy
import numba
from tpm_design.arithmetic import Interval
from tpm_design.arithmetic.kernel_cache import FOLDER
arm = toy.Arm((0.5, 0.4, 0.3), (0.1, -0.2), 0.7)
toy.values(arm, np.zeros(3), 0.4, np.zeros(3))
toy.slopes(arm, Interval(0.3, 0.4), Interval(0.5, 0.6))
hits = [sum(engine.stats.cache_hits.values()) for engine in (toy.values, toy.slopes)]
folder = str(FOLDER)
assert os.environ["NUMBA_CACHE_DIR"] == numba.config.CACHE_DIR == folder
print(json.dumps({"hits": hits, "folder": folder, "files": len(list(FOLDER.rglob("*.nbi")))}))
"""


def in_new_process(script: str, home: Path, **extra: str) -> dict:
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(sys.path),
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home / "cache"),
        "LOCALAPPDATA": str(home),
        **extra,
    }
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    return json.loads(done.stdout)


def test_a_second_process_loads_what_the_first_compiled(tmp_path: Path) -> None:
    first = in_new_process(SCRIPT, tmp_path)
    second = in_new_process(SCRIPT, tmp_path, NUMBA_CACHE_DIR="elsewhere")
    late = in_new_process("import numba\n" + SCRIPT, tmp_path)
    assert first["hits"] == [0, 0]
    assert second["hits"] == [1, 1]
    assert late["hits"] == [1, 1]
    assert first["folder"] == second["folder"] == late["folder"]
    assert first["files"] == 2


def test_a_cache_folder_that_cannot_be_made(tmp_path: Path) -> None:
    blocked = tmp_path / "a file"
    blocked.write_text("")
    script = (
        "import json, os\n"
        "from tpm_design.arithmetic.kernel_cache import FOLDER\n"
        "print(json.dumps({'folder': str(FOLDER), 'usable': os.access(FOLDER, os.W_OK)}))"
    )
    found = in_new_process(script, tmp_path, XDG_CACHE_HOME=str(blocked), TMPDIR=str(tmp_path))
    assert found["usable"]
    if sys.platform.startswith("linux"):
        assert Path(found["folder"]).parent == tmp_path


def test_any_change_of_any_source_changes_the_hash(tmp_path: Path) -> None:
    package = tmp_path / "package"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    before = source_hash(package)
    assert before == source_hash(PACKAGE)
    source = package / "arithmetic" / "functions.py"
    source.write_text(source.read_text() + "# changed\n")
    changed = source_hash(package)
    source.rename(source.with_name("renamed.py"))
    assert len({before, changed, source_hash(package)}) == 3
