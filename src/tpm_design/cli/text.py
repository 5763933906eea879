"""Plain-text tables for terminals, files and pipes."""

from __future__ import annotations

from collections.abc import Sequence


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns padded to their widest cell; numbers to the right, words to the left."""
    widths = [max(len(str(row[k])) for row in [headings, *rows]) for k in range(len(headings))]
    right = [bool(rows) and all(_is_number(row[k]) for row in rows) for k in range(len(headings))]

    def line(cells: Sequence[str]) -> str:
        padded = (
            str(cell).rjust(width) if is_right else str(cell).ljust(width)
            for cell, width, is_right in zip(cells, widths, right, strict=True)
        )
        return "  ".join(padded).rstrip()

    return "\n".join([line(headings), "  ".join("-" * width for width in widths), *map(line, rows)])


def _is_number(cell: str) -> bool:
    text = str(cell).split(" ")[0]
    try:
        float(text)
    except ValueError:
        return text in {"", "–", "±"}
    return True
