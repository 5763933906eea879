"""Write the report of a run into its folder."""

from __future__ import annotations

from pathlib import Path

from tpm_design.errors import unwritable
from tpm_design.report.figures import pictures, write_pictures
from tpm_design.report.markdown import report_markdown
from tpm_design.report.reported import read_reported

REPORT = "report.md"


def write_report(folder: Path, *, allow_code: bool = False) -> tuple[Path, ...]:
    """Write ``report.md`` and ``figures/*.png`` of the run in ``folder``, finished or cut short, and return
    their paths, the report first. ``allow_code``: whether the run's own mechanism may be run.

    Raises UsageError where ``folder`` is no run, its log is damaged or it cannot be written to, and
    StudyError or PlugInError where its study cannot be used.
    """
    reported = read_reported(folder, allow_code=allow_code)
    found = pictures(reported)
    try:
        images = write_pictures(folder, found)
        report = folder / REPORT
        report.write_text(report_markdown(reported, found), encoding="utf-8")
    except OSError as error:
        raise unwritable(
            "The report cannot be written",
            error,
            folder,
            "Check that the folder can be written to and that the disk is not full.",
        ) from None
    return report, *images
