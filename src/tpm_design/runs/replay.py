"""Evaluations of an earlier run as answers: a search that starts again repeats its path at no cost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from tpm_design.runs.search import Answers, Entry, design_key


def answers_in(entries: Iterable[Entry]) -> Answers:
    """What a log answers: by the samples that a design was judged by, and by its exact numbers."""
    return {(entry.judged_by, design_key(entry.evaluation.design)): entry.evaluation for entry in entries}


def left_over(stored: Sequence[Entry], entries: Sequence[Entry]) -> list[Entry]:
    """The stored entries that a search did not ask for, in their order, numbered after its own."""
    asked = answers_in(entries)
    rest = [e for e in stored if (e.judged_by, design_key(e.evaluation.design)) not in asked]
    return [replace(entry, number=len(entries) + place) for place, entry in enumerate(rest)]
