"""`show --drawing`: the files it writes and what it refuses."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from command_line import tpm_design


def labels(svg: str) -> list[str]:
    """The words of an SVG file, in the order in which they were drawn."""
    return re.findall(r"<!-- (.*?) -->", svg)


def test_show_writes_the_same_drawing_twice(tmp_path: Path) -> None:
    first, second = tmp_path / "a.svg", tmp_path / "b.svg"
    for path in (first, second):
        outcome = tpm_design("show", "uru", "--drawing", path)
        assert (outcome.code, outcome.errors) == (0, "")
        assert str(path) in outcome.output
    svg = first.read_text(encoding="utf-8")
    assert first.read_bytes() == second.read_bytes()
    assert {"$A_{1}$", "$C_{3}$", "$f_{1}$", "$d_{b}$", "$k_{1}$", r"$\theta_{12}$"} <= set(labels(svg))
    assert not re.search(r"\b20\d\d-\d\d-\d\d", svg)


def test_show_writes_png(tmp_path: Path) -> None:
    path = tmp_path / "drawing.png"
    assert tpm_design("show", "orthoglide", "--drawing", path).code == 0
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize(
    ("name", "file", "message"),
    [
        ("coverage", "a.svg", "coverage is not a mechanism: there is nothing to draw"),
        ("box", "a.svg", "box is not a mechanism"),
        ("uru", "a.pdf", "A drawing is an SVG or PNG file"),
        ("uru", "missing/a.svg", "cannot be written: No such file or directory"),
    ],
)
def test_what_cannot_be_drawn_is_refused(name: str, file: str, message: str, tmp_path: Path) -> None:
    outcome = tpm_design("show", name, "--drawing", tmp_path / file)
    assert outcome.code == 2
    assert message in outcome.errors
    assert list(tmp_path.iterdir()) == []
