"""One writer at a time in a run folder."""

from __future__ import annotations

import json
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from tpm_design.errors import UsageError, unwritable

FILE = "run.lock"
BYTE = 1 << 30
"""Which byte is locked on Windows, where nobody can read a locked one: far behind what is written."""


@contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Holds the folder's lock. Raises UsageError where another process holds it, naming it.

    The operating system lets go of the lock of a process that is gone, however it ended.
    """
    path = folder / FILE
    file = _held(path)
    try:
        since = datetime.now(UTC).isoformat(timespec="seconds")
        told = {"process": os.getpid(), "host": socket.gethostname(), "since": since}
        file.truncate(0)
        file.seek(0)
        # a full disk must not keep anybody from the lock: what cannot be told is left out
        with suppress(OSError):
            file.write(json.dumps(told).encode())
        yield
    finally:
        # while it is held, so that nobody takes the lock of a file that is about to go; Windows: afterwards
        if sys.platform != "win32":
            path.unlink(missing_ok=True)
        file.close()
        if sys.platform == "win32":
            with suppress(OSError):
                path.unlink()


def _held(path: Path) -> BinaryIO:
    """The lock's file, open and locked."""
    while True:
        try:
            file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+b", buffering=0)
        except OSError as error:
            raise unwritable(
                "The run folder cannot be locked", error, path, "Choose a folder in which you may write."
            ) from None
        try:
            _lock(file)
            with suppress(FileNotFoundError):
                # who held it before may have removed it in between
                if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                    return file
            file.close()
        except (BlockingIOError, PermissionError):
            holder = _holder(file)
            file.close()
            raise UsageError(
                f"This run is being written already, by {holder}.",
                where=str(path.parent),
                remedy="Wait for it to end, or interrupt it there.",
            ) from None
        except OSError as error:
            file.close()
            raise unwritable(
                "The run folder cannot be locked", error, path, "Choose a folder on a file system with locks."
            ) from None


def _lock(file: BinaryIO) -> None:
    """Take the lock or raise BlockingIOError (Windows: PermissionError)."""
    if sys.platform == "win32":
        import msvcrt

        file.seek(BYTE)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)


def _holder(file: BinaryIO) -> str:
    try:
        file.seek(0)
        told = json.loads(file.read())
        return f"process {told['process']} on {told['host']} since {told['since']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "another process"
