"""The largest connected part of a paved set, from below and from above.

From below: parts proved inside that meet in a corner of the face their boxes share; each part is convex. From
above: boxes that may hold poses of the set, joined by faces on which no constraint is proved negative. The
set is taken as open, so that ways through it need not pass edges or corners of boxes.
"""

from __future__ import annotations

import numpy as np

from tpm_design.arithmetic import inner, kernel
from tpm_design.workspace.box_verdicts import EVERY_CORNER
from tpm_design.workspace.joined_sets import find, join
from tpm_design.workspace.paving import Paving

# pairs of boxes on the way down two trees: every step replaces one by two
STACK = 512
S, U, V = 0, 1, 2


@inner
def _corner_proved(corners, axis, side, along, box, point):  # type: ignore[no-untyped-def]
    """Whether a point of the face ``axis``, ``side`` of a box lies among corners that are proved inside:
    ``point`` gives its coordinates ``along`` the two other axes, ``box`` the limits of these."""
    for i in range(2):
        for j in range(2):
            first = point[0] != box[0, 1 - i]
            second = point[1] != box[1, 1 - j]
            # the corner matters unless the point is at the opposite end
            if first and second:
                corner = (side << axis) | (i << along[0]) | (j << along[1])
                if corners >> corner & 1 == 0:
                    return False
    return True


@inner
def _halve(limits, row, k, upper):  # type: ignore[no-untyped-def]
    middle = 0.5 * (limits[row, k, 0] + limits[row, k, 1])
    limits[row, k, 0 if upper else 1] = middle


@inner
def _step(tree, pairs, limits, depth, which, axis, side, along):  # type: ignore[no-untyped-def]
    """Replace the top pair by those with the halves of its ``which``-th box (0, 1) that are at the face."""
    child, halved = tree
    node = pairs[depth, which]
    cut = halved[node]
    row = 2 * depth + which
    if cut == axis:
        pairs[depth, which] = child[node] + side
        return depth + 1
    k = 0 if cut == along[0] else 1
    for w in range(2):
        pairs[depth + 1, w] = pairs[depth, w]
        for j in range(2):
            for end in range(2):
                limits[2 * depth + 2 + w, j, end] = limits[2 * depth + w, j, end]
    pairs[depth, which], pairs[depth + 1, which] = child[node], child[node] + 1
    _halve(limits, row, k, False)
    _halve(limits, row + 2, k, True)
    return depth + 2


@inner
def _meet(tree, traits, inside, parents, pairs, limits, point, face, other):  # type: ignore[no-untyped-def]
    """Join the leaves below the first pair that touch: ``face``, ``other``: axis, side and the axes along
    the face of the two boxes, whose limits along these are in ``limits``."""
    child, _ = tree
    corners, closed = traits
    lower, upper = parents
    axis, side, along = face
    axis2, side2, along2 = other
    depth = 1
    while depth > 0:
        depth -= 1
        a, b = pairs[depth, 0], pairs[depth, 1]
        box, box2 = limits[2 * depth], limits[2 * depth + 1]
        apart = (inside[a, 1] == 0.0 and child[a] < 0) or (inside[b, 1] == 0.0 and child[b] < 0)
        for k in range(2):
            apart = apart or box[k, 0] >= box2[k, 1] or box2[k, 0] >= box[k, 1]
        if apart:
            continue
        if child[a] >= 0 and (child[b] < 0 or a < b):
            depth = _step(tree, pairs, limits, depth, 0, axis, side, along)
        elif child[b] >= 0:
            depth = _step(tree, pairs, limits, depth, 1, axis2, side2, along2)
        else:
            if (closed[a] >> (2 * axis + side) | closed[b] >> (2 * axis2 + side2)) & 1 == 0:
                join(upper, a, b)
            if corners[a] & corners[b] == EVERY_CORNER:
                join(lower, a, b)
            elif corners[a] > 0 and corners[b] > 0:
                for corner in range(4):
                    for k in range(2):
                        near, far = max(box[k, 0], box2[k, 0]), min(box[k, 1], box2[k, 1])
                        point[k] = far if corner >> k & 1 else near
                    if _corner_proved(corners[a], axis, side, along, box, point) and _corner_proved(
                        corners[b], axis2, side2, along2, box2, point
                    ):
                        join(lower, a, b)
                        break


@inner
def _largest(parent, child, inside, column):  # type: ignore[no-untyped-def]
    totals = np.zeros(parent.size)
    for node in range(parent.size):
        if child[node] < 0:
            totals[find(parent, node)] += inside[node, column]
    return totals.max()


@kernel
def _largest_parts(child, halved, corners, closed, inside, roots, extent, contacts):  # type: ignore[no-untyped-def]
    size = child.size
    lower, upper = np.arange(size), np.arange(size)
    pairs = np.empty((STACK, 2), np.int64)
    limits, point = np.empty((2 * STACK, 2, 2)), np.empty(2)
    boxes = np.empty((size, 6))
    for root in range(roots):
        boxes[root] = 0.0
        boxes[root, 1], boxes[root, 3], boxes[root, 5] = extent, 1.0, 1.0
    tree, traits, parents = (child, halved), (corners, closed), (lower, upper)
    for node in range(size):
        if child[node] >= 0:
            axis = halved[node]
            first = 1 if axis == 0 else 0
            second = 1 if axis == 2 else 2
            middle = 0.5 * (boxes[node, 2 * axis] + boxes[node, 2 * axis + 1])
            for half in range(2):
                for j in range(6):
                    boxes[child[node] + half, j] = boxes[node, j]
                boxes[child[node] + half, 2 * axis + 1 - half] = middle
                pairs[0, half] = child[node] + half
                for end in range(2):
                    limits[half, 0, end] = boxes[node, 2 * first + end]
                    limits[half, 1, end] = boxes[node, 2 * second + end]
            along = (first, second)
            _meet(tree, traits, inside, parents, pairs, limits, point, (axis, 1, along), (axis, 0, along))
    for n in range(contacts.shape[0]):
        for w in range(2):
            pairs[0, w] = contacts[n, 5 * w]
            limits[w, 0, 0], limits[w, 0, 1] = 0.0, extent
            limits[w, 1, 0], limits[w, 1, 1] = 0.0, 1.0
        face = (contacts[n, 1], contacts[n, 2], (contacts[n, 3], contacts[n, 4]))
        other = (contacts[n, 6], contacts[n, 7], (contacts[n, 8], contacts[n, 9]))
        _meet(tree, traits, inside, parents, pairs, limits, point, face, other)
    return _largest(lower, child, inside, 0), _largest(upper, child, inside, 1)


def chart_contacts(roots: np.ndarray) -> np.ndarray:
    """Faces that charts (C, 4), axis and octant, share: per row, for both charts, the chart, the axis and
    side of the face, and the axes along it in the same order.

    Chart a has u = 1 where its neighbour a + 1 of the same octant has v = 1; v there is u here. Across the
    plane of a coordinate that is a chart's u or v, the charts of both octants have the same coordinates.
    """
    rows = []
    for i, (axis, *octant) in enumerate(roots.tolist()):
        for j, (axis2, *octant2) in enumerate(roots.tolist()):
            if octant == octant2 and axis2 == (axis + 1) % 3:
                rows.append((i, U, 1, S, V, j, V, 1, S, U))
            differing = [k for k in range(3) if octant[k] != octant2[k]]
            if i < j and axis == axis2 and len(differing) == 1 and differing[0] != axis:
                face, along = (U, V) if differing[0] == (axis + 1) % 3 else (V, U)
                rows.append((i, face, 0, S, along, j, face, 0, S, along))
    return np.array(rows, np.int64).reshape(-1, 10)


def largest_part(paving: Paving) -> tuple[float, float]:
    """Lower and upper bound (m³) of the volume of the largest connected part of the paved set."""
    tree, size = paving.tree, paving.tree.size
    lower, upper = _largest_parts(
        tree.child[:size],
        tree.axis[:size],
        tree.corners[:size],
        tree.closed[:size],
        tree.inside[:size],
        len(paving.roots),
        paving.extent,
        chart_contacts(paving.roots),
    )
    # sums of the same volumes as the paving's own
    rounding = paving.sum_rounding
    return max(0.0, lower - rounding), upper + rounding
