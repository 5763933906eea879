"""Symbols of parameters, set as mathematics."""

from __future__ import annotations

import re
import unicodedata

from tpm_design.report.style import plain

SYMBOL = re.compile(r"([^\W\d_]+)(?:_(\w+))?\Z")
GREEK = re.compile(r"GREEK SMALL LETTER (\w+)")


def mathematics(symbol: str, limb: int) -> str:
    """A symbol such as ``θ_i2`` for one limb, ``$\\theta_{12}$``; as it is where it is no such symbol."""
    match = SYMBOL.match(symbol)
    letters = [_letter(letter) for letter in match[1]] if match else [None]
    if match is None or None in letters:
        return plain(symbol)
    index = (match[2] or "").replace("i", str(limb), 1)
    body = letters[0] if len(letters) == 1 else rf"\mathrm{{{match[1]}}}"
    return f"${body}_{{{index}}}$" if index else f"${body}$"


def _letter(letter: str) -> str | None:
    """A letter in the language of mathematics; None where it has no word for it."""
    if letter.isascii():
        return letter
    greek = GREEK.fullmatch(unicodedata.name(letter, ""))
    return "\\" + greek[1].lower().replace("lamda", "lambda") if greek else None


def equation(symbol: str, written: str) -> str:
    """A symbol in mathematics and its value with the unit: ``$f_{1}$`` and ``250 mm``."""
    value = written.replace(" ", r"\ ").replace("-", "{-}")
    return rf"{symbol}$\mathrm{{\,=\,{value}}}$"
