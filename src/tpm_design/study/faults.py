"""Everything wrong with a study, each with its line and remedy, told in one error."""

from __future__ import annotations

from typing import Any, NoReturn

from tpm_design.errors import StudyError
from tpm_design.study.document import Document, Place, where

_SHOWN = 10
_ENOUGH = 100


def shown(value: Any) -> str:
    """A value from the file as a message may show it: one short printable line."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    text = repr(value) if isinstance(value, str) else f"{value}"
    return text if len(text) <= 60 else f"{text[:57]}…"


class Faults:
    """Collects faults of one study; ``stop`` raises them as one StudyError, the first in full."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._found: list[tuple[int, str, str]] = []

    def add(self, place: Place, what: str, remedy: str) -> None:
        """One fault at the line of a key: what is wrong and what to do about it."""
        fault = (self._document.line(place), what, remedy)
        if fault not in self._found:
            self._found.append(fault)
        if len(self._found) >= _ENOUGH:
            self.raise_if_any()

    def stop(self, place: Place, what: str, remedy: str) -> NoReturn:
        """A fault that leaves nothing further to check."""
        self.add(place, what, remedy)
        self.raise_if_any()
        raise AssertionError("unreachable")

    def raise_if_any(self) -> None:
        """StudyError if anything was found."""
        if not self._found:
            return
        self._found.sort(key=lambda fault: fault[0])
        (line, what, remedy), *others = self._found
        more = [f"\n{where(self._document.path, n)}: {w}. {r}" for n, w, r in others[:_SHOWN]]
        if len(others) > _SHOWN:
            more.append(f"\n(and {len(others) - _SHOWN} more)")
        raise StudyError(what, where=where(self._document.path, line), remedy=remedy + "".join(more))
