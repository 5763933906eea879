"""Each mechanism as its source describes it: joints, axes and links, none of the program's equations.

``BUILDERS``: mechanism → its model from the parameters per limb (m, rad). Limbs that end in revolute joints
are welded to the platform; rods end in ball joints, two of them to a parallelogram.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from mjcf import Element, FloatArray, MjcfWriter, MultibodyModel

Parameters = Mapping[str, tuple[float, ...]]
LIMBS = range(3)
UP = np.array([0.0, 0.0, 1.0])
# of a short bar, relative to the rods; any other shows the same
HALF_BAR = 0.1


def square_to(axis: FloatArray) -> FloatArray:
    """A unit vector square to ``axis``."""
    across: FloatArray = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    return across


def outward(azimuth: float) -> FloatArray:
    return np.array([math.cos(azimuth), math.sin(azimuth), 0.0])


def on_sphere(azimuth: float, elevation: float) -> FloatArray:
    return math.cos(elevation) * outward(azimuth) + math.sin(elevation) * UP


def motors(joint: str) -> tuple[dict[str, float], ...]:
    """The joint of this name in each limb is the actuator."""
    return tuple({f"{limb}.{joint}": 1.0} for limb in LIMBS)


def weld_to_platform(writer: MjcfWriter, limb: int, end: Element, at: FloatArray) -> None:
    """The limb's last body is part of the platform, its origin the platform's point ``at``."""
    writer.weld(
        f"{limb}.weld",
        writer.site(end, f"{limb}.end"),
        writer.site(writer.platform, f"{limb}.platform", at),
    )


def add_rods(
    writer: MjcfWriter,
    limb: int,
    arm: Element,
    tip: FloatArray,
    bar: FloatArray,
    length: float,
    at: FloatArray,
) -> None:
    """Two rods between ball joints, from either side of ``tip`` of the arm to either side of ``at`` of the
    platform, the short bars along ``bar``."""
    writer.site(arm, f"{limb}.tip", tip)
    writer.site(writer.platform, f"{limb}.platform", at)
    for side in (-1.0, 1.0):
        offset = side * HALF_BAR * length * bar
        name = f"{limb}.rod{side:+.0f}"
        rod = writer.ball(arm, name, tip + offset)
        end = writer.site(rod, f"{name}.end", -length * UP)
        writer.connect(name, end, writer.site(writer.platform, f"{name}.platform", at + offset))


def uru(parameters: Parameters) -> MultibodyModel:
    """Paper A, Figs. 1 and 2: the first axes are the coordinate axes; the motor's shaft is coaxial with the
    first joint and turns the second joint through bevel gears that the cross carries."""
    writer = MjcfWriter()
    first_across = (np.eye(3)[1], -np.eye(3)[0], np.eye(3)[0])  # g_i at θ_i1 = 0
    for limb, (axis, across) in enumerate(zip(np.eye(3), first_across, strict=True)):
        base, platform, f, r, ratio = (parameters[name][limb] for name in ("db", "dp", "f", "r", "k"))
        cross = writer.hinge(writer.base, f"{limb}.first", axis, base * axis)
        writer.hinge(cross, f"{limb}.shaft", axis)
        proximal = writer.hinge(cross, f"{limb}.second", across)
        distal = writer.hinge(proximal, f"{limb}.third", across, f * axis)
        upper_cross = writer.hinge(distal, f"{limb}.fourth", across, r * axis)
        end = writer.hinge(upper_cross, f"{limb}.fifth", axis)
        writer.gear(f"{limb}.gear", f"{limb}.second", f"{limb}.shaft", ratio)
        weld_to_platform(writer, limb, end, platform * axis)
    shafts = tuple({f"{limb}.first": 1.0, f"{limb}.shaft": 1.0} for limb in LIMBS)
    return writer.model(motor=shafts, joint=motors("second"))


def add_planar_chain(
    writer: MjcfWriter, limb: int, carriage: Element, axis: FloatArray, parameters: Parameters
) -> Element:
    """Three parallel R joints with the links f and r between them; the body after the third."""
    along = square_to(axis)
    proximal = writer.hinge(carriage, f"{limb}.first", axis)
    distal = writer.hinge(proximal, f"{limb}.second", axis, parameters["f"][limb] * along)
    return writer.hinge(distal, f"{limb}.third", axis, parameters["r"][limb] * along)


def limb_points(parameters: Parameters, limb: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axis s_i, base point and platform point of one limb of paper B."""
    axis = on_sphere(parameters["azimuth"][limb], parameters["elevation"][limb])
    base = np.array([parameters[name][limb] for name in ("ax", "ay", "az")])
    platform = np.array([parameters[name][limb] for name in ("bx", "by", "bz")])
    return axis, base, platform


def crr(parameters: Parameters) -> MultibodyModel:
    """Paper B, Fig. 1: a C joint, its translation actuated, and two R joints parallel to it."""
    writer = MjcfWriter()
    for limb in LIMBS:
        axis, base, platform = limb_points(parameters, limb)
        carriage = writer.slide(writer.base, f"{limb}.slide", axis, base)
        end = add_planar_chain(writer, limb, carriage, axis, parameters)
        weld_to_platform(writer, limb, end, platform)
    return writer.model(motor=motors("slide"))


def prrr(parameters: Parameters) -> MultibodyModel:
    """Paper B, section 8.2: an actuated P joint in a direction of its own, and three parallel R joints."""
    writer = MjcfWriter()
    for limb in LIMBS:
        axis, base, platform = limb_points(parameters, limb)
        rail = on_sphere(parameters["slide_azimuth"][limb], parameters["slide_elevation"][limb])
        carriage = writer.slide(writer.base, f"{limb}.slide", rail, base)
        end = add_planar_chain(writer, limb, carriage, axis, parameters)
        weld_to_platform(writer, limb, end, platform)
    return writer.model(motor=motors("slide"))


def crrr(parameters: Parameters) -> MultibodyModel:
    """Paper B, section 8.2: one more R joint between the last of the CRR limb and the platform."""
    writer = MjcfWriter()
    for limb in LIMBS:
        axis, base, platform = limb_points(parameters, limb)
        idle = on_sphere(parameters["idle_azimuth"][limb], parameters["idle_elevation"][limb])
        carriage = writer.slide(writer.base, f"{limb}.slide", axis, base)
        last = add_planar_chain(writer, limb, carriage, axis, parameters)
        end = writer.hinge(last, f"{limb}.idle", idle)
        weld_to_platform(writer, limb, end, platform)
    return writer.model(motor=motors("slide"))


def delta(parameters: Parameters) -> MultibodyModel:
    """Upper arms that turn downward about horizontal axes, and parallelograms of rods."""
    writer = MjcfWriter()
    for limb in LIMBS:
        direction = outward(parameters["azimuth"][limb])
        axis = np.cross(UP, direction)
        w, u, upper, lower = (parameters[name][limb] for name in ("w", "u", "L", "l"))
        arm = writer.hinge(writer.base, f"{limb}.arm", axis, w * direction)
        add_rods(writer, limb, arm, upper * direction, axis, lower, u * direction)
    return writer.model(motor=motors("arm"))


def linear_delta(parameters: Parameters) -> MultibodyModel:
    """Carriages that run down rails, upright or tilted outward, and parallelograms of rods."""
    writer = MjcfWriter()
    for limb in LIMBS:
        direction = outward(parameters["azimuth"][limb])
        tilt = parameters["tilt"][limb]
        rail = math.sin(tilt) * direction - math.cos(tilt) * UP
        top = parameters["R"][limb] * direction
        writer.site(writer.base, f"{limb}.top", top)
        carriage = writer.slide(writer.base, f"{limb}.slide", rail, top)
        at = parameters["r"][limb] * direction
        add_rods(writer, limb, carriage, np.zeros(3), np.cross(UP, direction), parameters["l"][limb], at)
    return writer.model(motor=motors("slide"))


def orthoglide(parameters: Parameters) -> MultibodyModel:
    """P, R, parallelogram of four R joints, R: both R axes along the short bars, on limb i along the axis
    after e_i."""
    writer = MjcfWriter()
    for limb in LIMBS:
        axis, bar, across = (np.roll(np.eye(3), -limb, axis=0)[n] for n in range(3))
        length = parameters["L"][limb]
        half = HALF_BAR * length * bar
        carriage = writer.slide(writer.base, f"{limb}.slide", axis)
        yoke = writer.hinge(carriage, f"{limb}.yoke", bar)
        one = writer.hinge(yoke, f"{limb}.one", across, half)
        other = writer.hinge(yoke, f"{limb}.other", across, -half)
        coupler = writer.hinge(one, f"{limb}.coupler", across, -length * axis)
        end = writer.hinge(coupler, f"{limb}.last", bar, -half)
        writer.connect(
            f"{limb}.parallelogram",
            writer.site(other, f"{limb}.other_end", -length * axis),
            writer.site(coupler, f"{limb}.coupler_end", -2.0 * half),
        )
        weld_to_platform(writer, limb, end, parameters["d"][limb] * axis)
    return writer.model(motor=motors("slide"))


def puu(parameters: Parameters) -> MultibodyModel:
    """Paper C, Fig. 1: the first axis of the lower U joint lies along the rail, the last axis of the upper
    one in the platform at the same angle to it, the two between are parallel and square to the link."""
    writer = MjcfWriter()
    (R,), (r,), (theta,), (length,), (offset,) = (parameters[name] for name in ("R", "r", "theta", "L", "o"))
    for limb, azimuth in enumerate(np.radians([210.0, 90.0, 330.0])):
        direction = outward(float(azimuth))
        tangent = np.cross(UP, direction)
        rail = -math.cos(theta) * direction + math.sin(theta) * UP
        mirrored = -math.cos(theta) * direction - math.sin(theta) * UP
        writer.site(writer.base, f"{limb}.start", R * direction)
        carriage = writer.slide(writer.base, f"{limb}.slide", rail, R * direction)
        lower_cross = writer.hinge(carriage, f"{limb}.first", rail)
        link = writer.hinge(lower_cross, f"{limb}.second", tangent)
        upper_cross = writer.hinge(link, f"{limb}.third", tangent, length * UP)
        end = writer.hinge(upper_cross, f"{limb}.fourth", mirrored)
        weld_to_platform(writer, limb, end, r * direction + offset * UP)
    return writer.model(motor=motors("slide"))


BUILDERS: Mapping[str, Callable[[Parameters], MultibodyModel]] = {
    "crr": crr,
    "crrr": crrr,
    "delta": delta,
    "linear_delta": linear_delta,
    "orthoglide": orthoglide,
    "prrr": prrr,
    "puu": puu,
    "uru": uru,
}
