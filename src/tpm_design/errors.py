"""The one family of errors a user can meet.

Every message says what is wrong, where, and what to do about it. The command line prints it without
a traceback and ends with the error's exit code.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path


class TpmDesignError(Exception):
    """Base of every error that is the user's to mend.

    ``what`` is one sentence, ``where`` a place such as ``study.yaml:12``, ``remedy`` what to do.
    """

    exit_code = 2

    def __init__(self, what: str, *, where: str | None = None, remedy: str | None = None) -> None:
        self.what = what
        self.where = where
        self.remedy = remedy
        super().__init__(self.message)

    @property
    def message(self) -> str:
        place = f"{self.where}: " if self.where else ""
        remedy = f"\n  {self.remedy}" if self.remedy else ""
        return f"{place}{self.what}{remedy}"


class StudyError(TpmDesignError):
    """A study file that cannot be used."""


class PlugInError(TpmDesignError):
    """A mechanism's own Python file that cannot be used."""


class ParameterError(TpmDesignError):
    """A design parameter, mode or option that has no meaning."""


class UsageError(TpmDesignError):
    """A command or call that asks for something that is not there."""


class RunStoppedError(TpmDesignError):
    """A run that could not go on, and can be resumed."""

    exit_code = 130


class RefusedError(TpmDesignError):
    """A request that cannot work, refused before anything runs."""


def unwritable(what: str, error: OSError, path: Path, remedy: str | None = None) -> UsageError:
    """What to tell where the system does not let a file or folder be made. ``what`` is a sentence without its
    stop, such as "The table cannot be written"."""
    return UsageError(f"{what}: {error.strerror or error}.", where=str(path), remedy=remedy)


def unwritable_file(error: OSError, path: Path) -> UsageError:
    """``unwritable`` of one file that was asked for."""
    return unwritable("This file cannot be written", error, path, "Its folder must exist and be writable.")


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A remedy: the nearest known word, or all of them."""
    names = sorted(known)
    close = get_close_matches(word, names, n=1, cutoff=0.6)
    if close:
        return f"Did you mean {close[0]!r}?"
    return f"Known: {', '.join(names)}." if names else "Nothing of this kind is known here."
