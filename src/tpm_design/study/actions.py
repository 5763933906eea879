"""What can be done with a study: evaluate one design, search for the best."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpm_design.errors import UsageError, did_you_mean
from tpm_design.problem import Design, Evaluation, evaluate
from tpm_design.runs.folder import RunWriter, create_run_folder, provenance, text_hash
from tpm_design.runs.optimize import SearchPlan, SearchResult, check_plan, search
from tpm_design.runs.search import Entry
from tpm_design.runs.tables import EvaluationTable, csv_line
from tpm_design.study.design import choose_design
from tpm_design.study.plain import dump_yaml

if TYPE_CHECKING:
    import pandas as pd

    from tpm_design.study.study import Study

NOT_CERTIFIED = "The study's tolerances are kept in study.yaml; this version proves nothing about them."


@dataclass(frozen=True)
class Run:
    """A finished search. ``best``: the best feasible evaluation, else the one of least violation.
    ``evaluations``: the table of evaluations.csv, in the study's units. ``folder``: None if not written."""

    best: Evaluation | None
    evaluations: pd.DataFrame
    status: str
    result: SearchResult
    folder: Path | None


def evaluate_design(study: Study, values: Mapping[str, float | str]) -> Evaluation:
    """Every metric of one design. ``values``: SI, by name; the rest as ``choose_design`` assumes it.

    Raises UsageError on a name the study does not have.
    """
    design, _ = choose_design(study, {})
    for name in values:
        if name not in design:
            raise UsageError(f"This study has no quantity {name!r}.", remedy=did_you_mean(name, design))
    return evaluate(study.problem, {**design, **values})


def plan_of(study: Study) -> SearchPlan:
    """The search the study asks for."""
    settings = study.optimizer
    return SearchPlan(settings.method, settings.budget, settings.seed, settings.polish)


def optimize_study(
    study: Study,
    *,
    workers: int,
    output: Path | None,
    watch: Callable[[Entry], None] = lambda entry: None,
) -> Run:
    """Search the study's design space; with ``output`` the run is written below it as it happens.

    ``watch`` sees each evaluation. Raises RefusedError or UsageError before anything runs.
    """
    plan = plan_of(study)
    check_plan(study.problem, plan)
    folder = writer = None
    study_text = dump_yaml(study.resolved())
    if output is not None:
        folder = create_run_folder(output, study.name, study.study_hash)
        writer = RunWriter(folder, study.problem, study.units, study_text)

    def record(entry: Entry) -> None:
        if writer is not None:
            writer.record(entry)
        watch(entry)

    began = time.perf_counter()
    result = search(study.problem, plan, workers=workers, record=record)
    if study.certification is not None:
        result = replace(result, remarks=(*result.remarks, NOT_CERTIFIED))
    if writer is not None:
        summary = {
            "status": result.status,
            "ending": result.ending,
            "best_id": None if result.best is None else result.best.number,
            "feasible": result.best is not None and result.best.evaluation.status == "feasible",
            "evaluations": len(result.entries),
            "method": plan.method,
            "polish": plan.polish,
            "seed": plan.seed,
            "budget": plan.budget,
            "workers": workers,
            "remarks": list(result.remarks),
            "study_hash": study.study_hash,
            "study_file_hash": text_hash(study_text),
            **provenance(),
            "seconds": round(time.perf_counter() - began, 3),
        }
        writer.finish(result.entries, [result.best] if result.best else [], summary)
    best = None if result.best is None else result.best.evaluation
    return Run(best, evaluations_frame(study, result.entries), result.status, result, folder)


def evaluations_frame(study: Study, entries: tuple[Entry, ...]) -> pd.DataFrame:
    """The rows of evaluations.csv as a table, in the study's units."""
    import pandas as pd

    table = EvaluationTable(study.problem, study.units)
    text = csv_line(table.headings()) + "".join(csv_line(table.row(entry)) for entry in entries)
    return pd.read_csv(io.StringIO(text), keep_default_na=True)


def pose_values(study: Study, design: Design, pose: tuple[float, float, float]) -> dict[str, Any]:
    """Joint values, Jacobian and margins at one pose (m), SI; None where a value does not exist."""
    import numpy as np

    from tpm_design.problem import design_context

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
