"""The page of a mechanism in the docs, and the list of all of them, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from tpm_design.mechanisms.base import MechanismKind
from tpm_design.report.escape import code_cell, table, text
from tpm_design.report.facts import CONVENTION, Table, mechanism_facts, overview


def mechanism_page(kind: MechanismKind) -> str:
    """What `tpm-design show` says, with the drawing ``<name>.svg`` beside the page."""
    facts = mechanism_facts(kind)
    lines = [f"# {text(kind.title)}", "", f"`type: {kind.name}` in a study.", ""]
    lines += [f"![Line drawing of the {text(kind.title)}, limb 1 labelled]({kind.name}.svg)", ""]
    lines += [
        f"Source: {text(kind.source)}.",
        "",
        *(f"- {name}: {text(words)}" for name, words in facts.lines),
    ]
    for one in facts.tables:
        lines += ["", *markdown_table(one)]
    lines += ["", text(CONVENTION)]
    if facts.remarks:
        lines += ["", "## Remarks", "", *(f"- {text(remark)}" for remark in facts.remarks)]
    return "\n".join(lines) + "\n"


def overview_table(kinds: Sequence[MechanismKind], folder: str) -> str:
    """All mechanisms with links to their pages in ``folder``, such as ``docs/mechanisms/``."""
    rows = overview(kinds)
    linked = [[f"[`{row[0]}`]({folder}{row[0]}.md)", *(text(cell) for cell in row[1:])] for row in rows.rows]
    return "\n".join(table(list(rows.headings), linked)) + "\n"


def markdown_table(one: Table) -> list[str]:
    """Names of the program as code, words as words."""
    rows = [[code_cell(row[0]), *(text(cell) for cell in row[1:])] for row in one.rows]
    return table([text(heading) for heading in one.headings], rows)
