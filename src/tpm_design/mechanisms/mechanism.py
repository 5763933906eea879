"""A mechanism with dimensions: what users call ``m``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tpm_design.arithmetic import Interval
from tpm_design.errors import ParameterError, did_you_mean
from tpm_design.mechanisms import derived, pointwise  # noqa: F401  (derived equations are registered)
from tpm_design.mechanisms.assembly import Assembly
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.mechanisms.fold_lines import FoldLine
from tpm_design.mechanisms.parameters import enclosed_values, mode_signs

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Mode:
    """A working mode: its label and its signs, a named tuple of ±1 (0: any) for the kernels."""

    label: str
    signs: Any


class OnlyMode(NamedTuple):
    """The signs of a mechanism that has one working mode."""

    only: float = 1.0


@dataclass(frozen=True)
class Mechanism(ABC):
    """One machine. ``parameters``: name → SI value per limb; ``geometry``: the same for the kernels.
    ``signs_class``: named tuple of the signs of a mode, its fields named as those of the mode."""

    signs_class: ClassVar[type[Any]] = OnlyMode

    kind: MechanismKind
    parameters: Mapping[str, tuple[float, ...]]
    geometry: Any

    def mode_of(self, signs: Mapping[str, str]) -> Mode:
        """The working mode named by sign strings, e.g. ``{"octant": "+++", "elbows": "+-+"}``. Raises
        ParameterError on anything but one sign string for each field."""
        values = mode_signs(self.kind, signs)
        label = " ".join(signs[field.name] for field in self.kind.mode_fields) or "only"
        return Mode(label, self.signs_class(**values))

    def single_octants(self, mode: Mode) -> tuple[Mode, ...]:
        """Modes that make up ``mode`` between planes that no aspect crosses; itself where there are none."""
        return (mode,)

    def coordinates(self, poses: FloatArray) -> FloatArray:
        """What formulas, regions and proofs take (N, 3) for poses (N, 3) as users write them: the same, but
        where another choice makes the equations algebraic (``MechanismKind.coordinates``)."""
        return poses

    def poses(self, coordinates: FloatArray) -> FloatArray:
        """Poses (N, 3) as users write them; the inverse of ``coordinates``."""
        return coordinates

    def pose_rates(self, poses: FloatArray, rates: FloatArray) -> FloatArray:
        """Rates of the poses (N, 3, 3) from those that ``equations.velocity_map`` speaks of, at ``poses`` as
        users write them."""
        return rates

    @abstractmethod
    def reach_radius(self) -> float:
        """The platform's point lies within this distance (m) of the origin at every reachable pose."""

    def reach_half_axes(self) -> tuple[float, float, float]:
        """Half axes of an ellipsoid about the origin that holds the coordinates of every reachable pose."""
        radius = self.reach_radius()
        return radius, radius, radius

    def fold_lines(self) -> tuple[FoldLine, ...]:
        """Lines of folded limbs that no region may hold in its interior; none where reach bounds all of them
        already."""
        return ()

    @abstractmethod
    def enclosed_geometry(self, tolerance: Mapping[str, float]) -> Any:
        """The geometry as Intervals that hold every machine whose parameters differ from this one's by no
        more than ``tolerance`` (name → ±, SI), each limb by itself; ``{}``: this machine alone."""

    def total_link_length(self) -> float:
        """Sum over the limbs of the moving links (m)."""
        lengths = [self.parameters[p.name] for p in self.kind.parameters if p.moving_link]
        # a length for all limbs is there once
        return sum(sum(per_limb) * (self.kind.limb_count // len(per_limb)) for per_limb in lengths)

    def enclosed_link_length(self, tolerance: Mapping[str, float]) -> Interval:
        """Bounds (m) of ``total_link_length`` for every machine within ``tolerance``."""
        values = enclosed_values(self.kind, self.parameters, tolerance)
        total = Interval(0.0, 0.0)
        for parameter in self.kind.parameters:
            if parameter.moving_link:
                for limb in range(self.kind.limb_count):
                    lengths = values[parameter.name]
                    total = total + lengths[limb % len(lengths)]
        return total

    @abstractmethod
    def assemblies(
        self, q: ArrayLike, mode: Mode | None = None, *, drive: str = "motor"
    ) -> tuple[Assembly, ...]:
        """Every real assembly for actuator coordinates ``q`` (3,), as ``fk`` gives them, each with a box that
        is proved to hold it alone, or with the box where that proof fails."""

    def fk(self, q: ArrayLike, mode: Mode | None = None, *, drive: str = "motor") -> FloatArray:
        """Every real assembly (K, 3), in SI, for actuator coordinates ``q`` (3,), of all working modes
        or of ``mode``, each confirmed by the inverse map; (0, 3) if there is none. ``drive`` as in ``ik``.

        Raises ParameterError on an unknown ``drive``, on anything but three finite numbers, and where
        assemblies do not stand apart, at a singularity: its message names the box.
        """
        found = self.assemblies(q, mode, drive=drive)
        return np.array([assembly.pose for assembly in found]).reshape(-1, 3)

    def ik(self, points: ArrayLike, mode: Mode, *, drive: str = "motor") -> FloatArray:
        """Actuator coordinates (N, n) at ``points`` (N, 3), in SI; rows of NaN where the pose is
        unreachable, outside the mode's octant or joint limits, or the coordinates are undefined.

        Raises ParameterError on an unknown ``drive`` or points that are not (N, 3) finite numbers.
        """
        x, y, z = pointwise.columns(self.coordinates(_poses(points)))
        out = np.empty((x.size, 3))
        pointwise.actuators_row(self.geometry, mode.signs, self.motor_weight(drive), x, y, z, out)
        out[~self._usable(x, y, z, mode) | ~np.isfinite(out).all(axis=1)] = np.nan
        return out

    def jacobian(self, points: ArrayLike, mode: Mode, *, drive: str = "motor") -> FloatArray:
        """J (N, 3, 3) of ẋ = J q̇ at ``points`` (N, 3); NaN where ``ik`` is NaN or J does not exist.

        Raises ParameterError as ``ik`` does.
        """
        poses = _poses(points)
        x, y, z = pointwise.columns(self.coordinates(poses))
        out = np.empty((x.size, 3, 3))
        pointwise.jacobian_row(self.geometry, mode.signs, self.motor_weight(drive), x, y, z, out)
        out[~self._usable(x, y, z, mode) | ~np.isfinite(out).all(axis=(1, 2))] = np.nan
        return self.pose_rates(poses, out)

    def margins(self, points: ArrayLike, mode: Mode) -> dict[str, FloatArray]:
        """Margins (N,) at ``points`` (N, 3).

        "reach": metres, ≥ 0 where the pose belongs to the mode's workspace (the leg margin; outside the
        octant or the joint limits the negative distance to them where that is worse). "serial" and the
        signed determinants of unit rows: NaN where unreachable, 0 where their rows are undefined.
        """
        return self.margins_at(self.coordinates(_poses(points)), mode)

    def margins_at(self, coordinates: FloatArray, mode: Mode) -> dict[str, FloatArray]:
        """``margins`` at coordinates (N, 3)."""
        x, y, z = pointwise.columns(coordinates)
        legs, side, determinants = self._margins(x, y, z, mode)
        reach = np.where(side < 0.0, np.minimum(legs, side), legs)
        reach[np.isnan(legs) | np.isnan(side)] = 0.0
        serial = np.empty(x.size)
        pointwise.serial_row(self.geometry, mode.signs, x, y, z, serial)
        serial[~np.isfinite(serial)] = 0.0
        determinants[np.isnan(determinants)] = 0.0
        outside = reach < 0.0
        serial[outside] = np.nan
        determinants[:, outside] = np.nan
        named = dict(zip(self.kind.determinants, determinants, strict=True))
        return {"reach": reach, "serial": serial, **named}

    def determinants(self, points: ArrayLike, mode: Mode) -> FloatArray:
        """Signed determinants (D, N) at ``points`` (N, 3), reachable or not; 0 where undefined."""
        return self.determinants_at(self.coordinates(_poses(points)), mode)

    def determinants_at(self, coordinates: FloatArray, mode: Mode) -> FloatArray:
        """``determinants`` at coordinates (N, 3)."""
        # another layout would be compiled by itself
        poses = np.ascontiguousarray(coordinates, dtype=np.float64)
        return np.asarray(pointwise.determinant_table(self.geometry, mode.signs, poses))

    def joint_centres(self, pose: ArrayLike, mode: Mode) -> FloatArray:
        """Joint centres (limbs, centres, 3) in metres at one pose, from the base along each limb."""
        x, y, z = (float(value) for value in self.coordinates(_poses(pose))[0])
        return np.asarray(pointwise.centres_at(self.geometry, mode.signs, x, y, z))

    def motor_weight(self, drive: str) -> float:
        """1.0 for motors, 0.0 for joints; raises ParameterError on another word."""
        if drive not in self.kind.drives:
            raise ParameterError(f"Unknown drive {drive!r}.", remedy=did_you_mean(drive, self.kind.drives))
        return 1.0 if drive == "motor" else 0.0

    def _margins(
        self, x: FloatArray, y: FloatArray, z: FloatArray, mode: Mode
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        legs, side = np.empty(x.size), np.empty(x.size)
        determinants = np.empty((len(self.kind.determinants), x.size))
        pointwise.margins_row(self.geometry, mode.signs, x, y, z, legs, side, determinants)
        return legs, side, determinants

    def _usable(self, x: FloatArray, y: FloatArray, z: FloatArray, mode: Mode) -> NDArray[np.bool_]:
        legs, side = np.empty(x.size), np.empty(x.size)
        pointwise.reach_row(self.geometry, mode.signs, x, y, z, legs, side)
        # coordinate planes belong to no octant: strictly inside
        return (legs >= 0.0) & (side > 0.0)


def _poses(points: ArrayLike) -> FloatArray:
    """Points as (N, 3) floats; raises ParameterError otherwise."""
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError("Poses must be numbers.", remedy="Give an (N, 3) array in SI units.") from None
    if array.ndim == 1 and array.size == 3:
        array = array.reshape(1, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ParameterError(f"Poses have shape {array.shape}.", remedy="Give an (N, 3) array in SI units.")
    if not np.isfinite(array).all():
        raise ParameterError("A pose is not finite.", remedy="Remove NaN and infinite coordinates.")
    return array
