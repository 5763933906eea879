"""A study, ready to run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpm_design.digests import canonical_sha256
from tpm_design.errors import UsageError
from tpm_design.evaluation.result import Evaluation
from tpm_design.problem import Problem
from tpm_design.study.plug_in import PlugIn
from tpm_design.study.sweep import Sweep
from tpm_design.units import Units

if TYPE_CHECKING:
    from tpm_design.study.actions import Run


@dataclass(frozen=True)
class OptimizerSettings:
    """Which method searches, for how long, and which local method improves what it found."""

    method: str
    budget: int
    seed: int
    polish: str | None


@dataclass(frozen=True)
class Certification:
    """What a study wants proved of its best design. ``tolerance``: manufacturing tolerances by parameter
    name, ±, SI, of each limb by itself; ``boxes``: at most so many for each statement."""

    tolerance: Mapping[str, float]
    boxes: int


@dataclass(frozen=True)
class Study:
    """A validated study. ``problem`` is in SI units; ``resolved()`` in the study's own.

    ``certification``: None where the study asks for no proof. ``plug_in``: the mechanism's own file, None
    where the mechanism is one that is registered. ``optimizer_place``: file and line that name the method.
    Studies that ask the same are equal, wherever their files lie.
    """

    path: Path = field(compare=False)
    optimizer_place: str = field(compare=False)
    name: str
    units: Units
    problem: Problem
    optimizer: OptimizerSettings
    certification: Certification | None
    sweep: Sweep | None
    plug_in: PlugIn | None
    resolved_json: str = field(repr=False)

    def resolved(self) -> dict[str, Any]:
        """Everything explicit, in the study's units, as plain data that is itself a study."""
        data: dict[str, Any] = json.loads(self.resolved_json)
        return data

    @property
    def study_hash(self) -> str:
        """SHA-256 of the resolved study: equal for studies that ask the same, however they are written."""
        return canonical_sha256(self.resolved())

    def evaluate(self, values: Mapping[str, float | str]) -> Evaluation:
        """Every metric of one design. ``values``: SI, by name; a free quantity that is not given takes its
        initial value, else the middle of its range, else the first value listed. Raises UsageError."""
        from tpm_design.study.actions import evaluate_design

        return evaluate_design(self, values)

    def optimize(
        self,
        *,
        seed: int | None = None,
        budget: int | None = None,
        workers: int = 1,
        output: str | Path | None = None,
        resume: str | Path | None = None,
    ) -> Run:
        """Search the design space; a run folder is written below ``output`` if that is given.

        ``resume``: a run folder of this study that was cut short, or is to get a larger budget, or "latest",
        the newest one below ``output``. It is written on and ends as if it had never been cut short.
        Raises RefusedError where the method cannot search this problem, UsageError on bad arguments and runs
        of another study or version, RunStoppedError where the run folder cannot be written.
        """
        from tpm_design.runs.executors import Threads
        from tpm_design.study.actions import optimize_study
        from tpm_design.study.resuming import run_to_resume

        if workers < 1:
            raise UsageError(f"{workers} workers cannot work", remedy="Choose a whole number from 1.")
        study = self.searched_with(seed=seed, budget=budget)
        below = None if output is None else Path(output)
        folder = None if resume is None else run_to_resume(study, resume, below)
        with closing(Threads(workers)) as threads:
            return optimize_study(study, executor=threads, proof_workers=workers, output=below, resume=folder)

    def searched_with(self, *, seed: int | None = None, budget: int | None = None) -> Study:
        """The same study with another seed or budget. Raises UsageError for values a study cannot have."""
        if seed is not None and not 0 <= seed <= 2**32 - 1:
            raise UsageError(
                f"the seed cannot be {seed}", remedy=f"Choose a whole number from 0 to {2**32 - 1}."
            )
        if budget is not None and not 1 <= budget <= 10**9:
            raise UsageError(
                f"the budget cannot be {budget}", remedy="Choose a whole number from 1 to 1000000000."
            )
        given = {name: value for name, value in (("seed", seed), ("budget", budget)) if value is not None}
        data = self.resolved()
        data["optimizer"] |= given
        optimizer = replace(
            self.optimizer,
            seed=self.optimizer.seed if seed is None else seed,
            budget=self.optimizer.budget if budget is None else budget,
        )
        return replace(self, optimizer=optimizer, resolved_json=json.dumps(data, ensure_ascii=False))
