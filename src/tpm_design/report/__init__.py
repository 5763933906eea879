"""What a run says to people: report.md and figures."""

from __future__ import annotations

from pathlib import Path

from tpm_design.mechanisms.base import MechanismKind


def write_report(folder: Path, *, allow_code: bool = False) -> tuple[Path, ...]:
    """Writes report.md and figures/*.png into a run folder; returns their paths.

    ``allow_code``: whether the Python file of the run's own mechanism may be run. Raises UsageError for a
    folder that is no run or cannot be written, StudyError or PlugInError for its study.
    """
    # drawing libraries load slowly and the command line shares the words of this room
    from tpm_design.report.write import write_report as write

    return write(folder, allow_code=allow_code)


def write_drawing(kind: MechanismKind, path: Path) -> None:
    """Writes the labelled line drawing of a mechanism's example, as SVG or PNG by the name of the file.

    Raises UsageError for another kind of file, one that cannot be written, and a mechanism without a pose to
    be drawn at.
    """
    from tpm_design.report.example import write_drawing as write

    write(kind, path)
