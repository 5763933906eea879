"""Files that a study names: beside it or in folders below, so that a study and its files move together."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from tpm_design.study.document import Place
from tpm_design.study.faults import Faults, shown


def file_beside(name: str, folder: Path, place: Place, faults: Faults) -> Path:
    """The path of a file that a study in ``folder`` names at ``place``; whether it is there is not asked.
    Raises StudyError where it would lie outside the folder."""
    pure = PurePosixPath(name)
    if pure.is_absolute() or ".." in pure.parts or "\\" in name or ":" in name:
        faults.stop(
            place,
            f"the file {shown(name)} is outside the study's folder",
            "Put it beside the study and name it relative to the study, with '/'.",
        )
    path = folder / pure
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # a loop of links, a name too long
        inside = False
    if not inside:
        faults.stop(
            place,
            f"the link {shown(name)} leads out of the study's folder",
            "Put the file itself beside the study.",
        )
    return path
