"""Names and sentences that came from files, made harmless in Markdown."""

from __future__ import annotations

import re

_SPECIAL = re.compile(r"([\\`*_\[\]<>|~&$#!])")
_BLANK = re.compile(r"[\s\x00-\x1f\x7f\u2028\u2029]+")
_LINK = re.compile(r"(?<=[A-Za-z]):(?=//)|(?<=[wW]{3})\.")
_LINE_START = re.compile(r"^(\d*)([-+=:.)])")


def text(words: str) -> str:
    """One line of plain words: no emphasis, links, HTML, formulas, lists or table cells of its own."""
    line = _SPECIAL.sub(r"\\\1", _one_line(words))
    line = _LINK.sub(lambda match: "\\" + match[0], line)
    return _LINE_START.sub(r"\1\\\2", line)


def code(name: str) -> str:
    """A name in a code span of its own, anywhere but in a table."""
    line = _one_line(name)
    if not line:
        return ""
    fence = "`" * (1 + max((len(run) for run in re.findall(r"`+", line)), default=0))
    room = " " if line.startswith("`") or line.endswith("`") else ""
    return f"{fence}{room}{line}{room}{fence}"


def code_cell(name: str) -> str:
    """A name in a code span in a table, where a bar ends a cell even within code."""
    return code(name).replace("|", r"\|")


def table(headings: list[str], rows: list[list[str]]) -> list[str]:
    """Lines of a table of finished cells."""
    lines = [headings, ["---"] * len(headings), *rows]
    return ["| " + " | ".join(line) + " |" for line in lines]


def _one_line(words: str) -> str:
    return _BLANK.sub(" ", words).strip()
