"""What a report is about: a run read back, its study, and the design it ended with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tpm_design.errors import ParameterError
from tpm_design.evaluation.contexts import design_context
from tpm_design.metrics.context import Context
from tpm_design.problem import Problem
from tpm_design.runs.entry import Entry
from tpm_design.runs.folder import STUDY, StoredRun, read_run
from tpm_design.runs.ranking import best_entry, front_entries
from tpm_design.study import Study, load_study
from tpm_design.study.sweep_points import sweep_points


@dataclass(frozen=True)
class Reported:
    """A run and the study it answers. ``best``: the best feasible entry, else the one of least violation;
    None where nothing was evaluated. ``swept``: whether it is a sweep and no search. ``front``: of a search
    with several objectives, best first by the first; ``best`` is then its knee."""

    study: Study
    run: StoredRun
    best: Entry | None
    swept: bool
    front: tuple[Entry, ...]

    @property
    def problem(self) -> Problem:
        return self.study.problem

    @property
    def finished(self) -> bool:
        """Whether the run came to its end and wrote its summary."""
        return bool(self.run.summary)

    @property
    def feasible(self) -> bool:
        return self.best is not None and self.best.evaluation.status == "feasible"


def read_reported(folder: Path, *, allow_code: bool = False) -> Reported:
    """The run in ``folder``, finished or cut short; ``allow_code`` as ``load_study`` takes it. Raises
    UsageError, StudyError or PlugInError."""
    run = read_run(folder)
    study = load_study(folder / STUDY, allow_code=allow_code)
    swept = _is_sweep(study, run)
    several = len(study.problem.objectives) > 1 and not swept
    front = tuple(front_entries(study.problem, run.entries)) if several else ()
    return Reported(study, run, run.best or best_entry(study.problem, run.entries), swept, front)


def _is_sweep(study: Study, run: StoredRun) -> bool:
    """As run.json says; of a run that was cut short, whether every row has the design of the study's plan."""
    if run.summary or study.sweep is None or not run.entries:
        return "sweep" in run.summary
    designs = {point.number: point.design for point in sweep_points(study)}
    return all(designs.get(entry.number) == entry.evaluation.design for entry in run.entries)


def best_context(reported: Reported) -> Context | None:
    """The mechanism, mode and region of the best design; None where there is none that can be built."""
    if reported.best is None:
        return None
    try:
        return design_context(reported.problem, reported.best.evaluation.design)
    except ParameterError:
        return None
