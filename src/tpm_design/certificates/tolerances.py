"""The largest factor on a study's tolerances that can still be proved: what to print on the drawing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tpm_design.certificates.verdict import verdict
from tpm_design.problem import Design, Problem

LARGEST, SMALLEST = 1024.0, 1.0 / 1024.0
PRECISION = 0.01


@dataclass(frozen=True)
class LargestTolerance:
    """``factor``: the largest one proved, 0 where not even the exact machine is; ``failed``: the least factor
    at which the proof failed, None where it never did. ``outcome`` there: "refuted" or "undecided"."""

    factor: float
    failed: float | None
    outcome: str


def largest_tolerance(
    problem: Problem,
    design: Design,
    tolerance: Mapping[str, float],
    *,
    boxes: int,
    workers: int = 1,
    watch: Callable[[float, str], None] = lambda factor, outcome: None,
) -> LargestTolerance:
    """Doubling and halving, then bisection of the factor to one per cent. ``watch`` sees each attempt."""

    def attempt(factor: float) -> str:
        scaled = {name: factor * bound for name, bound in tolerance.items()}
        found = verdict(problem, design, scaled, boxes=boxes, workers=workers, with_slack=False).outcome
        watch(factor, found)
        return found

    factor, outcome = 1.0, attempt(1.0)
    proved, failed, failure = 0.0, factor, outcome
    if outcome == "proved":
        while outcome == "proved" and factor < LARGEST:
            proved, factor = factor, 2.0 * factor
            outcome = attempt(factor)
        if outcome == "proved":
            return LargestTolerance(factor, None, outcome)
        failed, failure = factor, outcome
    else:
        while outcome != "proved" and factor > SMALLEST:
            failed, failure, factor = factor, outcome, 0.5 * factor
            outcome = attempt(factor)
        if outcome != "proved":
            outcome = attempt(0.0)
            return LargestTolerance(0.0, factor if outcome == "proved" else 0.0, failure)
        proved = factor
    while failed - proved > PRECISION * proved:
        middle = 0.5 * (proved + failed)
        outcome = attempt(middle)
        if outcome == "proved":
            proved = middle
        else:
            failed, failure = middle, outcome
    return LargestTolerance(proved, failed, failure)
