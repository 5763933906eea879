"""Which run goes on, and whether it may."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpm_design.errors import UsageError
from tpm_design.runs.folder import STUDY, check_is_run, newest_run, read_summary, written_by
from tpm_design.runs.sweeps import WHOLE, Shard
from tpm_design.study.document import parse_document, read_document
from tpm_design.study.plain import dump_yaml

if TYPE_CHECKING:
    from tpm_design.study.study import Study

LATEST = "latest"
MOST_SHOWN = 4


def run_to_resume(study: Study, resume: str | Path, output: Path | None, shard: Shard | None = None) -> Path:
    """The run folder meant by a folder or by ``latest``, the newest of this study's name below ``output``
    that is a search, or a sweep of ``shard``. Raises UsageError."""
    if resume != LATEST:
        return Path(resume)
    if output is None:
        raise UsageError("Without a folder of runs none is the latest.", remedy="Say output=… as well.")
    wanted = None if shard is None else str(shard)
    return newest_run(output, study.name, wanted=lambda folder: _shard_of(folder) == wanted)


def check_resumable(study: Study, folder: Path, shard: Shard | None = None) -> None:
    """Raises UsageError unless ``folder`` holds a run of this version in which ``study`` is asked: a search
    with the same budget or a smaller one, or a sweep of ``shard``."""
    check_is_run(folder)
    _check_kind(folder, shard)
    writer, mine = written_by(folder), version("tpm-design")
    if writer != mine:
        raise UsageError(
            f"This run was written by tpm-design {writer}, and this is {mine}: numbers may differ.",
            where=str(folder),
            remedy="Resume it with that version, or start a new run without --resume.",
        )
    theirs = read_document(folder / STUDY).data
    ours = parse_document(dump_yaml(study.resolved()), folder / STUDY).data
    may_change = "optimizer.budget" if shard is None else None
    changed = [place for place in _differences(theirs, ours) if place != may_change]
    if changed:
        more = f" and {len(changed) - MOST_SHOWN} more" if len(changed) > MOST_SHOWN else ""
        raise UsageError(
            f"The run belongs to another study; different: {', '.join(changed[:MOST_SHOWN])}{more}.",
            where=str(folder),
            remedy=f"{'Nothing' if shard else 'Only the budget'} may change. Resume it with "
            f"{folder / STUDY}, or start a new run without --resume.",
        )
    if shard is not None:
        return
    begun = theirs["optimizer"]["budget"]
    if study.optimizer.budget < begun:
        raise UsageError(
            f"The run has a budget of {begun}, and {study.optimizer.budget} is less.",
            where=str(folder),
            remedy=f"Resume it with --budget {begun} or more.",
        )


def _shard_of(folder: Path) -> str | None:
    """Which shard a run swept, "1/1" for a whole plan; None for a search."""
    try:
        swept = read_summary(folder).get("sweep")
    except UsageError:
        return None
    return str(swept.get("shard")) if isinstance(swept, dict) else None


def _check_kind(folder: Path, shard: Shard | None) -> None:
    """Raises UsageError unless the run is a search, or a sweep of ``shard``."""
    swept, wanted = _shard_of(folder), None if shard is None else str(shard)
    if swept == wanted:
        return
    if swept is None or wanted is None:
        told, command = ("a search", "optimize") if swept is None else ("a sweep", "sweep")
        remedy = f"Resume it with `tpm-design {command}`."
    else:
        told = "the whole plan" if swept == str(WHOLE) else f"shard {swept} of the plan"
        remedy = f"Resume it with --shard {swept}."
    raise UsageError(f"This run is {told}.", where=str(folder), remedy=remedy)


def _differences(theirs: Any, ours: Any, place: str = "") -> Iterator[str]:
    """Places, such as ``optimizer.seed``, at which plain data differ."""
    if isinstance(theirs, dict) and isinstance(ours, dict):
        for key in dict.fromkeys((*theirs, *ours)):
            inner = f"{place}.{key}" if place else str(key)
            if key not in theirs or key not in ours:
                yield inner
            else:
                yield from _differences(theirs[key], ours[key], inner)
    elif isinstance(theirs, list) and isinstance(ours, list) and len(theirs) == len(ours):
        for number, (their, our) in enumerate(zip(theirs, ours, strict=True), start=1):
            yield from _differences(their, our, f"{place}[{number}]")
    elif theirs != ours:
        yield place
