"""What a mechanism declares about itself, as words: the same on a terminal and in its page of the docs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tpm_design.mechanisms.base import Limit, MechanismKind, Parameter

UNITS = {"length": "length", "angle": "angle", "ratio": "–"}
COORDINATES = {"m": "length", "rad": "angle", "-": "–"}
LIMIT_VALUES = {"range": "{min, max}", "number": "one number", "switch": "true or false"}
CONVENTION = (
    "Lengths and angles carry the units that a study declares (mm, cm, m or in; deg or rad); Python has "
    "metres and radians."
)


@dataclass(frozen=True)
class Table:
    """Rows of words, the first of each a name of the program."""

    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Facts:
    """``lines``: what it is about, and the words; ``tables``: those that have rows."""

    lines: tuple[tuple[str, str], ...]
    tables: tuple[Table, ...]
    remarks: tuple[str, ...]


def mechanism_facts(kind: MechanismKind) -> Facts:
    """Everything a user needs to know of a mechanism before choosing dimensions."""
    tables = (
        Table(
            ("parameter", "limb by limb", "symbol", "unit", "must be", "default", "what it is"),
            tuple(
                (
                    p.name,
                    _limb_names(kind, p),
                    p.symbol,
                    UNITS[p.dimension],
                    p.domain,
                    _default(p),
                    p.description,
                )
                for p in kind.parameters
            ),
        ),
        Table(
            ("working mode", "value", "what it is"),
            tuple(
                (f.name, f"{f.length} signs" + (' or "any"' if f.any_allowed else ""), f.description)
                for f in kind.mode_fields
            ),
        ),
        Table(
            ("limit", "unit", "value", "what it is"),
            tuple((x.name, _limit_unit(x), LIMIT_VALUES[x.kind], x.description) for x in kind.limits),
        ),
        Table(
            ("singularity", "equation", "condition"),
            tuple((s.name, s.equation, s.condition) for s in kind.singularities),
        ),
    )
    return Facts(
        lines=(
            ("Pose", pose_text(kind)),
            ("Actuators", actuator_text(kind)),
            ("Driven by", ", ".join(kind.drives)),
        ),
        tables=tuple(table for table in tables if table.rows),
        remarks=kind.remarks,
    )


def pose_text(kind: MechanismKind) -> str:
    """``x, y, z (length)``; units one by one where they differ."""
    units = [COORDINATES[unit] for unit in kind.pose_units]
    if len(set(units)) == 1:
        return f"{', '.join(kind.pose)} ({units[0]})"
    return ", ".join(f"{name} ({unit})" for name, unit in zip(kind.pose, units, strict=True))


def actuator_text(kind: MechanismKind) -> str:
    """How many there are, what they do, and the unit of their coordinates."""
    how = "turn (angle)" if kind.actuator_unit == "rad" else "slide (length)"
    return f"{kind.limb_count} that {how}"


def overview(kinds: Sequence[MechanismKind]) -> Table:
    """All mechanisms, one in a row."""
    return Table(
        ("mechanism", "what it is", "pose", "actuators", "singularities"),
        tuple(
            (kind.name, kind.title, pose_text(kind), actuator_text(kind),
             ", ".join(singularity.name for singularity in kind.singularities))
            for kind in kinds
        ),
    )  # fmt: skip


def _limb_names(kind: MechanismKind, parameter: Parameter) -> str:
    """The names that set one limb each: ``f1 … f3``."""
    return f"{parameter.name}1 … {parameter.name}{kind.limb_count}" if parameter.per_limb else "–"


def _default(parameter: Parameter) -> str:
    """The value that a study may leave out, one number where all limbs have the same; angles in degrees."""
    if parameter.default is None:
        return "required"
    unit = "°" if parameter.dimension == "angle" else ""
    values = [
        f"{round(math.degrees(value), 9) + 0.0 if unit else value:g}{unit}".replace("-", "−")
        for value in parameter.default
    ]
    return values[0] if len(set(values)) == 1 else ", ".join(values)


def _limit_unit(limit: Limit) -> str:
    return "–" if limit.kind == "switch" else UNITS[limit.dimension]
