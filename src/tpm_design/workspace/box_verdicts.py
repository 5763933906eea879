"""How much of a box of poses is proved to be inside, and to be outside.

Constraints are numbered: leg margins, mode margins, then signed determinants less their margin; inside is
where all are ≥ 0. What is proved of a box holds for its parts and is not computed again there: one bit each.
A constraint that is open is a linear form with an error: one half-space holds all of what is inside, another
one, where the form less its error is ≥ 0, only what is inside.
"""

from __future__ import annotations

import math

import numpy as np

from tpm_design.arithmetic import inner, kernel
from tpm_design.arithmetic.affine import bounds
from tpm_design.mechanisms import equations
from tpm_design.workspace.box_fraction import share_below
from tpm_design.workspace.equal_volume_charts import pose_bounds, pose_forms

MOST_CONSTRAINTS = 32
REFUTED = -1
EVERY_CORNER = 255
THINNEST = 2.0**-40
NO_SIGNS = np.ones(MOST_CONSTRAINTS)


@inner
def _range(first, count):  # type: ignore[no-untyped-def]
    return ((1 << count) - 1) << first


@inner
def _settle_bounds(values, first, proved):  # type: ignore[no-untyped-def]
    """``proved`` and what these Intervals prove as well; REFUTED where one is negative."""
    for i in range(len(values)):
        if proved >> (first + i) & 1 == 0:
            if values[i].hi < 0.0:
                return REFUTED
            if values[i].lo >= 0.0:
                proved |= 1 << (first + i)
    return proved


@inner
def _settle_forms(forms, first, signs, margin, proved, open_forms):  # type: ignore[no-untyped-def]
    """The same for sign · form − margin; those still open are written: centre, slopes, error."""
    for i in range(len(forms)):
        k = first + i
        if proved >> k & 1 == 0:
            form = signs[i] * forms[i] - margin
            within = bounds(form)
            if within.hi < 0.0:
                return REFUTED
            if within.lo >= 0.0:
                proved |= 1 << k
            else:
                open_forms[k, 0], open_forms[k, 1], open_forms[k, 2] = (
                    form.centre,
                    form.by_first,
                    form.by_second,
                )
                open_forms[k, 3], open_forms[k, 4] = form.by_third, form.error
    return proved


@inner
def settle(geometry, mode, counts, signs, margin, axis, octant, box, proved, open_forms):  # type: ignore[no-untyped-def]
    """Bits of the constraints proved on the box, or REFUTED."""
    legs, sides, determinants = counts
    every_side = _range(legs, sides)
    if proved & every_side != every_side:
        # as Intervals first: the planes of an octant are bounds of its charts, exactly 0
        x, y, z = pose_bounds(axis, octant, box)
        proved = _settle_bounds(equations.mode_margins(geometry, mode, x, y, z), legs, proved)
        if proved == REFUTED:
            return REFUTED
    u, v, w = pose_forms(axis, octant, box)
    every = _range(0, legs)
    if proved & every != every:
        forms = equations.leg_margins(geometry, mode, u, v, w)
        proved = _settle_forms(forms, 0, NO_SIGNS, 0.0, proved, open_forms)
        if proved == REFUTED:
            return REFUTED
    if proved & every_side != every_side:
        forms = equations.mode_margins(geometry, mode, u, v, w)
        proved = _settle_forms(forms, legs, NO_SIGNS, 0.0, proved, open_forms)
        if proved == REFUTED:
            return REFUTED
    every = _range(legs + sides, determinants)
    if proved & every != every:
        forms = equations.singularity_margins(geometry, mode, u, v, w)
        proved = _settle_forms(forms, legs + sides, signs, margin, proved, open_forms)
    return proved


@kernel
def constraint_counts(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """How many leg margins, mode margins and determinants there are."""
    legs = equations.leg_margins(geometry, mode, x, y, z)
    sides = equations.mode_margins(geometry, mode, x, y, z)
    return len(legs), len(sides), len(equations.singularity_margins(geometry, mode, x, y, z))


@inner
def _finite(form):  # type: ignore[no-untyped-def]
    return math.isfinite(form[0] + form[1] + form[2] + form[3] + form[4])


@inner
def _error(form):  # type: ignore[no-untyped-def]
    """The form's error and what rounding does to sums of its terms."""
    size = abs(form[0]) + abs(form[1]) + abs(form[2]) + abs(form[3]) + form[4]
    return form[4] + 1e-15 * size


@inner
def _cut_off(form, shift):  # type: ignore[no-untyped-def]
    return share_below(form[0] + shift, abs(form[1]), abs(form[2]), abs(form[3]))


@inner
def _share_inside(proved, count, open_forms):  # type: ignore[no-untyped-def]
    """A lower bound: 1 less what each half-space may cut off. One that cuts nearly as the greatest does is
    replaced by a shift of that one: limbs are stretched all at once where their shells coincide."""
    steepest, largest = -1, -1.0
    for k in range(count):
        if proved >> k & 1 == 0:
            if not _finite(open_forms[k]):
                return 0.0
            _, cut = _cut_off(open_forms[k], -_error(open_forms[k]))
            if cut > largest:
                steepest, largest = k, cut
    reference = open_forms[steepest]
    size = abs(reference[1]) + abs(reference[2]) + abs(reference[3])
    shift, remaining = -_error(reference), 1.0
    for k in range(count):
        if proved >> k & 1 == 0 and k != steepest:
            form = open_forms[k]
            _, cut = _cut_off(form, -_error(form))
            scale = (abs(form[1]) + abs(form[2]) + abs(form[3])) / size
            if scale > 0.0 and math.isfinite(scale):
                # form − error ≥ scale · (reference + lower) all over the box
                difference = form[0] - _error(form)
                for j in range(1, 4):
                    difference -= abs(form[j] - scale * reference[j])
                lower = difference / scale - reference[0]
                lower -= 1e-14 * (abs(reference[0]) + size + abs(lower))
                if lower < shift:
                    _, joint = _cut_off(reference, lower)
                    if joint - largest < cut:
                        shift, largest, cut = lower, joint, 0.0
                else:
                    cut = 0.0
            remaining -= cut
    return max(0.0, remaining - largest)


@inner
def _axis_to_halve(proved, count, box, open_forms):  # type: ignore[no-untyped-def]
    """Along which the open constraints change most; their errors count by the box's relative widths."""
    first, second, third, errors = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        form = open_forms[k]
        if proved >> k & 1 == 0 and _finite(form):
            weight = 1.0 / (abs(form[1]) + abs(form[2]) + abs(form[3]) + form[4])
            first += weight * abs(form[1])
            second += weight * abs(form[2])
            third += weight * abs(form[3])
            errors += weight * form[4]
    radial = 2.0 * (box[1] - box[0]) / (3.0 * (box[0] + box[1]))
    across, beyond = box[3] - box[2], box[5] - box[4]
    scale = (errors if errors > 0.0 else 1.0) / (radial + across + beyond)
    first, second, third = first + scale * radial, second + scale * across, third + scale * beyond
    # beyond it, the middle of a coordinate would be rounded
    first = first if box[1] - box[0] > THINNEST * box[1] else -1.0
    second = second if across > THINNEST * box[3] else -1.0
    third = third if beyond > THINNEST * box[5] else -1.0
    if first >= second and first >= third:
        return 0
    return 1 if second >= third else 2


@inner
def _corners_inside(proved, count, open_forms):  # type: ignore[no-untyped-def]
    """One bit per corner (bit j of its number: the far end of coordinate j) that is proved to be inside."""
    corners = 0
    for corner in range(8):
        inside = True
        for k in range(count):
            if proved >> k & 1 == 0:
                form = open_forms[k]
                value = form[0] - _error(form)
                for j in range(3):
                    value += form[1 + j] if corner >> j & 1 else -form[1 + j]
                inside = inside and value > 0.0
        if inside:
            corners |= 1 << corner
    return corners


@inner
def _closed_faces(proved, count, open_forms):  # type: ignore[no-untyped-def]
    """One bit per face (2 · coordinate, + 1 the far one) on all of which one constraint is negative."""
    faces = 0
    for k in range(count):
        form = open_forms[k]
        if proved >> k & 1 == 0 and _finite(form):
            most = form[0] + _error(form) + abs(form[1]) + abs(form[2]) + abs(form[3])
            for j in range(3):
                rest = most - abs(form[1 + j])
                if rest - form[1 + j] < 0.0:
                    faces |= 1 << (2 * j)
                if rest + form[1 + j] < 0.0:
                    faces |= 2 << (2 * j)
    return faces


@kernel
def judge(geometry, mode, counts, signs, margin, charts, boxes, proved, shares, traits, start, stop):  # type: ignore[no-untyped-def]
    """Judge the boxes (N, 6) from ``start`` to ``stop`` in their ``charts`` (N, 4): axis and octant.

    ``counts``: of leg margins, mode margins and determinants (0 where these do not matter), ``signs`` and
    ``margin`` of the latter.
    ``proved`` (N,): bits known before, and now; REFUTED: nothing is inside. ``shares`` (N, 2): bounds of the
    share that is inside. ``traits`` (N, 3): coordinate to halve, corners inside, closed faces.
    """
    open_forms = np.empty((MOST_CONSTRAINTS, 5))
    count = counts[0] + counts[1] + counts[2]
    for n in range(start, stop):
        octant = (float(charts[n, 1]), float(charts[n, 2]), float(charts[n, 3]))
        bits = settle(
            geometry, mode, counts, signs, margin, charts[n, 0], octant, boxes[n], proved[n], open_forms
        )
        proved[n] = bits
        traits[n, 0], traits[n, 1], traits[n, 2] = 0, 0, 0
        if bits == REFUTED:
            shares[n, 0], shares[n, 1] = 0.0, 0.0
        elif bits == _range(0, count):
            shares[n, 0], shares[n, 1] = 1.0, 1.0
            traits[n, 1] = EVERY_CORNER
        else:
            shares[n, 0] = _share_inside(bits, count, open_forms)
            most = 1.0
            for k in range(count):
                if bits >> k & 1 == 0 and _finite(open_forms[k]):
                    cut, _ = _cut_off(open_forms[k], _error(open_forms[k]))
                    most = min(most, 1.0 - cut)
            shares[n, 1] = most
            traits[n, 0] = _axis_to_halve(bits, count, boxes[n], open_forms)
            traits[n, 1] = _corners_inside(bits, count, open_forms)
            traits[n, 2] = _closed_faces(bits, count, open_forms)
