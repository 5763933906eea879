"""Checks the form of a study and tells pydantic's findings in the program's own words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from tpm_design.errors import did_you_mean
from tpm_design.study.document import Document, Place
from tpm_design.study.faults import Faults, shown
from tpm_design.study.model import NAME_REMEDY, StudyModel
from tpm_design.study.plain import plain

# What to write instead, for the keys people forget most.
_EXAMPLES = {
    "version": "version: 1",
    "name": "name: my-study",
    "units": "units: {length: mm, angle: deg}",
    "mechanism": "mechanism: {type: …, parameters: {…}, mode: …}",
    "objectives": "objectives: [{metric: …, sense: minimize}]",
    "sense": "sense: maximize` or `sense: minimize",
    "center": "center: free` or `center: [x, y, z]",
    "length": "length: mm",
    "angle": "angle: deg",
}


def parse(document: Document) -> StudyModel:
    """Document → model. Raises StudyError, one line for each fault."""
    try:
        return StudyModel.model_validate(document.data)
    except ValidationError as error:
        faults = Faults(document)
        for details in error.errors(include_url=False):
            _translate(details, document, faults)
        faults.raise_if_any()
        raise AssertionError("pydantic refused the study without a reason") from None


def _place(details: ErrorDetails, document: Document) -> Place:
    """The error's keys as they stand in the file: pydantic adds the tags of alternatives."""
    value: Any = document.data
    place: list[str | int] = []
    for step in details["loc"]:
        in_mapping = isinstance(value, dict) and step in value
        in_list = isinstance(value, list) and isinstance(step, int) and step < len(value)
        if in_mapping or in_list:
            value = value[step]
            place.append(step)
    return tuple(place)


def _called(place: Place) -> str:
    """A place as a reader writes it: ``constraints[1].min``."""
    text = ""
    for step in place:
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if text else step
    return shown(text)[1:-1] if text else "the study"


_TYPES = {
    "float": "a number",
    "int": "a whole number",
    "string": "a text",
    "bool": "true or false",
    "dict": "a mapping {…}",
    "model": "a mapping {…}",
    "list": "a list […]",
    "tuple": "a list […]",
}

# Where a word stands for something that can also be written out.
_OTHERWISE: dict[Place, list[str]] = {
    ("mode",): ["a mapping of each field to its signs"],
    ("center",): ["[x, y, z]", "{x: …, y: …, z: …}"],
}
_RELATIONS = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}


def _translate(details: ErrorDetails, document: Document, faults: Faults) -> None:
    kind = details["type"]
    context: Mapping[str, Any] = details.get("ctx", {})
    place = _place(details, document)
    name = _called(place)
    value = details["input"]

    if kind == "unknown_keys":
        for key in context["unknown"]:
            faults.add((*place, key), f"unknown key {shown(key)}", did_you_mean(key, context["known"]))
    elif kind == "fault":
        faults.add(place, f"{name}: {context['what']}", context["remedy"])
    elif kind in {"missing", "union_tag_not_found"}:
        last = details["loc"][-1] if kind == "missing" else "type"
        if isinstance(last, int):  # all tuples of fixed length are points and sizes
            faults.add(place, f"{name} has too few entries", "Give three numbers, one for each axis.")
        else:
            example = _EXAMPLES.get(str(last), f"{last}: …")
            if kind == "union_tag_not_found" and not isinstance(value, dict):
                faults.add(
                    place, f"{name} must be a mapping {{…}}, not {shown(value)}", f"Write `{example}` in it."
                )
            else:
                faults.add(place, f"`{last}` is missing in {name}", f"Add `{example}`.")
    elif kind in {"literal_error", "union_tag_invalid"}:
        if kind == "union_tag_invalid":
            place, name, value = (*place, "type"), f"{name}.type", value["type"]
            known = context["expected_tags"]
        else:
            known = context["expected"]
        words = [word.strip().strip("'") for word in known.replace(" or ", ", ").split(", ")]
        faults.add(
            place,
            f"{name} cannot be {shown(value)}",
            f"Choose {' or '.join([*words, *_OTHERWISE.get(place[-1:], [])])}.",
        )
    elif kind == "finite_number":
        faults.add(place, f"{name} must be a finite number", "Write an ordinary number.")
    elif kind in {"greater_than", "greater_than_equal", "less_than", "less_than_equal"}:
        word, key = _RELATIONS[kind]
        faults.add(place, f"{name} cannot be {shown(value)}", f"Give {word} {plain(context[key])}.")
    elif kind == "string_pattern_mismatch":
        faults.add(place, f"{name} cannot be {shown(value)}", _pattern_remedy(place))
    elif kind in {"too_short", "too_long"}:
        if kind == "too_short" and len(value) >= context["min_length"]:
            return  # there are enough, but not enough good ones: those have errors of their own
        word, key = ("few", "min_length") if kind == "too_short" else ("many", "max_length")
        faults.add(
            place, f"{name} has too {word} entries", f"Give {'at least ' * (word == 'few')}{context[key]}."
        )
    else:
        stem = kind.split("_")[0]
        wanted = _TYPES.get(stem, "something else")
        faults.add(place, f"{name} must be {wanted}, not {shown(value)}", _type_remedy(stem, value))


def _pattern_remedy(place: Place) -> str:
    if place[-1:] == ("name",):
        return NAME_REMEDY
    if place[-1:] == ("file",):
        return "Name a Python file beside the study, such as my_robot.py."
    if place[-1:] == ("sha256",):
        return "Write the 64 hexadecimal digits of the file's SHA-256, or remove it."
    return "Begin with a letter or digit; use at most 120 letters, digits, spaces and . , : ( ) = + / % - _."


def _type_remedy(stem: str, value: Any) -> str:
    if stem == "float" and isinstance(value, str):
        return "Write the number without quotes and without its unit; units are declared once under `units:`."
    if stem == "int" and isinstance(value, float):
        return "Write it without decimal point or exponent."
    if stem == "string" and isinstance(value, int | float):
        return 'Put it in quotes ("…").'
    if value is None:
        return "Give a value, or remove the key."
    return f"Write {_TYPES.get(stem, 'what the documentation shows')}."
