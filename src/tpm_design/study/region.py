"""The useful region of a study: its shape in metres, and poses from a CSV file beside the study."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

from tpm_design.errors import StudyError
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.study.beside import file_beside
from tpm_design.study.document import number, read_text, where
from tpm_design.study.faults import Faults, shown
from tpm_design.study.model import (
    LARGEST,
    BoxModel,
    CylinderModel,
    EllipsoidModel,
    PointsModel,
    SphereModel,
    TiltModel,
)
from tpm_design.units import Units
from tpm_design.workspace.regions import REGIONS, Box, Cylinder, Ellipsoid, Points, Shape, Sphere, Tilt

Triple = tuple[float, float, float]
AnyRegion = BoxModel | CylinderModel | SphereModel | EllipsoidModel | PointsModel | TiltModel

MOST_POINTS = 10_000  # so that a resolved study, which holds them, stays below 1 MB


def check_form(name: str, kind: MechanismKind, faults: Faults) -> None:
    """Faults where the mechanism's poses cannot fill a region of this form."""
    if REGIONS[name].positions != kind.translational:
        suitable = [form.name for form in REGIONS.values() if form.positions == kind.translational]
        faults.stop(
            ("region", "type"),
            f"the poses of {kind.name} ({', '.join(kind.pose)}) do not fill a {name} region",
            f"Choose {' or '.join(suitable)}.",
        )


def read_region(model: AnyRegion, units: Units, folder: Path, faults: Faults) -> tuple[Shape, dict[str, Any]]:
    """The shape (m), and the region written out in the study's units without its centre."""

    def metres(values: Triple) -> Triple:
        x, y, z = (units.to_si(value, "m") for value in values)
        return x, y, z

    written: dict[str, Any] = {"type": model.type}
    if isinstance(model, BoxModel):
        return Box(metres(model.size)), written | {"size": model.size}
    if isinstance(model, EllipsoidModel):
        return Ellipsoid(metres(model.semi_axes)), written | {"semi_axes": model.semi_axes}
    if isinstance(model, SphereModel):
        return Sphere(units.to_si(model.radius, "m")), written | {"radius": model.radius}
    if isinstance(model, CylinderModel):
        cylinder = Cylinder(units.to_si(model.radius, "m"), units.to_si(model.height, "m"))
        return cylinder, written | {"radius": model.radius, "height": model.height}
    if isinstance(model, TiltModel):
        tilt = Tilt(units.to_si(model.tilt, "rad"), units.to_si(model.height, "m"))
        if tilt.tilt >= math.pi:
            faults.stop(("region", "tilt"), "the tilt is half a turn or more", "Choose a smaller one.")
        return tilt, written | {"tilt": model.tilt, "height": model.height}
    points = model.points or _read_points(str(model.file), folder, faults)
    if len(points) > MOST_POINTS:
        faults.stop(
            ("region", "points"),
            f"there are {len(points)} points",
            f"Keep the most telling {MOST_POINTS} or fewer.",
        )
    return Points(tuple(metres(point) for point in points)), written | {"points": points}


def _read_points(name: str, folder: Path, faults: Faults) -> tuple[Triple, ...]:
    """Poses from a CSV file in the study's folder: x, y, z in the study's length unit, heading optional."""
    path = file_beside(name, folder, ("region", "file"), faults)
    try:
        text = read_text(path, what="points")
    except StudyError as error:
        told = f"the points file {where(path)}: {error.what}"
        faults.stop(("region", "file"), told, error.remedy or "Check the file.")
    return parse_points(text, path)


def parse_points(text: str, path: Path) -> tuple[Triple, ...]:
    """CSV text → points. Raises StudyError with the CSV file's line."""
    points: list[Triple] = []
    for line, row_text in enumerate(text.split("\n"), start=1):
        row = [cell.strip() for cell in next(csv.reader([row_text.rstrip("\r")], strict=False), [])]
        if not any(row):
            continue
        if not points and [cell.lower() for cell in row] == ["x", "y", "z"]:
            continue
        values = [number(cell) for cell in row]
        if len(row) != 3 or any(v is None or not math.isfinite(v) or abs(v) > LARGEST for v in values):
            raise StudyError(
                f"{shown(row_text)} is not a point",
                where=where(path, line),
                remedy="Write three numbers x,y,z, separated by commas.",
            )
        x, y, z = (float(v) for v in values if v is not None)
        points.append((x, y, z))
    if not points:
        raise StudyError("there are no points", where=where(path, 1), remedy="Write rows of x,y,z.")
    return tuple(points)
