"""An inscribed body in a study's own terms: its region, and the study that asks whether it is free."""

from __future__ import annotations

from typing import Any

from tpm_design.problem import Design
from tpm_design.study.document import parse_document
from tpm_design.study.form import parse
from tpm_design.study.plain import dump_yaml, plain
from tpm_design.study.registries import registries
from tpm_design.study.resolve import resolve
from tpm_design.study.study import Study
from tpm_design.synthesis.inscribed import InscribedBody
from tpm_design.units import Units
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Sphere


def region_of(body: InscribedBody, units: Units) -> dict[str, Any]:
    """The body as a study's ``region:``, in its units."""

    def written(value: float) -> float:
        # a dozen digits: converted back and forth they may differ in the last place
        return float(f"{units.from_si(value, 'm'):.13g}")

    shape = body.shape
    data: dict[str, Any] = {"type": body.form.name}
    if isinstance(shape, Box):
        data |= {"size": [written(edge) for edge in shape.size]}
    elif isinstance(shape, Sphere):
        data |= {"radius": written(shape.radius)}
    elif isinstance(shape, Cylinder):
        data |= {"radius": written(shape.radius), "height": written(shape.height)}
    elif isinstance(shape, Ellipsoid):
        data |= {"semi_axes": [written(axis) for axis in shape.semi_axes]}
    region: dict[str, Any] = plain(data | {"center": [written(value) for value in body.centre]})
    return region


def study_of(study: Study, design: Design, body: InscribedBody) -> tuple[Study, Design]:
    """The study with the body for its region, whose one constraint is that all of it lies in one aspect, for
    exact dimensions; and the design in it."""
    data = study.resolved() | {"region": region_of(body, study.units), "record": []}
    data.pop("sweep", None)
    data.pop("certify", None)
    taken = {entry["label"] for entry in data["objectives"]}
    label = "coverage" if "coverage" not in taken else "coverage of the body"
    data["constraints"] = [{"metric": "coverage", "label": label, "min": 1}]
    document = parse_document(dump_yaml(data), study.path)
    asked = resolve(document, parse(document), registries(), allow_code=study.plug_in is not None)
    placed = {name: asked.problem.fixed[name] for name in asked.problem.kind.centre_names}
    return asked, {**design, **placed}
