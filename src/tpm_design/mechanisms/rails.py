"""Three limbs, each a carriage on a straight rail and a strut from it to the platform.

With the carriage at anchor_i + q_i u_i, shifted by the platform's joint, |w_i − q_i u_i| = l_i for
w_i = p − anchor_i. The strut's part along the rail is ± h_i, h_i² = l_i² − |w_i × u_i|².
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

from numpy.typing import ArrayLike

from tpm_design.arithmetic import formula, magnitude, root, sqr
from tpm_design.mechanisms import equations, forward
from tpm_design.mechanisms.angles import EnclosedVector
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.mechanisms.parameters import three_numbers
from tpm_design.mechanisms.spheres import sphere_intersection

Triple = tuple[float, ...]


class CarriageSigns(NamedTuple):
    """A working mode: on which side of the platform each carriage is, +1 or −1."""

    carriages: Triple


def anchor(geometry, limb):  # type: ignore[no-untyped-def]
    """Where the carriage at q = 0 is, less where the platform's joint is (m)."""
    raise NotImplementedError


def along_rail(geometry, limb, side):  # type: ignore[no-untyped-def]
    """Sign of the strut's part along the rail, from the carriage to the platform."""
    raise NotImplementedError


def swing_margin(geometry, limb, w, h):  # type: ignore[no-untyped-def]
    """Metres, ≥ 0 within the limit of the strut's swing."""
    raise NotImplementedError


def limb_strut(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """w × u, its length, h and w of one limb, see the implementation."""
    raise NotImplementedError


def _limb_strut(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    ax, ay, az = anchor(geometry, limb)
    ux, uy, uz = geometry.rail[limb]
    wx, wy, wz = x - ax, y - ay, z - az
    # the cross product has no cancellation where the rail is along an axis
    cx, cy, cz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
    square = sqr(cx) + sqr(cy) + sqr(cz)
    return (cx, cy, cz), root(square), root(sqr(geometry.strut[limb]) - square), (wx, wy, wz)


def _limb_row(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    """s_i · ẋ = (s_i · u_i) q̇_i: the strut keeps its length."""
    (cx, cy, cz), _, h, _ = limb_strut(geometry, limb, x, y, z)
    ux, uy, uz = geometry.rail[limb]
    length = geometry.strut[limb]
    b = along_rail(geometry, limb, sign) * h
    row = ((uy * cz - uz * cy + b * ux), (uz * cx - ux * cz + b * uy), (ux * cy - uy * cx + b * uz))
    return (row[0] / length, row[1] / length, row[2] / length), b / length


def _limb_carriage(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    _, _, h, w = limb_strut(geometry, limb, x, y, z)
    ux, uy, uz = geometry.rail[limb]
    return w[0] * ux + w[1] * uy + w[2] * uz - along_rail(geometry, limb, sign) * h


def _strut_on_axis(geometry, limb, x, y, z):  # type: ignore[no-untyped-def]
    """As ``_limb_strut`` where rail i and anchor i are along the i-th axis: w along it and along the two axes
    that follow, in place of both vectors."""
    ax, ay, az = anchor(geometry, limb)
    w = (x - ax, y, z) if limb == 0 else ((y - ay, z, x) if limb == 1 else (z - az, x, y))
    square = sqr(w[1]) + sqr(w[2])
    return w, root(square), root(sqr(geometry.strut[limb]) - square), w


def _row_on_axis(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    _, _, h, _ = limb_strut(geometry, limb, x, y, z)
    length = geometry.strut[limb]
    b = along_rail(geometry, limb, sign) * h / length
    if limb == 0:
        return (b, y / length, z / length), b
    if limb == 1:
        return (x / length, b, z / length), b
    return (x / length, y / length, b), b


def _carriage_on_axis(geometry, limb, sign, x, y, z):  # type: ignore[no-untyped-def]
    _, _, h, w = limb_strut(geometry, limb, x, y, z)
    return w[0] - along_rail(geometry, limb, sign) * h


def _leg_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """l_i − |w_i × u_i|."""
    _, across1, _, _ = limb_strut(geometry, 0, x, y, z)
    _, across2, _, _ = limb_strut(geometry, 1, x, y, z)
    _, across3, _, _ = limb_strut(geometry, 2, x, y, z)
    l1, l2, l3 = geometry.strut
    return l1 - across1, l2 - across2, l3 - across3


def _mode_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Both ends of each rail, then the swing of each strut."""
    k1, k2, k3 = mode.carriages
    _, _, h1, w1 = limb_strut(geometry, 0, x, y, z)
    _, _, h2, w2 = limb_strut(geometry, 1, x, y, z)
    _, _, h3, w3 = limb_strut(geometry, 2, x, y, z)
    swing1, swing2, swing3 = (
        swing_margin(geometry, 0, w1, h1),
        swing_margin(geometry, 1, w2, h2),
        swing_margin(geometry, 2, w3, h3),
    )
    if geometry.limited == 0.0:
        return swing1, swing2, swing3, swing1, swing2, swing3, swing1, swing2, swing3
    q1 = equations.limb_actuator(geometry, 0, k1, x, y, z)
    q2 = equations.limb_actuator(geometry, 1, k2, x, y, z)
    q3 = equations.limb_actuator(geometry, 2, k3, x, y, z)
    low1, low2, low3 = geometry.lowest
    high1, high2, high3 = geometry.highest
    return q1 - low1, high1 - q1, q2 - low2, high2 - q2, q3 - low3, high3 - q3, swing1, swing2, swing3


def _serial_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """|s_i · u_i|: 0 where a strut is square to its rail."""
    _, (b1, b2, b3), _ = equations.unit_velocity_map(geometry, mode, 1.0, x, y, z)
    return magnitude(b1), magnitude(b2), magnitude(b3)


def rail_equations(geometry_class: type, *, on_axes: bool) -> None:
    """Register what all mechanisms of this kind have in common for a geometry with ``rail`` (unit vectors),
    ``strut``, ``limited``, ``lowest`` and ``highest``. It gives ``anchor``, ``along_rail`` and
    ``swing_margin`` itself. ``on_axes``: rails and anchors of the limbs are along x, y and z in turn,
    and ``swing_margin`` does not look at w."""
    formula(limb_strut, geometry_class)(_strut_on_axis if on_axes else _limb_strut)
    formula(equations.limb_row, geometry_class)(_row_on_axis if on_axes else _limb_row)
    formula(equations.limb_actuator, geometry_class)(_carriage_on_axis if on_axes else _limb_carriage)
    formula(equations.leg_margins, geometry_class)(_leg_margins)
    formula(equations.mode_margins, geometry_class)(_mode_margins)
    formula(equations.serial_margins, geometry_class)(_serial_margins)


def rail_assemblies(
    mechanism: Mechanism, anchors: Sequence[EnclosedVector], q: ArrayLike, mode: Mode | None, drive: str
) -> tuple[Assembly, ...]:
    """Every real assembly for carriage positions ``q`` (3,) in metres, of all working modes or of ``mode``:
    the points at the struts' lengths from anchor_i + q_i u_i."""
    mechanism.motor_weight(drive)
    positions = three_numbers(q, "q", "Give three carriage positions in m.")
    enclosed = mechanism.enclosed_geometry({})
    centres = [
        [a + float(position) * u for a, u in zip(anchor_i, rail, strict=True)]
        for anchor_i, rail, position in zip(anchors, enclosed.rail, positions, strict=True)
    ]
    found = sphere_intersection(centres, enclosed.strut)
    sides = itertools.product((1.0, -1.0), repeat=3)
    modes = [CarriageSigns(signs) for signs in sides] if mode is None else [mode.signs]
    return forward.confirmed(mechanism, found, modes, positions, 1.0, 0.0)
