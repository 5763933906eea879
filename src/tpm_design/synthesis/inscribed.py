"""The largest box, sphere, cylinder or ellipsoid in the singularity-free part of one design's workspace."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tpm_design.errors import ParameterError, RefusedError
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.metrics.context import Context
from tpm_design.synthesis.body_forms import BodyForm, Triple, body_form
from tpm_design.synthesis.fitting import Fitted, fitted
from tpm_design.synthesis.free_set import FreeSet, seeds
from tpm_design.synthesis.growth import Grown, grown
from tpm_design.workspace.regions import Shape

FloatArray = NDArray[np.float64]

REGION_SAMPLES = 25
MOST_FITTED = 4
# a determinant that touches 0 without a change of sign is singular there
LEAST_MARGIN = 1e-9
# grown bodies of a smaller share of the largest one's volume are not fitted, nor those as near to another
WORTH_FITTING, SAME = 0.6, 0.05
ALIKE = 1e-7
# digits after which lengths are cut off, counted from the first of the mechanism's reach
DIGITS = 9
# shares of the sizes by which a body is shrunk until every margin holds, or grown until one is broken
STEPS = tuple(math.pow(10.0, 0.5 * power) for power in range(-20, 0))
# a larger step is halved so often, towards the one before
COARSEST, HALVINGS = 1e-6, 5


@dataclass(frozen=True)
class Margin:
    """The least value of one margin over a body, of ``unit``, with its numeric error, and what is asked."""

    value: float
    error: float
    asked: float
    unit: str


@dataclass(frozen=True, eq=False)
class InscribedBody:
    """A body in the free set, metres. ``centre``; ``sizes`` (k,) as its ``form`` has them.

    ``margins``: over the body, by name, those of the check that it passed. ``growths`` (k,): the share by
    which each size alone can grow before a pose breaks a margin, 1 where none was found.
    ``gap``: by which share of the volume the largest body between the planes that touch the free set at this
    one's contacts is larger: 0 at a local optimum; None where those planes bound no body.
    """

    form: BodyForm
    free: FreeSet
    centre: Triple
    sizes: FloatArray
    margins: Mapping[str, Margin]
    growths: tuple[float, ...]
    gap: float | None

    @property
    def shape(self) -> Shape:
        """The region without its place."""
        return self.form.shape(self.sizes)

    @property
    def volume(self) -> float:
        """m³."""
        return self.form.volume(self.sizes)


def largest_body(
    mechanism: Mechanism,
    mode: Mode,
    body: str,
    *,
    margin: float = 0.0,
    proportions: Sequence[float] | None = None,
    near: Triple | None = None,
) -> InscribedBody | None:
    """The largest body, "box", "sphere", "cylinder" (its axis along z) or "ellipsoid" (its axes along x, y
    and z), within reach of the mode, with every determinant on one side and at least ``margin`` from 0; None
    where there is none.

    It is the best of the local optima that are found from the deepest poses of all aspects, and from
    ``near`` (m). ``proportions``: of the sizes along x, y, z. The body is checked by the least margins over
    it, found as metrics find them: not proved. Raises UsageError and ParameterError on bad arguments,
    RefusedError where poses are not positions.
    """
    form = body_form(body, proportions)
    if not 0.0 <= margin < 1.0:
        raise ParameterError(f"margin = {margin!r} is not in [0, 1).", remedy="Margins are dimensionless.")
    if not mechanism.kind.translational:
        raise RefusedError(
            f"The poses of {mechanism.kind.name} are not positions: no body lies among them.",
            remedy="Its largest range of tilts is the metric all_round_tilt.",
        )
    wanted = None if near is None else np.asarray(near, dtype=np.float64)
    found = [grown(form, seed) for seed in seeds(mechanism, mode, max(margin, LEAST_MARGIN), wanted)]
    best: InscribedBody | None = None
    for start in _worth_fitting(form, [one for one in found if one is not None]):
        fit = fitted(form, start)
        inside = None if fit is None else _within(form, fit)
        if inside is not None and (best is None or _is_better(inside, best)):
            best = inside
    return best


def _is_better(one: InscribedBody, other: InscribedBody) -> bool:
    """Larger; of equally large ones, as symmetric mechanisms have them, the one that is known better."""
    if not math.isclose(one.volume, other.volume, rel_tol=ALIKE):
        return one.volume > other.volume
    return other.gap is None and one.gap is not None


def _worth_fitting(form: BodyForm, bodies: Sequence[Grown]) -> list[Grown]:
    """The largest ones, no two alike."""
    ordered = sorted(bodies, key=lambda one: -form.volume(one.sizes))
    chosen: list[Grown] = []
    for one in ordered:
        if form.volume(one.sizes) < WORTH_FITTING * form.volume(ordered[0].sizes):
            break
        size = float(form.half(one.sizes).max())
        alike = [
            np.abs(np.append(one.centre - other.centre, one.sizes - other.sizes)).max() < SAME * size
            for other in chosen
        ]
        if not any(alike):
            chosen.append(one)
    return chosen[:MOST_FITTED]


def _within(form: BodyForm, fit: Fitted) -> InscribedBody | None:
    """The body shrunk by about the least share with which it passes the check, its lengths cut to round
    numbers."""
    body = fit.body
    low = high = 0.0
    passed = _passed(form, body, high)
    for step in STEPS:
        if passed is not None:
            break
        low, high = high, step
        passed = _passed(form, body, high)
    if passed is None:
        return None
    for _ in range(HALVINGS if high > COARSEST else 0):
        middle = 0.5 * (low + high)
        smaller = _passed(form, body, middle)
        low, high, passed = (middle, high, passed) if smaller is None else (low, middle, smaller)
    (centre, sizes), margins = passed
    less = 1.0 - form.volume(sizes) / form.volume(body.sizes)
    gap = None if fit.gap is None else fit.gap + less
    growths = _growths(form, Grown(body.free, centre, sizes))
    x, y, z = centre.tolist()
    return InscribedBody(form, body.free, (x, y, z), sizes, margins, growths, gap)


def _passed(
    form: BodyForm, body: Grown, share: float
) -> tuple[tuple[FloatArray, FloatArray], dict[str, Margin]] | None:
    """The body with its sizes less by a share, and its margins, if all of them hold."""
    placed = _cut(body, (1.0 - share) * body.sizes)
    found = margins_over(form, body.free, *placed)
    if found is None or any(one.value - one.error < one.asked for one in found.values()):
        return None
    return placed, found


def shrunk(body: InscribedBody, share: float) -> InscribedBody:
    """The body with its sizes less by a share, about the same centre."""
    whole = Grown(body.free, np.asarray(body.centre), body.sizes)
    centre, sizes = _cut(whole, (1.0 - share) * body.sizes)
    found = margins_over(body.form, body.free, centre, sizes)
    growths = tuple(min(1.0, growth + share / (1.0 - share)) for growth in body.growths)
    return replace(body, sizes=sizes, margins=found or body.margins, growths=growths)


def _cut(body: Grown, sizes: FloatArray) -> tuple[FloatArray, FloatArray]:
    digits = DIGITS - math.floor(math.log10(body.free.length))
    grain = 10.0**-digits
    # without the sign of 0
    centre = np.array([round(value, digits) + 0.0 for value in body.centre.tolist()])
    return centre, np.array([round(math.floor(size / grain) * grain, digits) for size in sizes.tolist()])


def margins_over(
    form: BodyForm, free: FreeSet, centre: FloatArray, sizes: FloatArray
) -> dict[str, Margin] | None:
    """Least margins over a body; None where a determinant is mostly on the other side."""
    if not np.all(sizes > 0.0):
        return None
    region = form.region(centre, sizes)
    context = Context(free.mechanism, free.mode, region, 1e-3, REGION_SAMPLES)
    if context.lattice_sides != free.sides:
        return None
    found = {"reach": Margin(context.reach.value, context.reach.error, 0.0, "m")}
    for name, side in zip(free.mechanism.kind.determinants, context.sides, strict=True):
        found[name] = Margin(side.margin, side.error, free.floor, "-")
    return found


def _growths(form: BodyForm, body: Grown) -> tuple[float, ...]:
    return tuple(_growth(form, body, number) for number in range(body.sizes.size))


def _growth(form: BodyForm, body: Grown, number: int) -> float:
    """The first step by which one size can grow only by breaking a margin."""
    for step in STEPS:
        sizes = body.sizes.copy()
        sizes[number] *= 1.0 + step
        found = margins_over(form, body.free, body.centre, sizes)
        if found is None or any(one.value < one.asked for one in found.values()):
            return step
    return 1.0
