"""Volumes with proof: bounds that hold with certainty, by interval arithmetic on boxes that cover everything.

The volume of the largest aspect is the greatest of those of all combinations of sides of the determinants, in
every octant that the mode may lie in; each combination is paved by itself, and always the one that may still
be the greatest is refined.
"""

from __future__ import annotations

import itertools
import time
from contextlib import closing
from dataclasses import dataclass

from tpm_design.arithmetic.rounding import check_rounding
from tpm_design.errors import ParameterError
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.worker_threads import WorkerThreads
from tpm_design.workspace.paved_components import largest_part
from tpm_design.workspace.paving import PavedSet, Paving
from tpm_design.workspace.volume import VolumeKind, check_asked

# digits are lost to underflow below it
LEAST_MARGIN = 1e-290
# of the gap that is allowed: what is left to the knowledge of how the parts are joined
NEARLY = 0.98


@dataclass(frozen=True)
class CertifiedVolume:
    """The volume (m³) is proved to be at least ``lower`` and at most ``upper``; ``boxes`` judged for it."""

    lower: float
    upper: float
    seconds: float
    boxes: int


@dataclass(frozen=True)
class Limits:
    """How much work is allowed. ``until``: on the clock ``time.perf_counter``."""

    boxes: int
    until: float

    def left(self, pavings: list[Paving]) -> int:
        """Boxes that may still be judged, 0 when the time is over."""
        spent = sum(paving.boxes for paving in pavings)
        return max(0, self.boxes - spent) if time.perf_counter() < self.until else 0


def certified_volume(
    mechanism: Mechanism,
    mode: Mode,
    kind: VolumeKind = "singularity_free",
    margin: float = 0.02,
    rtol: float = 1e-2,
    *,
    boxes: int = 5_000_000,
    seconds: float | None = None,
    threads: int = 1,
) -> CertifiedVolume:
    """Proved bounds of the volume (m³) of the mode's reachable poses, or of its largest aspect with every
    |determinant| above ``margin``, until they differ by ``rtol`` of the lower one.

    Ends earlier, with bounds that are wider but as certain, at about so many ``boxes`` (some 150 bytes each)
    or ``seconds``. Only the seconds make the bounds depend on the machine; ``threads`` never do. A margin
    below 1e-290 counts as 1e-290: a determinant is not zero.

    Raises ParameterError on an unknown kind, a margin outside [0, 1), an rtol outside [1e-6, 1), or limits
    or threads that are not positive.
    """
    check_asked(kind, margin)
    if not 1e-6 <= rtol < 1.0:
        raise ParameterError(f"rtol = {rtol!r} is not in [1e-6, 1).")
    if seconds is not None and not seconds > 0.0:
        raise ParameterError(f"seconds = {seconds!r} is not positive.", remedy="None: no limit of time.")
    for name, number in (("boxes", boxes), ("threads", threads)):
        if number < 1:
            raise ParameterError(f"{name} = {number!r} is not positive.")
    began = time.perf_counter()
    check_rounding()
    limits = Limits(boxes, float("inf") if seconds is None else began + seconds)
    octants = mechanism.single_octants(mode)
    with closing(WorkerThreads(threads)) as workers:
        if kind == "reachable":
            pavings = [Paving(PavedSet(mechanism, octant)) for octant in octants]
            lower, upper = _sum(pavings, rtol, limits, workers)
        else:
            sides = list(itertools.product((1.0, -1.0), repeat=len(mechanism.kind.determinants)))
            floor = max(margin, LEAST_MARGIN)
            pavings = [
                Paving(PavedSet(mechanism, octant, signs, floor)) for octant in octants for signs in sides
            ]
            lower, upper = _largest(pavings, rtol, limits, workers)
    judged = sum(paving.boxes for paving in pavings)
    return CertifiedVolume(lower, upper, time.perf_counter() - began, judged)


def _sum(pavings: list[Paving], rtol: float, limits: Limits, workers: WorkerThreads) -> tuple[float, float]:
    """Bounds of the sum of the volumes."""
    while True:
        lower, upper = (sum(values) for values in zip(*(p.bounds for p in pavings), strict=True))
        widest = max(pavings, key=lambda paving: paving.gap)
        left = limits.left(pavings)
        if upper - lower <= rtol * lower or left < 2:
            return lower, upper
        goal = max(0.0, widest.gap - (upper - lower - rtol * lower))
        if not widest.refine(goal, left, workers):
            return lower, upper


@dataclass
class _Candidate:
    """A paving and what is known of its largest part; ``gap``: the paving's when that was found out."""

    paving: Paving
    lower: float
    upper: float
    gap: float

    def look(self) -> None:
        self.lower, self.upper = largest_part(self.paving)
        self.gap = self.paving.gap


def _largest(
    pavings: list[Paving], rtol: float, limits: Limits, workers: WorkerThreads
) -> tuple[float, float]:
    """Bounds of the volume of the largest connected part of any of the sets."""
    candidates = [_Candidate(paving, 0.0, paving.bounds[1], float("inf")) for paving in pavings]
    while True:
        best = max(candidates, key=lambda candidate: candidate.upper)
        lower = max(candidate.lower for candidate in candidates)
        if best.upper - lower <= rtol * lower:
            return lower, best.upper
        left = limits.left(pavings)
        # parts are worth a look when the whole is known well enough, then whenever better by a third
        volume, _ = best.paving.bounds
        goal = min(NEARLY * rtol * volume, best.gap * 2.0 / 3.0)
        if left < 2 or not best.paving.refine(goal, left, workers):
            break
        volume, most = best.paving.bounds
        best.upper = min(best.upper, most)
        if best.paving.gap <= min(NEARLY * rtol * volume, best.gap * 2.0 / 3.0):
            best.look()
    for candidate in candidates:
        if candidate.upper > lower:
            candidate.look()
    lower = max(candidate.lower for candidate in candidates)
    return lower, max(candidate.upper for candidate in candidates)
