"""What can be done with a study: evaluate one design, search for the best."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpm_design.certificates.document import FILE as CERTIFICATE
from tpm_design.certificates.document import document, write_document
from tpm_design.certificates.verdict import Verdict
from tpm_design.digests import text_sha256
from tpm_design.errors import RefusedError, UsageError, did_you_mean
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.result import Evaluation
from tpm_design.problem import Design
from tpm_design.runs.entry import Entry, answer_key
from tpm_design.runs.executors import Executor
from tpm_design.runs.folder import STUDY, RunWriter, create_run_folder, provenance, read_run
from tpm_design.runs.lock import sole_writer
from tpm_design.runs.marks import front_marks
from tpm_design.runs.optimality import gap_of, with_bound
from tpm_design.runs.optimize import SearchPlan, SearchResult, check_plan, search
from tpm_design.runs.proved_knee import with_proved_knee
from tpm_design.runs.replay import answers_in
from tpm_design.runs.rounds import Proving, search_certified
from tpm_design.runs.tables import EvaluationTable, csv_line
from tpm_design.study.design import completed_design, tied_error
from tpm_design.study.document import where
from tpm_design.study.plain import dump_yaml
from tpm_design.study.resuming import check_resumable

if TYPE_CHECKING:
    import pandas as pd

    from tpm_design.study.study import Study


@dataclass(frozen=True)
class Run:
    """A finished search. ``best``: the best feasible evaluation, of several objectives the knee of the front,
    else the one of least violation. ``front``: of several objectives, best first by the first one.
    ``evaluations``: the table of evaluations.csv, in the study's units. ``folder``: None if not written.
    ``verdict``: on the best design, None where the study asks for none or nothing feasible was found."""

    best: Evaluation | None
    evaluations: pd.DataFrame
    status: str
    result: SearchResult
    folder: Path | None
    verdict: Verdict | None = None
    front: tuple[Evaluation, ...] = ()


def evaluate_design(study: Study, values: Mapping[str, float | str]) -> Evaluation:
    """Every metric of one design. ``values``: SI, by name; the rest as ``choose_design`` assumes it.

    Raises UsageError on a name the study does not have.
    """
    known = completed_design(study.problem, {})
    for name in values:
        if name not in known:
            raise UsageError(f"This study has no quantity {name!r}.", remedy=did_you_mean(name, known))
        if name in study.problem.ties:
            raise tied_error(study.problem.ties, name)
    return evaluate(study.problem, completed_design(study.problem, values))


def plan_of(study: Study) -> SearchPlan:
    """The search the study asks for."""
    settings = study.optimizer
    return SearchPlan(settings.method, settings.budget, settings.seed, settings.polish)


def check_search(study: Study) -> None:
    """Refuse a method that cannot search the study, where the file names it. Raises RefusedError."""
    try:
        check_plan(study.problem, plan_of(study))
    except RefusedError as refused:
        place = study.optimizer_place if study.problem.variables else where(study.path)
        raise RefusedError(refused.what, where=place, remedy=refused.remedy) from None


def optimize_study(
    study: Study,
    *,
    executor: Executor,
    proof_workers: int,
    output: Path | None,
    watch: Callable[[Entry], None] = lambda entry: None,
    resume: Path | None = None,
) -> Run:
    """Search the study's design space; with ``output`` the run is written below it as it happens.

    ``watch`` sees each evaluation. ``resume``: a run folder to go on in instead of a new one.
    ``executor``: who evaluates; ``proof_workers`` threads of this process prove. Raises
    RefusedError or UsageError before anything runs, RunStoppedError where the run cannot be written.
    """
    plan = plan_of(study)
    check_search(study)
    if resume is not None:
        check_resumable(study, resume)
    folder = resume
    if folder is None and output is not None:
        folder = create_run_folder(output, study.name, study.study_hash)
    if folder is None:
        result = _searched(study, plan, executor, proof_workers, watch, ())
    else:
        with sole_writer(folder):
            stored = None
            if resume is not None:
                # only now can nobody else write to it
                check_resumable(study, folder)
                stored = read_run(folder).entries
            result = _written(study, plan, executor, proof_workers, watch, folder, stored)
    best = None if result.best is None else result.best.evaluation
    table = evaluations_frame(study, result.entries)
    front = tuple(entry.evaluation for entry in result.front)
    return Run(best, table, result.status, result, folder, result.verdict, front)


def _searched(
    study: Study,
    plan: SearchPlan,
    executor: Executor,
    proof_workers: int,
    record: Callable[[Entry], None],
    stored: Sequence[Entry],
) -> SearchResult:
    problem = study.problem
    if study.certification is None:
        result = search(problem, plan, executor=executor, record=record, stored=stored)
        return with_bound(problem, plan, result)
    proving = Proving(study.certification.tolerance, study.certification.boxes, proof_workers)
    if len(problem.objectives) > 1:
        result = search(problem, plan, executor=executor, record=record, stored=stored)
        result = with_proved_knee(problem, proving, result)
    else:
        result = search_certified(problem, plan, proving, executor=executor, record=record, stored=stored)
    return with_bound(study.problem, plan, result)


def _written(
    study: Study,
    plan: SearchPlan,
    executor: Executor,
    proof_workers: int,
    watch: Callable[[Entry], None],
    folder: Path,
    stored: tuple[Entry, ...] | None,
) -> SearchResult:
    """A search that is written to its folder as it happens. ``stored``: what a resumed run holds already."""
    began = time.perf_counter()
    study_text = dump_yaml(study.resolved())
    if study.plug_in is not None:
        study.plug_in.write_beside(folder / STUDY)
    with closing(RunWriter(folder, study.problem, study.units, study_text, stored or ())) as writer:
        known = frozenset(answers_in(stored or ()))

        def record(entry: Entry) -> None:
            if answer_key(entry) not in known:
                writer.record(entry)
            watch(entry)

        result = _searched(study, plan, executor, proof_workers, record, stored or ())
        if result.verdict is not None:
            data = document(study.problem, study.resolved(), study.study_hash, result.verdict)
            write_document(folder / CERTIFICATE, data)
        summary = {
            "status": result.status,
            "ending": result.ending,
            "best_id": None if result.best is None else result.best.number,
            "optima_ids": [entry.number for entry in result.optima],
            "feasible": result.best is not None and result.best.evaluation.status == "feasible",
            "evaluations": len(result.entries),
            "method": plan.method,
            "polish": plan.polish,
            "seed": plan.seed,
            "budget": plan.budget,
            "workers": executor.workers,
            "remarks": list(result.remarks),
            **_front_data(study, result),
            **_bound_data(result),
            **({} if study.certification is None else _rounds_data(result)),
            "study_hash": study.study_hash,
            "study_file_hash": text_sha256(study_text),
            **provenance(),
            **({} if stored is None else {"resumed_after": len(stored)}),
            "seconds": round(time.perf_counter() - began, 3),
        }
        writer.finish(result.entries, result.front or result.optima, summary)
    return result


def _front_data(study: Study, result: SearchResult) -> dict[str, Any]:
    """For run.json: ids of the front's designs, and what each is marked with, if anything."""
    if len(study.problem.objectives) == 1:
        return {}
    marks = front_marks(study.problem, result.front)
    return {"front": {str(e.number): mark for e, mark in zip(result.front, marks, strict=True)}}


def _bound_data(result: SearchResult) -> dict[str, Any]:
    """For run.json: the lower bound on the objective (SI; null: nothing reaches the region), and by which
    share the best design is above it."""
    if result.bound is None:
        return {}
    least = result.bound.least if result.bound.reachable else None
    return {"bound": {"objective": result.bound.goal, "least": least, "gap": gap_of(result)}}


def _rounds_data(result: SearchResult) -> dict[str, Any]:
    """For run.json: each round with its samples (SI), and what was certified."""
    rounds = [
        {
            "round": one.number,
            "evaluations": one.evaluations,
            "best_id": one.best,
            "outcome": one.outcome,
            "samples": [asdict(sample) for sample in one.samples],
        }
        for one in result.rounds
    ]
    found = result.verdict
    certificate = {
        "outcome": None if found is None else found.outcome,
        "requirements": {}
        if found is None
        else {
            r.goal.label: {"outcome": r.outcome, "slack": r.slack, "reason": r.reason}
            for r in found.requirements
        },
    }
    return {"rounds": rounds, "certificate": certificate}


def evaluations_frame(study: Study, entries: tuple[Entry, ...]) -> pd.DataFrame:
    """The rows of evaluations.csv as a table, in the study's units."""
    import pandas as pd

    table = EvaluationTable(study.problem, study.units)
    text = csv_line(table.headings()) + "".join(csv_line(table.row(entry)) for entry in entries)
    return pd.read_csv(io.StringIO(text), keep_default_na=True)


def pose_values(study: Study, design: Design, pose: tuple[float, float, float]) -> dict[str, Any]:
    """Joint values, Jacobian and margins at one pose as users write it, SI; None where there is none."""
    import numpy as np

    from tpm_design.evaluation.contexts import design_context

    context = design_context(study.problem, design)
    mechanism, mode = context.mechanism, context.mode

    def numbers(array: Any) -> Any:
        values = np.asarray(array).astype(object)
        values[~np.isfinite(array)] = None
        return values.tolist()

    return {
        "actuators": {d: numbers(mechanism.ik([pose], mode, drive=d)[0]) for d in mechanism.kind.drives},
        "jacobian": {d: numbers(mechanism.jacobian([pose], mode, drive=d)[0]) for d in mechanism.kind.drives},
        "margins": {name: numbers(value)[0] for name, value in mechanism.margins([pose], mode).items()},
    }
