"""A study's mechanism from a Python file beside it: read, held to its hash, and run only where allowed."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from tpm_design.errors import StudyError
from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.mechanisms.plug_in import load_kind
from tpm_design.study.beside import file_beside
from tpm_design.study.document import Place, read_bytes, where
from tpm_design.study.faults import Faults, shown

PLACE: Place = ("mechanism", "file")


@dataclass(frozen=True)
class PlugIn:
    """A mechanism's own file. ``name``: relative to the study, with "/"; ``source``: its content."""

    name: str
    source: bytes = field(repr=False)

    @property
    def sha256(self) -> str:
        """SHA-256 of the file."""
        return hashlib.sha256(self.source).hexdigest()

    def write_beside(self, study: Path) -> None:
        """Write a copy to where a study in the file ``study`` looks for it."""
        path = study.parent / PurePosixPath(self.name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(self.source)


def read_plug_in(
    name: str,
    sha256: str | None,
    folder: Path,
    taken: Collection[str],
    faults: Faults,
    *,
    allow_code: bool,
) -> tuple[PlugIn, MechanismKind]:
    """The file that a study in ``folder`` names, and the kind of mechanism that it defines.

    The file is run here, if ``allow_code``; else nothing of it is even read. Raises StudyError where that is
    not allowed or the file is not the one that the study means, PlugInError where it defines no mechanism.
    """
    if not allow_code:
        faults.stop(
            PLACE,
            f"the mechanism is a Python file, {shown(name)}, and running it was not allowed",
            "It can do whatever you can. Read it; if you trust it, add --allow-code "
            "(in Python: load_study(…, allow_code=True)).",
        )
    path = file_beside(name, folder, PLACE, faults)
    try:
        plug_in = PlugIn(PurePosixPath(name).as_posix(), read_bytes(path, what="Python"))
    except StudyError as error:
        told = f"the mechanism's file {where(path)}: {error.what}"
        faults.stop(PLACE, told, error.remedy or "Check the file.")
    if sha256 is not None and sha256 != plug_in.sha256:
        faults.stop(
            ("mechanism", "sha256"),
            f"the file {shown(name)} is not the one that the study was written for: its SHA-256 is another",
            "Put the original back; or remove `sha256:` to use the file as it is now.",
        )
    return plug_in, load_kind(plug_in.source, path, taken)


def kind_in_file(path: Path) -> MechanismKind:
    """The kind of mechanism that a file outside any study defines. Runs the file. Raises StudyError where it
    cannot be read, PlugInError where it defines none."""
    return load_kind(read_bytes(path, what="Python"), path, MECHANISMS)
