"""Files that outlive what is writing them: whole or not at all, or longer by whole lines."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path

from tpm_design.errors import RunStoppedError

SECONDS_TO_THE_DISK = 1.0
"""A killed program loses no line that was appended; a power cut those of this time."""


def replace_file(path: Path, text: str) -> None:
    """Write a whole file at once, so that a crash leaves the old one or the new. Raises RunStoppedError."""
    part = path.with_name(path.name + ".part")
    try:
        with part.open("w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise run_stopped(path, error) from None
    _sync_names(path.parent)


def _sync_names(folder: Path) -> None:
    """Force the names in a folder to the disk, where the operating system has such a thing."""
    with suppress(OSError):
        names = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(names)
        finally:
            os.close(names)


class AppendedLines:
    """A file that grows by whole lines: what there was no room for is taken back."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = path.open("ab", buffering=0)
        self._length = path.stat().st_size
        self._synced = time.monotonic()

    def append(self, line: str) -> None:
        """Hand one line, its end included, to the operating system. Raises RunStoppedError."""
        rest = memoryview(line.encode("utf-8"))
        whole = self._length + len(rest)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
            self._length = whole
            if time.monotonic() - self._synced > SECONDS_TO_THE_DISK:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self._length)
            raise run_stopped(self._path, error) from None

    def close(self) -> None:
        """Nothing more is appended; again harmless."""
        self._file.close()


def run_stopped(path: Path, error: OSError) -> RunStoppedError:
    """What to tell where a file of a run cannot be written."""
    return RunStoppedError(
        f"The run had to stop, this file cannot be written: {error.strerror or error}.",
        where=str(path),
        remedy=f"Make room, then go on with --resume {path.parent}; what was evaluated before is kept.",
    )
