"""Equations that follow from others, for mechanisms that give none of their own."""

from __future__ import annotations

import math

from tpm_design.arithmetic import derived
from tpm_design.arithmetic.algebra import determinant
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.segments import chain_distance


@derived(equations.velocity_map)
def _velocity_map(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    """Rows that are unit vectors as they are."""
    rows, b, _ = equations.unit_velocity_map(geometry, mode, motor, x, y, z)
    return rows, b


@derived(equations.singularity_margins)
def _singularity_margins(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """det A of unit rows alone: no other singularity takes control from the platform."""
    (a, b, c), _, _ = equations.unit_velocity_map(geometry, mode, 1.0, x, y, z)
    return (determinant(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]),)


@derived(equations.input_transmission)
def _input_transmission(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """The driven point pushes along the unit row: its serial margin."""
    return equations.serial_margins(geometry, mode, x, y, z)


@derived(equations.limb_clearance)
def _limb_clearance(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """Straight links from joint centre to joint centre as capsules of the link radius, limbs in pairs."""
    first, second, third = equations.joint_centres(geometry, mode, x, y, z)
    least = min(chain_distance(first, second), chain_distance(second, third), chain_distance(third, first))
    return least - 2.0 * geometry.link_radius


@derived(equations.length_error_gains)
def _length_error_gains(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    """There are none where poses are not positions: metrics of them are refused."""
    return math.nan, math.nan, math.nan
