"""The form of a study: which keys there are and what type each has.

What the names mean (mechanisms, metrics, methods) is checked afterwards, in ``resolve``; the JSON Schema
is made from these models.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    model_validator,
)
from pydantic_core import PydanticCustomError

LARGEST = 1e15
SMALLEST = 1e-15
LARGEST_GRID = 1_000_000
ARCHITECTURES = "architectures"
"""The key by which a file asks several mechanisms the same."""

NAME = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"
PYTHON_FILE = r"^[^/\\].*\.py$"
NAME_REMEDY = "Use 1 to 64 letters, digits, '.', '_' or '-', a letter or digit first: it names a folder."


def fault(what: str, remedy: str) -> PydanticCustomError:
    """An error in the words of the program."""
    # pydantic fills {…} in a message from the context, so the texts travel there
    return PydanticCustomError("fault", "{what}", {"what": what, "remedy": remedy})


def _sane(value: float) -> float:
    # squares and cubes of anything in a study must stay far from overflow and underflow
    if value and not SMALLEST <= abs(value) <= LARGEST:
        raise fault(
            f"the number {value:g} is out of bounds", f"Stay within {SMALLEST:g} … {LARGEST:g}, or use 0."
        )
    return value + 0.0  # no negative zero


Number = Annotated[float, Field(strict=True, allow_inf_nan=False), AfterValidator(_sane)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0), AfterValidator(_sane)]
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0), AfterValidator(_sane)]
Whole = Annotated[int, Field(strict=True)]
Text = Annotated[str, Field(strict=True)]
Label = Annotated[str, Field(strict=True, pattern=r"^\w[\w .,:()=+/%-]{0,119}$")]
Triple = tuple[Number, Number, Number]


class Strict(BaseModel):
    """A mapping with known keys only."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        # before anything else, so that a misspelt key is not also reported as a missing one
        if isinstance(data, dict) and cls.model_config.get("extra") == "forbid":
            unknown = [key for key in data if key not in cls.model_fields]
            if unknown:
                raise PydanticCustomError(
                    "unknown_keys", "unknown keys", {"unknown": unknown, "known": list(cls.model_fields)}
                )
        return data


class UnitsModel(Strict):
    """``units: {length: mm, angle: deg}``"""

    length: Literal["mm", "cm", "m", "in"]
    angle: Literal["deg", "rad"]


class Range(Strict):
    """``{min, max[, initial][, scale: log]}``: a free quantity."""

    min: Number
    max: Number
    initial: Number | None = None
    scale: Literal["log"] | None = None

    @model_validator(mode="after")
    def _in_order(self) -> Range:
        _check_range(self, "Write the number alone to fix the quantity.")
        return self


class Ratio(Strict):
    """``{ratio: f, min, max[, initial][, scale: log]}``: a parameter that is searched as a multiple of
    another one; the numbers are multiples."""

    ratio: Text
    min: Number
    max: Number
    initial: Number | None = None
    scale: Literal["log"] | None = None

    @model_validator(mode="after")
    def _in_order(self) -> Ratio:
        _check_range(self, "Widen the range.")
        return self


def _check_range(given: Range | Ratio, instead: str) -> None:
    """``instead``: what to do where the range is one value."""
    if given.min > given.max:
        raise fault(f"min {given.min:g} is larger than max {given.max:g}", "Swap them.")
    if given.min == given.max:
        raise fault(f"min and max are both {given.min:g}", instead)
    if given.scale == "log" and given.min <= 0.0:
        raise fault(f"min {given.min:g} has no logarithm", "Choose min above 0, or leave `scale: log` out.")
    if given.initial is not None and not given.min <= given.initial <= given.max:
        raise fault(
            f"initial {given.initial:g} is outside {given.min:g} … {given.max:g}",
            "Choose it within the range.",
        )


def _distinct(values: tuple[Any, ...]) -> tuple[Any, ...]:
    if len(set(values)) < len(values):
        raise fault("the list holds the same value twice", "Remove the double.")
    return values


class Values(Strict):
    """``{values: […]}``: a discrete quantity."""

    values: Annotated[tuple[Number, ...], Field(min_length=1), AfterValidator(_distinct)]


class Equals(Strict):
    """``{equals: f}``: a parameter that takes the value of another one."""

    equals: Text


def _quantity_form(value: Any) -> str | None:
    if isinstance(value, dict | BaseModel):
        given = value if isinstance(value, dict) else value.model_fields_set
        return next((form for form in ("values", "equals", "ratio") if form in given), "range")
    return "number"


def _free_form(value: Any) -> str | None:
    form = _quantity_form(value)
    return "range" if form in ("equals", "ratio") else form


Quantity = Annotated[
    Annotated[Number, Tag("number")] | Annotated[Range, Tag("range")] | Annotated[Values, Tag("values")],
    Discriminator(_free_form),
]
ParameterQuantity = Annotated[
    Annotated[Number, Tag("number")]
    | Annotated[Range, Tag("range")]
    | Annotated[Values, Tag("values")]
    | Annotated[Equals, Tag("equals")]
    | Annotated[Ratio, Tag("ratio")],
    Discriminator(_quantity_form),
]


class Limits(Strict):
    """``{min, max}`` of a joint."""

    min: Number
    max: Number

    @model_validator(mode="after")
    def _in_order(self) -> Limits:
        if self.min >= self.max:
            raise fault(f"min {self.min:g} is not below max {self.max:g}", "Swap them or widen the range.")
        return self


def _limit_form(value: Any) -> str:
    if isinstance(value, bool):
        return "switch"
    return "range" if isinstance(value, dict | BaseModel) else "number"


LimitValue = Annotated[
    Annotated[NonNegative, Tag("number")]
    | Annotated[Limits, Tag("range")]
    | Annotated[Annotated[bool, Field(strict=True)], Tag("switch")],
    Discriminator(_limit_form),
]

ModeValue = Annotated[
    Annotated[Literal["best"], Tag("word")] | Annotated[dict[Text, Text], Tag("signs")],
    Discriminator(lambda value: "signs" if isinstance(value, dict) else "word"),
]


class MechanismModel(Strict):
    """``mechanism:``, a ``type`` known here or the Python ``file`` that defines it."""

    type: Text | None = None
    file: Annotated[str, Field(strict=True, pattern=PYTHON_FILE)] | None = None
    sha256: Annotated[str, Field(strict=True, pattern=r"^[0-9a-f]{64}$")] | None = None
    parameters: dict[Text, ParameterQuantity]
    mode: ModeValue | None = None
    limits: dict[Text, LimitValue] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_source(self) -> MechanismModel:
        if self.type is None and self.file is None:
            raise fault(
                "`type` is missing", "Add `type: …`, or `file: my_robot.py` for a mechanism of yours."
            )
        if self.type is not None and self.file is not None:
            raise fault("type and file exclude each other", "Keep the one that names the mechanism.")
        if self.sha256 is not None and self.file is None:
            raise fault("sha256 belongs to a file", "Remove it.")
        return self


class Center(Strict):
    """``center: {x, y, z}``; ``mirrored``: each axis takes the sign of the mode's octant."""

    x: Quantity
    y: Quantity
    z: Quantity
    mirrored: Annotated[bool, Field(strict=True)] = False


def _center_form(value: Any) -> str:
    if isinstance(value, dict | Center):
        return "axes"
    return "word" if isinstance(value, str) else "point"


CenterValue = Annotated[
    Annotated[Literal["free"], Tag("word")]
    | Annotated[Triple, Tag("point")]
    | Annotated[Center, Tag("axes")],
    Discriminator(_center_form),
]


class BoxModel(Strict):
    """Edge lengths along x, y, z."""

    type: Literal["box"]
    size: tuple[Positive, Positive, Positive]
    center: CenterValue


class CylinderModel(Strict):
    """Its axis is along z."""

    type: Literal["cylinder"]
    radius: Positive
    height: Positive
    center: CenterValue


class SphereModel(Strict):
    """A ball."""

    type: Literal["sphere"]
    radius: Positive
    center: CenterValue


class EllipsoidModel(Strict):
    """Half axes along x, y, z."""

    type: Literal["ellipsoid"]
    semi_axes: tuple[Positive, Positive, Positive]
    center: CenterValue


class PointsModel(Strict):
    """Single poses about the centre, from a CSV file beside the study or written out."""

    type: Literal["points"]
    file: Text | None = None
    points: Annotated[tuple[Triple, ...], Field(min_length=1)] | None = None
    center: CenterValue

    @model_validator(mode="after")
    def _one_source(self) -> PointsModel:
        if (self.file is None) == (self.points is None):
            raise fault(
                "points come from one place", "Give either `file: poses.csv` or `points: [[x, y, z], …]`."
            )
        return self


class DistanceCenter(Strict):
    """``center: {d}``: the middle of the distances."""

    d: Quantity


DistanceCenterValue = Annotated[
    Annotated[Literal["free"], Tag("word")] | Annotated[DistanceCenter, Tag("axes")],
    Discriminator(lambda value: "word" if isinstance(value, str) else "axes"),
]


class TiltModel(Strict):
    """Every tilt up to one, whichever way, over a height of distances."""

    type: Literal["tilt"]
    tilt: Positive
    height: Positive
    center: DistanceCenterValue


RegionModel = Annotated[
    BoxModel | CylinderModel | SphereModel | EllipsoidModel | PointsModel | TiltModel,
    Field(discriminator="type"),
]


class Entry(Strict):
    """One metric; further keys are its options."""

    model_config = ConfigDict(extra="allow", frozen=True)

    metric: Text
    label: Label | None = None

    @property
    def options(self) -> dict[str, Any]:
        return dict(self.model_extra or {})


class ObjectiveModel(Entry):
    """``{metric, sense}``"""

    sense: Literal["maximize", "minimize"]


class ConstraintModel(Entry):
    """``{metric, min and/or max}`` in the metric's unit, in the study's units."""

    min: Number | None = None
    max: Number | None = None

    @model_validator(mode="after")
    def _bounded(self) -> ConstraintModel:
        if self.min is None and self.max is None:
            raise fault("the constraint has neither min nor max", "Add `min:`, `max:` or both.")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise fault(f"min {self.min:g} is larger than max {self.max:g}", "Swap them.")
        return self


class RecordModel(Entry):
    """``{metric}``: computed and stored, no more."""


class OptimizerModel(Strict):
    """``optimizer:``"""

    method: Text | None = None
    budget: Annotated[Whole, Field(ge=1, le=10**9)] = 2000
    seed: Annotated[Whole, Field(ge=0, le=2**32 - 1)] = 1
    polish: Text | None = None


class AccuracyModel(Strict):
    """``accuracy:``"""

    volume: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-6, le=0.1)] = 1e-3
    region_samples: Annotated[Whole, Field(ge=3, le=129)] = 9


class CertifyModel(Strict):
    """``certify:`` asks for a proof of the best design."""

    tolerance: dict[Text, NonNegative] = Field(default_factory=dict)
    boxes: Annotated[Whole, Field(ge=1, le=10**8)] = 400_000


class Steps(Strict):
    """``{num}`` over the free range, or ``{min, max, num}``."""

    num: Annotated[Whole, Field(ge=2, le=LARGEST_GRID)]
    min: Number | None = None
    max: Number | None = None

    @model_validator(mode="after")
    def _in_order(self) -> Steps:
        if (self.min is None) != (self.max is None):
            raise fault("min and max come together", "Give both, or neither for the whole range.")
        if self.min is not None and self.max is not None and self.min >= self.max:
            raise fault(f"min {self.min:g} is not below max {self.max:g}", "Swap them or widen the range.")
        return self


SweepValue = Annotated[
    Annotated[Number, Tag("number")] | Annotated[Text, Tag("word")],
    Discriminator(lambda value: "word" if isinstance(value, str) else "number"),
]


class Listed(Strict):
    """``{values: […]}``"""

    values: Annotated[tuple[SweepValue, ...], Field(min_length=1), AfterValidator(_distinct)]


def _axis_form(value: Any) -> str:
    given = value if isinstance(value, dict) else getattr(value, "model_fields_set", ())
    return "values" if "values" in given else "steps"


Axis = Annotated[Annotated[Steps, Tag("steps")] | Annotated[Listed, Tag("values")], Discriminator(_axis_form)]


class GridModel(Strict):
    """Every combination of the listed steps."""

    type: Literal["grid"]
    parameters: Annotated[dict[Text, Axis], Field(min_length=1)]


class ListModel(Strict):
    """Designs one by one."""

    type: Literal["list"]
    points: Annotated[tuple[Annotated[dict[Text, SweepValue], Field(min_length=1)], ...], Field(min_length=1)]


class SampleModel(Strict):
    """Points spread over the free ranges; without ``parameters`` all free quantities vary."""

    type: Literal["sobol", "latin_hypercube"]
    samples: Annotated[Whole, Field(ge=1, le=LARGEST_GRID)]
    seed: Annotated[Whole, Field(ge=0, le=2**32 - 1)] = 1
    parameters: Annotated[tuple[Text, ...], Field(min_length=1), AfterValidator(_distinct)] | None = None


SweepModel = Annotated[GridModel | ListModel | SampleModel, Field(discriminator="type")]


class StudyModel(Strict):
    """A whole study file."""

    version: Annotated[Whole, Field(ge=1, le=1)]
    name: Annotated[str, Field(strict=True, pattern=NAME)]
    units: UnitsModel
    mechanism: MechanismModel
    region: RegionModel | None = None
    objectives: Annotated[tuple[ObjectiveModel, ...], Field(min_length=1)]
    constraints: tuple[ConstraintModel, ...] = ()
    optimizer: OptimizerModel = OptimizerModel()
    accuracy: AccuracyModel = AccuracyModel()
    certify: CertifyModel | None = None
    sweep: SweepModel | None = None
    record: tuple[RecordModel, ...] = ()
