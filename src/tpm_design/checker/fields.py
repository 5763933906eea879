"""Reading a certificate's keys, each with a clear word where it is not what it should be."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from tpm_design.errors import UsageError

REMEDY = "Give a certificate.json as `tpm-design certify` wrote it."
LARGEST = 1e15


class AlteredError(Exception):
    """The text is not as a certificate is written."""


class Fields:
    """A mapping of the certificate and where it stands in the file."""

    def __init__(self, data: Any, file: str, place: str = "") -> None:
        self.file, self.place = file, place
        if not isinstance(data, dict):
            self.refuse("", "a mapping")
        self.data: dict[str, Any] = data

    def refuse(self, key: str, expected: str) -> NoReturn:
        place = ".".join(part for part in (self.place, key) if part) or "the whole file"
        raise UsageError(f"{place} is not {expected}", where=self.file, remedy=REMEDY)

    def value(self, key: str) -> Any:
        if key not in self.data:
            self.refuse(key, "there")
        return self.data[key]

    def number(self, key: str) -> float:
        return self._number(self.value(key), key)

    def number_or_none(self, key: str) -> float | None:
        value = self.data.get(key)
        return None if value is None else self._number(value, key)

    def switch(self, key: str) -> bool:
        value = self.value(key)
        return value if isinstance(value, bool) else self.refuse(key, "true or false")

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        return self._numbers(self.value(key), key, count)

    def triple(self, key: str) -> tuple[float, float, float]:
        x, y, z = self.numbers(key, 3)
        return x, y, z

    def triples(self, key: str) -> tuple[tuple[float, float, float], ...]:
        found = []
        for index, item in enumerate(self.items(key)):
            x, y, z = self._numbers(item, f"{key}[{index}]", 3)
            found.append((x, y, z))
        return tuple(found)

    def intervals(self, key: str) -> tuple[tuple[float, float], ...]:
        """Three intervals, in order."""
        found = []
        for index, item in enumerate(self.items(key)):
            low, high = self._numbers(item, f"{key}[{index}]", 2)
            if low > high:
                self.refuse(f"{key}[{index}]", "an interval in order")
            found.append((low, high))
        if len(found) != 3:
            self.refuse(key, "three intervals")
        return tuple(found)

    def text(self, key: str, choices: Sequence[str] = ()) -> str:
        value = self.value(key)
        if not isinstance(value, str):
            self.refuse(key, "text")
        if choices and value not in choices:
            self.refuse(key, f"one of {', '.join(choices)}")
        return value

    def items(self, key: str) -> list[Any]:
        value = self.value(key)
        if not isinstance(value, list):
            self.refuse(key, "a list")
        return value

    def fields(self, key: str) -> Fields:
        return Fields(self.value(key), self.file, ".".join(part for part in (self.place, key) if part))

    def entries(self, key: str) -> list[Fields]:
        return [
            Fields(item, self.file, f"{self.place}.{key}[{index}]" if self.place else f"{key}[{index}]")
            for index, item in enumerate(self.items(key))
        ]

    def _number(self, value: Any, key: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
            self.refuse(key, "a number")
        return float(value)

    def _numbers(self, value: Any, key: str, count: int) -> tuple[float, ...]:
        if not isinstance(value, list) or len(value) != count:
            self.refuse(key, f"a list of {count} numbers")
        return tuple(self._number(item, f"{key}[{index}]") for index, item in enumerate(value))


def canonical_sha256(data: Any) -> str:
    """Of the JSON text with sorted keys and without spaces."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def read_certificate(path: Path) -> Fields:
    """The file's keys. Raises UsageError where it is not JSON, AlteredError where none is so written."""
    where = path.name
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise UsageError(f"cannot be read: {error.strerror}", where=where, remedy=REMEDY) from None
    except UnicodeDecodeError:
        raise UsageError("is not text", where=where, remedy=REMEDY) from None
    try:
        data = json.loads(text, parse_float=_exact, parse_constant=_refused, object_pairs_hook=_unique)
    except (json.JSONDecodeError, RecursionError):
        raise UsageError("is not JSON", where=where, remedy=REMEDY) from None
    return Fields(data, where)


def _exact(text: str) -> float:
    # two decimals may mean the same number: only the one that is written is the file's
    value = float(text)
    if repr(value) != text or not math.isfinite(value):
        raise AlteredError(f"the number {text[:40]} is not written as certificates write it")
    return value


def _refused(text: str) -> float:
    raise AlteredError(f"{text} is not a number of a certificate")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise AlteredError("a key is there twice")
    return found
