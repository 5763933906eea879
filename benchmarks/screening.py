"""A sample of a design space screened for its best designs, against measuring everything of each."""

from __future__ import annotations

from pathlib import Path

from scipy.stats import qmc

from row import Row, interleaved, seconds
from tpm_design.problem import Problem
from tpm_design.runs.executors import Threads
from tpm_design.runs.log import EvaluationLog
from tpm_design.runs.optimize import view_of
from tpm_design.runs.unit_search import UnitSearch
from tpm_design.study import load_study

STUDIES = Path(__file__).resolve().parents[1] / "studies"
MEASURED = (
    "01-uru-cube",
    "03-crr-cube",
    "04-orthoglide-velocity",
    "05-delta-picking",
    "06-linear-delta-printer",
)
POINTS, SEED = 512, 1
KEPT = (1, 8, 64)
ROUNDS = 5


def fresh(problem: Problem) -> UnitSearch:
    """A search that has evaluated nothing."""
    return view_of(EvaluationLog(problem, executor=Threads(1)), POINTS)


def rows() -> list[Row]:
    first, *others = MEASURED
    return [*(row_of(first, keep) for keep in KEPT), *(row_of(name, KEPT[1]) for name in others)]


def row_of(name: str, keep: int) -> Row:
    """The best ``keep`` of a study's sample."""
    problem = load_study(STUDIES / f"{name}.yaml").problem
    points = qmc.Sobol(len(problem.variables), scramble=True, rng=SEED).random(POINTS)
    # the first evaluations compile
    fresh(problem).evaluate(points)
    aborted = fresh(problem).screen(points, keep).aborted.sum()
    ours, peer = interleaved(
        [
            lambda: seconds(lambda: fresh(problem).screen(points, keep)),
            lambda: seconds(lambda: fresh(problem).evaluate(points)),
        ],
        ROUNDS,
    )
    return Row(
        f"best {keep} of {POINTS} Sobol points of {name}",
        f"{ours:.2f} s, {aborted} ended early",
        f"{peer:.2f} s",
        f"{peer / ours:.2f} times as fast",
        "-",
        None,
    )
