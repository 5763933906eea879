"""One row of a log, and what it answers when the same is asked again."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from tpm_design.digests import text_sha256
from tpm_design.evaluation.result import Cutoff, Evaluation
from tpm_design.problem import Design, Sample

Key = tuple[float | str, ...]

AnswerKey = tuple[str, Key, Cutoff | None]

Answers = Mapping[AnswerKey, Evaluation]
"""Evaluations by what a design was judged by (as in ``Entry``), the design's key, and the cutoff at which it
was aborted, None where it was measured to the end."""


@dataclass(frozen=True)
class Entry:
    """One evaluation in the log, numbered from 0 in the order in which points were asked for. ``round``: from
    1; each further one judges designs by more samples than those before. ``judged_by``: ``samples_digest``
    of these samples."""

    number: int
    evaluation: Evaluation
    round: int = 1
    judged_by: str = ""


def answer_key(entry: Entry) -> AnswerKey:
    """What an entry answers."""
    return entry.judged_by, design_key(entry.evaluation.design), entry.evaluation.cutoff


def design_key(design: Design) -> Key:
    """Exact identity of a design."""
    return tuple(design[name] for name in sorted(design))


def samples_digest(samples: Sequence[Sample]) -> str:
    """What tells samples apart, by their exact numbers; empty where there are none."""
    if not samples:
        return ""
    text = json.dumps([asdict(sample) for sample in samples], sort_keys=True)
    return text_sha256(text)[:16]
