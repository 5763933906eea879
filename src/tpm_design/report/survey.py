"""The best design's workspace as a report shows it: slices, distances, headlines."""

from __future__ import annotations

from dataclasses import dataclass

from tpm_design.metrics import METRICS
from tpm_design.metrics.context import Context
from tpm_design.problem import Goal, Problem
from tpm_design.report.aspect import ChosenAspect, Pose, choose_aspect, home_of, middle_of
from tpm_design.report.slices import Slice, planes_through, region_middle, slice_fields, window
from tpm_design.units import Units
from tpm_design.workspace.extents import field_extent
from tpm_design.workspace.indices import CONDITION_2, CONDITION_FROBENIUS, LEGS, Index

CONDITIONING = ("conditioning_min", "conditioning_share", "conditioning_mean")


# metres: a plane of the octant is a singularity as well
CLOSE = 1e-9


@dataclass(frozen=True)
class ConditioningShown:
    """Which 1/κ is drawn, and the study's bound on it."""

    norm: str
    drive: str
    bound: float | None

    @property
    def name(self) -> str:
        norm = "Frobenius norm" if self.norm == "frobenius" else "2-norm"
        return f"1/κ ({norm}, {self.drive} drive)"

    def index(self, context: Context) -> Index:
        quantity = CONDITION_FROBENIUS if self.norm == "frobenius" else CONDITION_2
        return Index(quantity, motor=context.mechanism.motor_weight(self.drive))


def conditioning_shown(problem: Problem) -> ConditioningShown:
    """The conditioning the study constrains, else the first it names, else 2-norm and first drive."""
    kind = problem.kind
    for name in CONDITIONING:
        for goal in (*problem.constraints, *problem.objectives, *problem.record):
            if goal.metric.name == name:
                return ConditioningShown(
                    str(goal.options.get("norm", "2")),
                    str(goal.options.get("drive", kind.drives[0])),
                    _bound_of(goal),
                )
    return ConditioningShown("2", kind.drives[0], None)


def has_conditioning(problem: Problem) -> bool:
    """Whether a condition number has a meaning for the mechanism."""
    return METRICS["conditioning_min"].refusal(problem.kind, problem.limits) is None


def _bound_of(goal: Goal) -> float | None:
    if goal.metric.name == "conditioning_min":
        return goal.minimum
    threshold = goal.options.get("threshold")
    return None if threshold is None else float(threshold)


@dataclass(frozen=True)
class Nearest:
    """The singularity or edge of reach nearest to the region: ``distance`` (m), negative where it cuts the
    region, and the pose (m) where it is."""

    name: str
    distance: float
    pose: Pose


@dataclass(frozen=True)
class Survey:
    """Three slices of one design. ``size`` (m): longest side of the box of the joint centres. ``volumes``
    (m³) of the aspect and of all that is within reach, without a region. ``nearest``: what limits the
    region."""

    context: Context
    aspect: ChosenAspect | None
    slices: tuple[Slice, Slice, Slice]
    size: float | None
    volumes: tuple[float, float] | None
    nearest: Nearest | None

    def headline(self, units: Units) -> str:
        """What the slices show."""
        size = f"Robot size {units.written(self.size, 'm', 4)}: " if self.size is not None else ""
        if self.context.region is None:
            if self.volumes is None and not self.context.mechanism.kind.translational:
                return f"{size}what the mode reaches and where it is singular"
            if self.volumes is None:
                return "The mode reaches nothing"
            free, whole = (units.written(volume, "m³", 4) for volume in self.volumes)
            return f"{size}{free} without singularities, of {whole} within reach"
        if not self.context.reachable:
            shortfall = units.written(-self.context.reach.value, "m", 3)
            return f"The region is not wholly within reach: {shortfall} are missing"
        if self.nearest is None:
            return f"{size}the region is within reach"
        distance = units.written(abs(self.nearest.distance), "m", 3)
        if self.nearest.distance < 0.0:
            return f"{size}the {self.nearest.name} cuts the region, {distance} deep"
        return f"{size}the region keeps {distance} from the nearest limit, a {self.nearest.name}"

    def conditioning_headline(self, shown: ConditioningShown) -> str:
        """What the conditioning map shows."""
        if self.context.region is None:
            return f"Conditioning {shown.name} through the middle of the singularity-free side"
        if not self.context.reachable:
            return f"Conditioning {shown.name}: the region is not wholly within reach"
        if min((side.margin for side in self.context.sides), default=0.0) < 0.0:
            return f"Conditioning {shown.name}: a singularity cuts the region"
        least = self.context.least(shown.index(self.context)).value
        bound = "" if shown.bound is None else f" (bound {shown.bound:g})"
        return f"Conditioning {shown.name}: at least {least:.3g} over the region{bound}"


def survey(context: Context, problem: Problem) -> Survey | None:
    """The slices of a design; None where its mode reaches nothing and there is no region to show."""
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    aspect = choose_aspect(context, home_of(goals))
    if context.region is not None:
        middle = region_middle(context.region)
    elif aspect is not None:
        middle = middle_of(context, aspect)
    else:
        return None
    planes = planes_through(middle.tolist())
    extent = window(context, planes)
    index = conditioning_shown(problem).index(context) if has_conditioning(problem) else Index(LEGS)
    one, two, three = (slice_fields(context, plane, extent, aspect, index) for plane in planes)
    return Survey(
        context,
        aspect,
        (one, two, three),
        _size(context, aspect),
        _volumes(context, home_of(goals)),
        _nearest(context),
    )


def _size(context: Context, aspect: ChosenAspect | None) -> float | None:
    """Longest side (m) of the box of the joint centres, over the region or the aspect."""
    if context.region is not None:
        return context.size.value if context.reachable else None
    if aspect is None:
        return None
    return field_extent(context.mechanism.geometry, context.mode.signs, context.aspects[0])


def _volumes(context: Context, home: Pose | None) -> tuple[float, float] | None:
    """As the volume metrics have them."""
    if not context.mechanism.kind.translational:
        return None
    field = context.aspects[0] if context.region is None else None
    if field is None or not field.volumes.size:
        return None
    at_home = None if home is None else context.aspect_of(field, home)
    chosen = field.largest() if at_home is None else at_home
    return float(field.volumes[chosen]), float(field.volumes.sum())


def _nearest(context: Context) -> Nearest | None:
    # distances between poses that are not positions mean nothing
    if context.region is None or not context.reachable or not context.mechanism.kind.translational:
        return None
    edge = context.least(Index(LEGS))
    found = [Nearest("reach boundary", edge.value, edge.pose)]
    for part, name in enumerate(context.mechanism.kind.determinants):
        distance = context.locus_distance(part)
        if distance.pose is not None:
            found.append(Nearest(f"{name} singularity", distance.value, distance.pose))
    nearest = min(found, key=lambda limit: limit.distance)
    # what is left are the limits of joints, measured on the links that they turn
    if context.reach.value < nearest.distance - CLOSE:
        return Nearest("joint limit", context.reach.value, context.reach.pose)
    return nearest
