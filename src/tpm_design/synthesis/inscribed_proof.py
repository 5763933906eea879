"""An inscribed body shrunk until it is proved to lie in the singularity-free region."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tpm_design.certificates.verdict import Verdict, verdict
from tpm_design.problem import Design, Problem
from tpm_design.synthesis.inscribed import InscribedBody, shrunk

# shares of the sizes: first the middle one; where it is proved the smaller ones, else the larger ones
SMALLER, FIRST, LARGER = (3e-3, 1e-3, 3e-4, 1e-4), 0.01, (0.03, 0.1, 0.3)
# a proof with more boxes than this is followed by none with less to spare, which takes several times as many
ENOUGH = 30_000


@dataclass(frozen=True, eq=False)
class ProvedBody:
    """``body``: the one that was found, its sizes less by ``share``. ``verdict`` is on it, whatever it
    says."""

    body: InscribedBody
    share: float
    verdict: Verdict

    @property
    def proved(self) -> bool:
        return self.verdict.outcome == "proved"


def proved_body(
    found: InscribedBody,
    stated: Callable[[InscribedBody], tuple[Problem, Design]],
    *,
    boxes: int,
    workers: int = 1,
) -> ProvedBody:
    """The least shrunk body that is proved, else the most shrunk one with the verdict on it.

    ``stated``: the problem and design whose region is a body and whose one constraint is that all of it lies
    in one aspect. ``boxes``: at most so many for each statement.
    """

    def tried(share: float) -> ProvedBody:
        body = shrunk(found, share)
        problem, design = stated(body)
        outcome = verdict(
            problem,
            design,
            {},
            boxes=boxes,
            workers=workers,
            with_slack=False,
            least_determinant=found.free.floor,
        )
        return ProvedBody(body, share, outcome)

    best = tried(FIRST)
    for share in SMALLER if best.proved else LARGER:
        if best.proved and best.verdict.boxes > ENOUGH:
            break
        following = tried(share)
        if best.proved and not following.proved:
            break
        best = following
        if best.proved and share in LARGER:
            break
    return best
