"""A study file as plain data with the line of every key.

Strict on purpose: one YAML 1.2 document of mappings, lists, numbers, booleans and names. No tags (they
could run code), no anchors or aliases (they could blow up), no key twice.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
    StreamEndEvent,
)

from tpm_design.errors import StudyError

Place = tuple[str | int, ...]
"""The keys and list positions that lead to a value."""

LARGEST_FILE = 1_000_000
DEEPEST = 12
LONGEST_LINE = 100_000

# What YAML 1.2 allows in a file, without the byte order mark that may only come first.
_UNPRINTABLE = re.compile(r"[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]")

# The core schema of YAML 1.2.2, section 10.3.2.
_INTEGER = re.compile(r"[-+]?[0-9]+\Z")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?\Z")
_SPECIAL = re.compile(r"([-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN))\Z")
_WORDS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


@dataclass(frozen=True)
class Document:
    """A parsed file: ``data`` holds dict, list, str, int, float, bool and None only."""

    path: Path
    data: dict[str, Any]
    lines: Mapping[Place, int]

    def line(self, place: Place) -> int:
        """Line of a key or list item, or of the nearest one around it."""
        while place and place not in self.lines:
            place = place[:-1]
        return self.lines.get(place, 1)


def where(path: Path, line: int | None = None) -> str:
    """A place in a file as messages name it, without characters a terminal would act on."""
    name = str(path)
    name = name if name.isprintable() else repr(name)
    return name if line is None else f"{name}:{line}"


def number(text: str) -> int | float | None:
    """A number as YAML 1.2 writes it, or None."""
    if _INTEGER.match(text) and len(text) < 20:  # longer ones mean no more than their float
        return int(text)
    if _FLOAT.match(text):
        return float(text)
    if _SPECIAL.match(text):
        return float(text.replace(".", "", 1))
    return None


def read_bytes(path: Path, largest: int = LARGEST_FILE, *, what: str = "study") -> bytes:
    """The content of a file of at most ``largest`` bytes. Raises StudyError."""
    try:
        if path.is_dir():
            raise StudyError(
                f"this is a folder, not a {what} file", where=where(path), remedy="Name a file in it."
            )
        if not path.exists():
            raise StudyError(
                f"there is no such {what} file", where=where(path), remedy="Check the name and the folder."
            )
        if not path.is_file():
            raise StudyError("this is not a regular file", where=where(path), remedy=f"Name a {what} file.")
        with path.open("rb") as stream:
            raw = stream.read(largest + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise StudyError(
            f"the {what} file cannot be read: {reason}",
            where=where(path),
            remedy="Check its name and permissions.",
        ) from None
    if len(raw) > largest:
        raise StudyError(
            f"the {what} file is larger than {largest / 1e6:g} MB",
            where=where(path),
            remedy="Shorten it, or split it in several.",
        )
    return raw


def read_text(path: Path, largest: int = LARGEST_FILE, *, what: str = "study") -> str:
    """The text of a UTF-8 file of at most ``largest`` bytes. Raises StudyError."""
    raw = read_bytes(path, largest, what=what)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise StudyError(
            f"byte {error.start + 1} is not UTF-8 text",
            where=where(path, line),
            remedy="Save the file as UTF-8.",
        ) from None
    odd = _UNPRINTABLE.search(text)
    if odd is not None:
        raise StudyError(
            f"there is a control character (U+{ord(odd[0]):04X})",
            where=where(path, text.count("\n", 0, odd.start()) + 1),
            remedy="Remove it.",
        )
    return text


def read_document(path: Path) -> Document:
    """Reads a study file. Raises StudyError with the line for everything that is not plain YAML 1.2."""
    return parse_document(read_text(path), path)


def parse_document(text: str, path: Path) -> Document:
    """Text → Document; ``path`` names it in messages."""
    for count, row in enumerate(text.splitlines(), start=1):
        if len(row) > LONGEST_LINE:
            raise StudyError(
                f"the line has more than {LONGEST_LINE} characters",
                where=where(path, count),
                remedy="Break it into shorter lines.",
            )
    events = _events(text, path)
    reader = _Reader(path, events)
    return reader.document()


def _events(text: str, path: Path) -> Iterator[Event]:
    """The YAML events, with the parser's complaints in our words."""
    try:
        yield from YAML(typ="safe", pure=True).parse(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = " ".join(str(error.problem or error.context or "it does not parse").split())
        raise StudyError(
            f"this is not valid YAML: {problem[:200]}",
            where=where(path, mark.line + 1 if mark else 1),
            remedy="Check the brackets, quotes, colons and the indentation (spaces, no tabs) here and above.",
        ) from None
    except Exception as error:  # the parser meets some malformed text with whatever it stumbles over
        raise StudyError(
            f"this is not valid YAML ({type(error).__name__})",
            where=where(path, 1),
            remedy="Check the brackets, quotes and escapes.",
        ) from None


class _Reader:
    """Builds plain data from events, noting lines and refusing what a study has no use for."""

    def __init__(self, path: Path, events: Iterator[Event]) -> None:
        self._path = path
        self._events = events
        self._lines: dict[Place, int] = {}

    def document(self) -> Document:
        value: Any = None
        seen = 0
        for event in self._events:
            if isinstance(event, DocumentStartEvent):
                seen += 1
                if seen > 1:
                    self._refuse(event, "there is a second document after '---'", "Write one study per file.")
                if event.version not in {None, (1, 2)}:
                    self._refuse(event, "this YAML version is not 1.2", "Remove the %YAML line.")
            elif isinstance(event, (MappingStartEvent, SequenceStartEvent, ScalarEvent, AliasEvent)):
                value = self._value(event, ())
            elif isinstance(event, StreamEndEvent):
                break
        if value is None:
            raise StudyError(
                "the file holds no study",
                where=where(self._path, 1),
                remedy="`tpm-design init` writes one to start from.",
            )
        if not isinstance(value, dict):
            raise StudyError(
                "a study is a mapping of keys to values",
                where=where(self._path, 1),
                remedy="Begin with `version: 1`; `tpm-design init` writes an example.",
            )
        return Document(self._path, value, self._lines)

    def _refuse(self, event: Event, what: str, remedy: str) -> None:
        raise StudyError(what, where=where(self._path, event.start_mark.line + 1), remedy=remedy)

    def _value(self, event: Event, place: Place) -> Any:
        self._lines.setdefault(place, event.start_mark.line + 1)
        if isinstance(event, AliasEvent) or getattr(event, "anchor", None) is not None:
            self._refuse(event, "YAML anchors and aliases are not allowed", "Write the value out.")
        if getattr(event, "tag", None) is not None:
            self._refuse(event, "YAML tags ('!…') are not allowed", "Remove the tag.")
        if len(place) > DEEPEST:
            self._refuse(
                event, "this is nested too deep for a study", "Check the brackets and the indentation."
            )
        if isinstance(event, ScalarEvent):
            return self._scalar(event)
        if isinstance(event, SequenceStartEvent):
            items: list[Any] = []
            while not isinstance(item := next(self._events), SequenceEndEvent):
                items.append(self._value(item, (*place, len(items))))
            return items
        mapping: dict[str, Any] = {}
        while not isinstance(item := next(self._events), MappingEndEvent):
            key = self._key(item, place)
            if key in mapping:
                first = self._lines[(*place, key)]
                self._refuse(
                    item, f"the key {_short(key)} is there twice", f"Keep one; the first is in line {first}."
                )
            self._lines[(*place, key)] = item.start_mark.line + 1
            mapping[key] = self._value(next(self._events), (*place, key))
        return mapping

    def _key(self, event: Event, place: Place) -> str:
        key = self._value(event, (*place, "")) if isinstance(event, ScalarEvent) else None
        self._lines.pop((*place, ""), None)
        if not isinstance(key, str) or not key:
            found = _short(event.value) if isinstance(event, ScalarEvent) else "a list or mapping"
            self._refuse(event, f"a key must be a name, not {found}", "Write `name: value`.")
        return str(key)

    def _scalar(self, event: ScalarEvent) -> Any:
        text: str = event.value
        if event.implicit[0]:  # plain: not quoted
            if text in _WORDS:
                return _WORDS[text]
            value = number(text)
            if value is not None:
                return value
        if not text.isprintable():
            self._refuse(
                event,
                f"the text {_short(text)} has line breaks or control characters",
                "Write it in one plain line.",
            )
        return text


def _short(text: str) -> str:
    return repr(text) if len(text) <= 40 else f"{text[:37]!r}…"
