"""Plain data out: whole floats as integers, and YAML text a person can read."""

from __future__ import annotations

import json
import re
from typing import Any

from pydantic import BaseModel

_WIDTH = 100
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*\Z")
_WORDS = {"null", "true", "false"}


def plain(value: Any) -> Any:
    """Models, tuples and numbers → dict, list, int, float, str, bool; keys without a value left out."""
    if isinstance(value, BaseModel):
        return plain(dict(value))
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return int(value)
    return value


def dump_yaml(data: Any) -> str:
    """Plain data → YAML 1.2 that reads back as the same data."""
    return "".join(f"{line}\n" for line in _block(data))


def flow_yaml(value: Any) -> str:
    """Plain data → YAML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{flow_yaml(key)}: {flow_yaml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(flow_yaml, value)) + "]"
    if isinstance(value, str):
        if _PLAIN.match(value) and value.lower() not in _WORDS:
            return value
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, bool):
        return "true" if value else "false"
    return "null" if value is None else repr(value)


def _block(value: Any) -> list[str]:
    """Lines of a mapping or list, one entry after the other; what fits in a line stays in it."""
    if not isinstance(value, dict | list) or not value:
        return [flow_yaml(value)]
    lines: list[str] = []
    if isinstance(value, list):
        for item in value:
            first, *rest = [flow_yaml(item)] if _fits(item) else _block(item)
            lines += [f"- {first}", *(f"  {line}" for line in rest)]
        return lines
    for key, item in value.items():
        # objectives, constraints and so on read best as one entry a line
        entries = isinstance(item, list) and any(isinstance(entry, dict) for entry in item)
        if _fits(item) and not entries:
            lines.append(f"{flow_yaml(key)}: {flow_yaml(item)}")
        else:
            lines += [f"{flow_yaml(key)}:", *(f"  {line}" for line in _block(item))]
    return lines


def _fits(value: Any) -> bool:
    return not isinstance(value, dict | list) or len(flow_yaml(value)) <= _WIDTH
