"""SHA-256 of texts and of plain data, in hexadecimal."""

from __future__ import annotations

import hashlib
import json
from typing import Any


def text_sha256(text: str) -> str:
    """Of the text in UTF-8."""
    return hashlib.sha256(text.encode()).hexdigest()


def canonical_sha256(data: Any) -> str:
    """Of the JSON text with sorted keys and without spaces: the same for equal data, however they are
    ordered."""
    return text_sha256(json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False))
