"""Equations that follow from others, for mechanisms that give none of their own."""

from __future__ import annotations

from tpm_design.arithmetic import derived
from tpm_design.arithmetic.algebra import determinant
from tpm_design.mechanisms import equations
from tpm_design.mechanisms.segments import chain_distance


@derived(equations.unit_velocity_map)
def _unit_velocity_map(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    k1, k2, k3 = mode[0]
    row1, b1 = equations.limb_row(geometry, 0, k1, x, y, z)
    row2, b2 = equations.limb_row(geometry, 1, k2, x, y, z)
    row3, b3 = equations.limb_row(geometry, 2, k3, x, y, z)
    return (row1, row2, row3), (b1, b2, b3), (1.0, 1.0, 1.0)


@derived(equations.actuators)
def _actuators(geometry, mode, motor, x, y, z):  # type: ignore[no-untyped-def]
    k1, k2, k3 = mode[0]
    return (
        equations.limb_actuator(geometry, 0, k1, x, y, z),
        equations.limb_actuator(geometry, 1, k2, x, y, z),
        equations.limb_actuator(geometry, 2, k3, x, y, z),
    )


@derived(equations.joint_centres)
def _joint_centres(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    k1, k2, k3 = mode[0]
    return (
        equations.limb_joints(geometry, 0, k1, x, y, z),
        equations.limb_joints(geometry, 1, k2, x, y, z),
        equations.limb_joints(geometry, 2, k3, x, y, z),
    )


@derived(equations.length_error_gains)
def _length_error_gains(geometry, mode, x, y, z):  # type: ignore[no-untyped-def]
    k1, k2, k3 = mode[0]
    return (
        equations.limb_error_gain(geometry, 0, k1, x, y, z),
        equations.limb_error_gain(geometry, 1, k2, x, y, z),
        equations.limb_error_gain(geometry, 2, k3, x, y, z),
    )


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
