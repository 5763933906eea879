"""Deviations as people read them: sentences, and a table in Markdown for a pull request."""

from __future__ import annotations

from collections.abc import Sequence

from tpm_design.baselines.deviations import Deviations, Exceedance, Tolerance
from tpm_design.baselines.tables import with_unit
from tpm_design.report.escape import table, text

MOST_IN_MARKDOWN = 100
"""Exceedances in the Markdown summary: a comment has a largest size."""

HEADINGS = ["where", "what", "baseline", "run", "deviation", "allowed"]


def exceedance_cells(exceedance: Exceedance) -> list[str]:
    """One row below ``HEADINGS``."""
    deviation = allowed = ""
    if exceedance.deviation is not None and exceedance.allowed is not None:
        deviation, allowed = (
            with_unit(f"{number:.3g}", exceedance.column)
            for number in (exceedance.deviation, exceedance.allowed)
        )
        if exceedance.relative is not None:
            deviation += f" ({exceedance.relative:.2g} of it)"
    where, what = exceedance.row or "every row", exceedance.column or "the row"
    return [where, what, exceedance.baseline, exceedance.run, deviation, allowed]


def exceedance_text(exceedance: Exceedance) -> str:
    """The same as one line."""
    where, what, before, now, deviation, allowed = exceedance_cells(exceedance)
    line = f"{where}, {what}: {before} → {now}"
    return f"{line}, deviates by {deviation}, allowed {allowed}" if deviation else line


def counts_text(deviations: Deviations) -> str:
    """What was compared: ``designs.csv, 1 row, 14 columns, 14 values, 12 of them identical``."""
    rows, columns = (
        f"{count} {word}{'' if count == 1 else 's'}"
        for count, word in ((deviations.rows, "row"), (len(deviations.columns), "column"))
    )
    return (
        f"{deviations.file}, {rows}, {columns}, {deviations.cells} values, {deviations.identical} identical"
    )


def tolerance_text(tolerance: Tolerance) -> str:
    return f"{tolerance.relative:g} of the baseline's value + {tolerance.absolute:g} in each column's unit"


def outcome_text(deviations: Deviations) -> str:
    count = len(deviations.exceedances)
    if count == 0:
        return "within tolerance"
    return f"outside tolerance, {count} exceedance{'' if count == 1 else 's'}"


def comparison_markdown(
    deviations: Deviations, study: str, tolerance: Tolerance, remarks: Sequence[str], updated: bool
) -> str:
    """The summary for a pull request."""
    compared, allowed = text(counts_text(deviations)), text(tolerance_text(tolerance))
    lines = [
        f"### {text(study)}: {outcome_text(deviations)}",
        "",
        f"Compared with the baseline: {compared}. Allowed: {allowed}.",
    ]
    shown = deviations.exceedances[:MOST_IN_MARKDOWN]
    if shown:
        rows = [[text(cell) for cell in exceedance_cells(exceedance)] for exceedance in shown]
        lines += ["", *table(HEADINGS, rows)]
    if len(shown) < len(deviations.exceedances):
        lines += ["", f"And {len(deviations.exceedances) - len(shown)} more."]
    for remark in (*remarks, *(["The run is the baseline now."] if updated else [])):
        lines += ["", text(remark)]
    return "\n".join(lines) + "\n"
