"""What a mechanism declares about itself, and what every mechanism can do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from tpm_design.computed_once import computed_once
from tpm_design.mechanisms.outer_reach import OuterReach

if TYPE_CHECKING:
    from tpm_design.mechanisms.mechanism import Mechanism

Dimension = Literal["length", "angle", "ratio"]
Domain = Literal["positive", "non-negative", "non-zero", "any"]

Rotation = tuple[tuple[float, float, float], ...]
ModeCandidates = Callable[[Mapping[str, tuple[float, float]], bool], tuple[dict[str, str], ...]]


def within(domain: Domain, low: float, high: float) -> bool:
    """Whether every number from ``low`` to ``high`` is in the domain."""
    if domain == "positive":
        return low > 0
    if domain == "non-negative":
        return low >= 0
    if domain == "non-zero":
        return low > 0 or high < 0
    return True


@dataclass(frozen=True)
class Parameter:
    """One design parameter.

    ``per_limb``: the name sets all limbs, ``name1``, ``name2``, ``name3`` one limb each. ``default``: SI
    values per limb where none is given; None: it must be given. ``moving_link``: the length of a link that
    moves, so that it counts in the total link length.
    """

    name: str
    symbol: str
    dimension: Dimension
    domain: Domain
    description: str
    per_limb: bool = True
    default: tuple[float, ...] | None = None
    moving_link: bool = False


@dataclass(frozen=True)
class ModeField:
    """One sign string of a working mode, such as ``octant: "+-+"``."""

    name: str
    length: int
    description: str
    any_allowed: bool = False


@dataclass(frozen=True)
class Limit:
    """One optional joint limit or link dimension under ``limits:`` of a study.

    ``kind`` "range" takes ``{min, max}``, "number" one non-negative number, "switch" true or false.
    """

    name: str
    dimension: Dimension
    kind: Literal["range", "number", "switch"]
    description: str


@dataclass(frozen=True)
class Singularity:
    """One family of singularities; named as its determinant, if one vanishes."""

    name: str
    condition: str
    equation: str


@dataclass(frozen=True)
class Drawing:
    """What the line drawing of a mechanism needs beside ``equations.joint_centres``.

    ``joints``: one letter for each centre of a limb from the base, ``A`` for A_1, A_2, A_3; ``()``: they stay
    without names. ``driven``: the joint that the motor moves. ``slides_from``: for one that slides, the point
    where its coordinate is 0: a letter of its own, a joint, or ``O``. ``parallelogram``: the joints that two
    parallel rods connect, if any.

    ``marks``: a parameter's name, or a symbol such as ``q_i`` → where it is written on limb 1: at a point
    ``("A",)``, along a length ``("A", "C")``, or in an angle ``("OA", "A", "C")``, its vertex in the middle.
    Points are joints, ``O`` the origin, and of the platform ``P``, its position, or ``M``, the middle of its
    joints, where poses are not positions. Directions are ``+x`` … ``-z``,
    ``+rail`` and ``OA``, from O to A; a length along a direction is as long as its parameter.

    ``pose``: where the example is drawn; None: at a pose well inside the workspace.
    """

    joints: tuple[str, ...] = ()
    driven: str = ""
    slides_from: str = ""
    parallelogram: tuple[str, ...] = ()
    marks: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: MappingProxyType({}))
    pose: tuple[float, ...] | None = None


@dataclass(frozen=True)
class MechanismKind:
    """Everything the program knows about one mechanism before dimensions are chosen.

    ``build(parameters, limits)``: SI values by name → a mechanism. ``farthest_reach(ranges)``: a bound
    (m) on the distance of any reachable pose from the origin, from the (lowest, highest) SI value of
    every parameter name that is set. ``example``: SI values of a machine that works, for new studies.
    ``pose_units``: SI units of the pose's coordinates. ``transmission_drive``: the drive for which each limb
    pushes along its row of A, so that transmission indices exist; None where there is none.
    ``limb_rotation``: rows of the rotation that carries limb i to limb i + 1 where the limbs' lengths go with
    it; None where the limbs are not placed alike.
    ``coordinates``, ``coordinate_units``: what formulas and regions take instead of the pose, where that is
    something else (``Mechanism.coordinates``). ``tolerance_refusal``: why nothing can be proved within
    tolerances, None where it can. ``remarks``: what a user should know besides, one sentence or two each.
    ``mode_candidates(ranges, isotropic)``: sign strings of one working mode of each set that symmetry
    makes equal for every design of the ranges; None: all modes count as different.
    ``outer_reach``: the convex bounds of its reach, None where it declares none.
    """

    name: str
    title: str
    source: str
    parameters: tuple[Parameter, ...]
    pose: tuple[str, ...]
    actuator_unit: Literal["rad", "m"]
    drives: tuple[str, ...]
    mode_fields: tuple[ModeField, ...]
    limits: tuple[Limit, ...]
    determinants: tuple[str, ...]
    singularities: tuple[Singularity, ...]
    example: Mapping[str, float]
    build: Callable[[Mapping[str, Any], Mapping[str, Any]], Mechanism]
    farthest_reach: Callable[[Mapping[str, tuple[float, float]]], float]
    limb_count: int = 3
    pose_units: tuple[str, ...] = ("m", "m", "m")
    transmission_drive: str | None = "motor"
    limb_rotation: Rotation | None = None
    mode_candidates: ModeCandidates | None = None
    remarks: tuple[str, ...] = ()
    drawing: Drawing = Drawing()
    coordinates: tuple[str, ...] = ("x", "y", "z")
    coordinate_units: tuple[str, ...] = ("m", "m", "m")
    tolerance_refusal: str | None = None
    outer_reach: OuterReach | None = None

    @property
    def translational(self) -> bool:
        """Whether poses are positions, all coordinates lengths."""
        return set(self.pose_units) == {"m"}

    @property
    def centre_names(self) -> tuple[str, ...]:
        """The design quantities that place a region: one for each length of the pose, ``center_x`` …"""
        return tuple(filter(None, self._placing))

    def centre(self, design: Mapping[str, float | str]) -> tuple[float, float, float]:
        """Coordinates of a region's centre: its lengths, and 0 for every angle."""
        x, y, z = (float(design[name]) if name else 0.0 for name in self._placing)
        return x, y, z

    @computed_once
    def _placing(self) -> tuple[str, ...]:
        """What places a region along each coordinate of the pose, empty for angles."""
        return tuple(
            f"center_{name}" if unit == "m" else ""
            for name, unit in zip(self.pose, self.pose_units, strict=True)
        )

    def guard(self, drive: str) -> str:
        """The determinant whose zero takes control from the actuators of a drive."""
        return "actuation" if drive == "motor" else "translation"

    def parameter(self, name: str) -> Parameter | None:
        """The parameter that ``name`` sets (``f`` or ``f2``), or None."""
        return self._by_name.get(name)

    @computed_once
    def _by_name(self) -> Mapping[str, Parameter]:
        found: dict[str, Parameter] = {}
        for parameter in reversed(self.parameters):
            found |= dict.fromkeys((parameter.name, *self.limb_names[parameter.name]), parameter)
        return found

    @computed_once
    def limb_names(self) -> Mapping[str, tuple[str, ...]]:
        """Of each parameter the names that set one limb each; none where it is one for all limbs."""
        return {
            p.name: tuple(f"{p.name}{i + 1}" for i in range(self.limb_count)) if p.per_limb else ()
            for p in self.parameters
        }

    def parameter_names(self) -> list[str]:
        """Every name a study may use, the common ones first."""
        return [p.name for p in self.parameters] + [n for names in self.limb_names.values() for n in names]
