"""Proof that a statement holds on a box: every pose of it, every machine within the tolerance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flint import arb

from tpm_design.checker.balls import ZERO, Enclosure, Symmetric, full
from tpm_design.checker.definite import congruent, positive_definite_throughout
from tpm_design.checker.mechanisms.configuration import AXES, LIMBS, Configuration, Machines, Span
from tpm_design.checker.regions import Box, Domain
from tpm_design.checker.spectrum import unit_frame
from tpm_design.checker.statements import Goal, Locus, Reach, Statement, outside_goals

ONE = arb(1)
BISECTIONS = 15
"""How often a leaf whose bounds are too loose may be halved, one half of one half after the other."""


Spans = Mapping[str, Span]


def natural(machines: Machines, spans: Spans) -> Configuration:
    variables = {name: Enclosure(span.whole, {}) for name, span in spans.items()}
    return machines.at(variables)


def graded(machines: Machines, spans: Spans) -> tuple[Configuration, Configuration]:
    """With derivatives in everything that varies, and the configuration in the middle."""
    centre = {name: Enclosure(span.centre, {}) for name, span in spans.items()}
    middle = machines.at(centre)
    variables = {
        name: Enclosure(span.whole, {name: ONE} if span.radius > 0 else {}) for name, span in spans.items()
    }
    return machines.at(variables, middle), middle


def positive(goal: Goal, slopes: Configuration, machines: Machines, spans: Spans) -> bool:
    """Whether a goal is > 0 on the whole box, by its derivatives there.

    A variable in which the goal rises or falls takes the end where it is least; the others take their middle
    and the mean value theorem the rest.
    """
    over = goal(slopes)
    if over.value > 0:
        return True
    point = {name: span.centre for name, span in spans.items()}
    loss = arb(0)
    for name, slope in over.slope.items():
        span = spans[name]
        if slope >= 0:
            point[name] = span.low
        elif slope <= 0:
            point[name] = span.high
        else:
            loss += slope.abs_upper() * span.radius
    variables = {name: Enclosure(value, {}) for name, value in point.items()}
    return bool(goal(machines.at(variables)).value - loss > 0)


def definite(over: Symmetric, centre: Symmetric, spans: Spans) -> bool:
    """Whether all eigenvalues of a matrix are > 0 on the whole box, by its derivatives there (``over``) and
    its entries in the middle (``centre``).

    P M Pᵀ is near the unit matrix for the P that makes it so in the middle, which is chosen in plain numbers;
    by the mean value theorem it is a linear function of the variables whose slopes are somewhere in theirs.
    """
    frame = unit_frame([[float(entry.value) for entry in row] for row in full(centre)])
    if frame is None:
        return False
    factors = [[arb(part) for part in row] for row in frame]
    moved: dict[str, list[arb]] = {}
    for place, entry in enumerate((*over.diagonal, *over.beside)):
        for name, part in entry.slope.items():
            moved.setdefault(name, [ZERO] * 6)[place] = part
    at = congruent(factors, [entry.value for entry in (*centre.diagonal, *centre.beside)])
    swings = [
        [part * spans[name].radius for part in congruent(factors, parts)] for name, parts in moved.items()
    ]
    return positive_definite_throughout(at, swings)


def all_positive(statement: Statement, machines: Machines, spans: Spans) -> bool:
    """Whether a statement holds on a box, by its bounds there."""
    slopes, middle = graded(machines, spans)
    # goals of one configuration belong together: they may share a scale
    goals = statement.goals(slopes)
    if not all(positive(goal, slopes, machines, spans) for goal in goals.quantities):
        return False
    if goals.matrices is None:
        return True
    over, centre = goals.matrices(slopes), goals.matrices(middle)
    return all(definite(one, other, spans) for one, other in zip(over, centre, strict=True))


def out_of_reach(machines: Machines, box: Box, spans: Spans) -> bool:
    """Whether one margin of reach or of the mode is < 0 on the whole box for every machine."""
    for (low, high), side in zip(box, machines.setting.sides, strict=True):
        if (side > 0 and high < 0.0) or (side < 0 and low > 0.0):
            return True
    slopes, middle = graded(machines, spans)
    # only a margin that is < 0 in the middle can be so everywhere
    goals = [goal for goal in outside_goals(slopes) if not goal(middle).value <= 0]
    return any(positive(goal, slopes, machines, spans) for goal in goals)


def on_its_sides(machines: Machines, box: Box) -> bool:
    """Whether a box is on the mode's side of each coordinate plane."""
    return all(
        side == 0 or (low >= 0.0 if side > 0 else high <= 0.0)
        for (low, high), side in zip(box, machines.setting.sides, strict=True)
    )


def spans_of(machines: Machines, box: Box) -> dict[str, Span]:
    spans = dict(machines.sizes)
    for axis, (low, high) in zip(AXES, box, strict=True):
        spans[axis] = Span(arb(low), arb(high))
    return spans


def settled(statement: Statement, machines: Machines, domain: Domain, box: Box) -> bool:
    """Whether a box needs no further look: the statement holds on it, or it says nothing about it."""
    spans = spans_of(machines, box)
    if isinstance(statement, Reach) and not on_its_sides(machines, box):
        return domain.outside(box)
    if all_positive(statement, machines, spans) or domain.outside(box):
        return True
    return isinstance(statement, Locus) and out_of_reach(machines, box, spans)


def halves(box: Box, axis: int) -> tuple[Box, Box]:
    """A box split at 0.5 (lo + hi) across an axis, the lower half first."""
    low, high = box[axis]
    middle = 0.5 * (low + high)
    lower, upper = list(box), list(box)
    lower[axis], upper[axis] = (low, middle), (middle, high)
    return (lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2])


def proved(statement: Statement, machines: Machines, domain: Domain, box: Box) -> bool:
    """Whether a statement holds on a box, by halving it where the bounds are too loose."""
    waiting: list[tuple[Box, int]] = [(box, 0)]
    while waiting:
        part, depth = waiting.pop()
        if settled(statement, machines, domain, part):
            continue
        widths = [high - low for low, high in part]
        if depth == BISECTIONS or not max(widths) > 0.0:
            return False
        waiting += [(half, depth + 1) for half in halves(part, widths.index(max(widths)))]
    return True


def never_reached(machines: Machines, box: Box) -> bool:
    """Whether no pose of a box is in reach, by halving it where the bounds are too loose."""
    waiting: list[tuple[Box, int]] = [(box, 0)]
    while waiting:
        part, depth = waiting.pop()
        if out_of_reach(machines, part, spans_of(machines, part)):
            continue
        widths = [high - low for low, high in part]
        if depth == BISECTIONS or not max(widths) > 0.0:
            return False
        waiting += [(half, depth + 1) for half in halves(part, widths.index(max(widths)))]
    return True


def sum_of_links(machines: Machines, links: Sequence[str], largest: bool) -> arb:
    """Greatest or least total link length of the machines, ``links`` by the names of their lengths."""
    total = arb(0)
    for size in links:
        for limb in LIMBS:
            span = machines.sizes[f"{size}{limb + 1}"]
            total += span.high if largest else span.low
    return total
