"""Several architectures asked the same: one file, a study for each."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tpm_design.study.document import Document, Place, read_document
from tpm_design.study.faults import Faults, shown
from tpm_design.study.form import parse
from tpm_design.study.model import ARCHITECTURES, NAME, NAME_REMEDY, StudyModel
from tpm_design.study.registries import registries
from tpm_design.study.resolve import resolve
from tpm_design.study.study import Study

# what a study says once for all architectures
SHARED_ONLY = ("version", "name", "units")


@dataclass(frozen=True)
class Comparison:
    """``studies``: label of each architecture → its study, in the order of the file."""

    name: str
    studies: Mapping[str, Study]


def load_comparison(path: str | Path, *, allow_code: bool = False) -> Comparison | None:
    """The studies of a file with ``architectures:``, None where the file is one study. Each architecture is
    a part of a study (``mechanism``, and whatever it does not share); the rest is said once for all.

    Raises StudyError: what is wrong, in which line, what to do. ``allow_code`` as for ``load_study``.
    """
    document = read_document(Path(path))
    if ARCHITECTURES not in document.data:
        return None
    faults = Faults(document)
    architectures, name = document.data[ARCHITECTURES], document.data.get("name")
    if not isinstance(architectures, dict) or len(architectures) < 2:
        faults.stop(
            (ARCHITECTURES,), "there is nothing to compare", "Write `label: {mechanism: …}` for two or more."
        )
    if not isinstance(name, str):
        faults.stop(("name",), "a comparison needs a name", NAME_REMEDY)
    for label, part in architectures.items():
        if not re.fullmatch(NAME, label):
            faults.add(
                (ARCHITECTURES, label), f"an architecture cannot be called {shown(label)}", NAME_REMEDY
            )
        if not isinstance(part, dict):
            faults.add((ARCHITECTURES, label), f"{label} is not a part of a study", "Write {mechanism: {…}}.")
            continue
        for key in part:
            if key in SHARED_ONLY or key == ARCHITECTURES:
                faults.add((ARCHITECTURES, label, key), f"{key} is said once for all", "Write it at the top.")
            elif key not in StudyModel.model_fields:
                remedy = f"Choose from {', '.join(sorted(set(StudyModel.model_fields) - {*SHARED_ONLY}))}."
                faults.add((ARCHITECTURES, label, key), f"{shown(key)} is no part of a study", remedy)
    faults.raise_if_any()
    known = registries()
    parts = {label: _part(document, str(name), label) for label in architectures}
    studies = {
        label: resolve(part, parse(part), known, allow_code=allow_code) for label, part in parts.items()
    }
    return Comparison(str(name), studies)


def _part(document: Document, name: str, label: str) -> Document:
    """One architecture's study as if it stood alone, with the lines of the file."""
    own: Mapping[str, Any] = document.data[ARCHITECTURES][label]
    shared = {key: value for key, value in document.data.items() if key != ARCHITECTURES and key not in own}
    lines: dict[Place, int] = {
        place: line for place, line in document.lines.items() if not place or place[0] in shared
    }
    lines |= {
        place[2:]: line for place, line in document.lines.items() if place[:2] == (ARCHITECTURES, label)
    }
    return Document(document.path, {**shared, **own, "name": f"{name}-{label}"}, lines)
