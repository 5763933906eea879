"""Evaluations of an earlier run as answers: a search that starts again repeats its path at no cost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from tpm_design.runs.entry import Answers, Entry, answer_key


def answers_in(entries: Iterable[Entry]) -> Answers:
    """What a log answers: by the samples that a design was judged by, by its exact numbers, and by the cutoff
    that ended the evaluation."""
    return {answer_key(entry): entry.evaluation for entry in entries}


def left_over(stored: Sequence[Entry], entries: Sequence[Entry]) -> list[Entry]:
    """The stored entries that a search did not ask for, in their order, numbered after its own."""
    asked = answers_in(entries)
    rest = [entry for entry in stored if answer_key(entry) not in asked]
    return [replace(entry, number=len(entries) + place) for place, entry in enumerate(rest)]
