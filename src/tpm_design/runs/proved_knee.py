"""The knee of a front, certified once when the search is over: no rounds, since what breaks one design of a
front says nothing of the others."""

from __future__ import annotations

from dataclasses import replace

from tpm_design.certificates.verdict import verdict
from tpm_design.problem import Problem
from tpm_design.runs.optimize import SearchResult
from tpm_design.runs.rounds import Proving, told_of


def with_proved_knee(problem: Problem, proving: Proving, result: SearchResult) -> SearchResult:
    """The result with a verdict on its knee, told in the status. Where nothing is feasible, or the search was
    interrupted, there is none; Ctrl-C leaves it out."""
    best = result.best
    if best is None or best.evaluation.status != "feasible" or result.ending == "interrupted":
        return replace(result, status=f"{result.status} Nothing was certified.")
    try:
        found = verdict(
            problem,
            best.evaluation.design,
            proving.tolerance,
            boxes=proving.boxes,
            workers=proving.workers,
            with_slack=True,
        )
    except KeyboardInterrupt:
        status = f"{result.status} The certification of the knee was interrupted. Resume it to go on."
        return replace(result, ending="interrupted", status=status)
    told = ["Of the front the knee alone was certified.", *told_of(found, proving)]
    return replace(result, status=" ".join([result.status, *told]), verdict=found)
