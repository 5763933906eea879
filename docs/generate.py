"""Writes what the documentation says about mechanisms: docs/mechanisms/ and the table in README.md.

Run it after a mechanism was added or changed: `python docs/generate.py`. Another folder may be named; it gets
a README.md with the table if it has one.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from tpm_design.mechanisms import MECHANISMS
from tpm_design.report import write_drawing
from tpm_design.report.page import mechanism_page, overview_table

ROOT = Path(__file__).resolve().parents[1]
FOLDER = "docs/mechanisms"
TABLE = re.compile(r"(?<=<!-- mechanisms -->\n\n).*?(?=\n<!-- end of mechanisms -->)", re.DOTALL)
INDEX = """# Mechanisms

Each page has a drawing, the parameters with their units, working modes, limits, singularities, and the source of the equations; `tpm-design show NAME` prints the same. The pages are generated from what the program knows by `python docs/generate.py`.

"""  # noqa: E501


def generate(root: Path) -> None:
    """Write the pages below ``root``, and the table into the README.md that is there."""
    folder = root / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    kinds = list(MECHANISMS.values())
    for kind in kinds:
        (folder / f"{kind.name}.md").write_text(mechanism_page(kind), encoding="utf-8")
        write_drawing(kind, folder / f"{kind.name}.svg")
    (folder / "README.md").write_text(INDEX + overview_table(kinds, ""), encoding="utf-8")
    readme = root / "README.md"
    if readme.is_file():
        table = overview_table(kinds, f"{FOLDER}/")
        text = TABLE.sub(lambda _: table, readme.read_text(encoding="utf-8"))
        readme.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    generate(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT)
