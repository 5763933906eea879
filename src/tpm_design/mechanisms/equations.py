"""The equations a mechanism may give, as names to be implemented by type of geometry.

Each is called inside compiled code with the mechanism's geometry and mode (named tuples of numbers)
and a pose x, y, z, all of one kind of number: float, Interval or Dual. A mechanism's file implements
them with ``@formula(name, Geometry)``. Those in ``derived.py`` follow from the others where a mechanism
gives none of its own.
"""

from __future__ import annotations

from typing import Any


def leg_margins(geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> Any:
    """Metres, ≥ 0 inside the leg space of each limb: a tuple of all the bounds of reach."""
    raise NotImplementedError


def mode_margins(geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> Any:
    """Metres, ≥ 0 where the pose belongs to the working mode: side of the octant, joint limits."""
    raise NotImplementedError


def singularity_margins(geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> Any:
    """Signed determinants of unit rows, in [−1, 1], in the order of ``MechanismKind.determinants``."""
    raise NotImplementedError


def serial_margins(geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> Any:
    """Per limb, the dimensionless distance to a serial singularity, ≥ 0."""
    raise NotImplementedError


def velocity_map(geometry: Any, mode: Any, motor: Any, x: Any, y: Any, z: Any) -> Any:
    """Rows of A (three triples) and the diagonal b of A ẋ = diag(b) q̇. ``motor``: 1 motors, 0 joints."""
    raise NotImplementedError


def unit_velocity_map(geometry: Any, mode: Any, motor: Any, x: Any, y: Any, z: Any) -> Any:
    """``velocity_map`` with unit rows: the rows of A, the diagonal b, and the positive factors by which both
    were multiplied."""
    raise NotImplementedError


def actuators(geometry: Any, mode: Any, motor: Any, x: Any, y: Any, z: Any) -> Any:
    """Actuator coordinates (rad or m), three of them. ``motor`` as in ``velocity_map``."""
    raise NotImplementedError


def closure(geometry: Any, motor: Any, q: Any, chart: Any, u: Any, v: Any, w: Any) -> Any:
    """Three residuals that vanish at every pose where the limbs close for actuator coordinates ``q``, in
    whichever working mode, and a tuple of numbers that are > 0 only where the pose is none such. Both may
    allow too much. The pose is given by coordinates u, v, w in a ``chart`` of the mechanism's own, a tuple
    of floats; u, v, w alone may be other than floats. ``motor`` as in ``velocity_map``."""
    raise NotImplementedError


def joint_centres(geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> Any:
    """Per limb, the chain of joint centres (m) from the base: limbs × centres × 3."""
    raise NotImplementedError


def length_error_gains(geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> Any:
    """Per limb, the norm of the length errors' coefficients in a_i · dx = c_i · dε (a_i a row of A)."""
    raise NotImplementedError


def input_transmission(geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> Any:
    """Per limb, |a_i · t_i| of the unit row and the driven point's unit velocity, in [0, 1]."""
    raise NotImplementedError


def limb_clearance(geometry: Any, mode: Any, x: Any, y: Any, z: Any) -> Any:
    """Least distance (m) between the surfaces of links of different limbs."""
    raise NotImplementedError


def limb_parameters(geometry: Any, limb: Any) -> Any:
    """One limb's lengths and ratios, a tuple of one kind of number: all on which its margins and velocities
    depend, each parameter or a combination of some."""
    raise NotImplementedError


def with_limb_parameters(geometry: Any, limb: Any, values: Any) -> Any:
    """The geometry with other parameters of one limb, in the same order. Where ``values`` are of another kind
    of number (Duals, say), the other limbs' parameters become constants of that kind."""
    raise NotImplementedError


def limb_row(geometry: Any, limb: Any, sign: Any, x: Any, y: Any, z: Any) -> Any:
    """The unit row of A and the entry of b of one limb. For mechanisms whose modes are one ``sign`` for each
    limb: ``derived.py`` makes ``unit_velocity_map`` of it."""
    raise NotImplementedError


def limb_actuator(geometry: Any, limb: Any, sign: Any, x: Any, y: Any, z: Any) -> Any:
    """The actuator coordinate of one limb, from which ``derived.py`` makes ``actuators``."""
    raise NotImplementedError


def limb_joints(geometry: Any, limb: Any, sign: Any, x: Any, y: Any, z: Any) -> Any:
    """The chain of joint centres of one limb, from which ``derived.py`` makes ``joint_centres``."""
    raise NotImplementedError


def limb_error_gain(geometry: Any, limb: Any, sign: Any, x: Any, y: Any, z: Any) -> Any:
    """The norm of one limb's length-error coefficients: ``derived.py`` makes ``length_error_gains`` of it."""
    raise NotImplementedError
