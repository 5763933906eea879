"""Small certificates for tests, by bisection with the checker's own test of a box."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tpm_design.checker.claims import KINDS, read_machine, read_region
from tpm_design.checker.fields import Fields, canonical_sha256
from tpm_design.checker.mechanisms.configuration import Machines
from tpm_design.checker.proof import all_positive, halves, on_its_sides, out_of_reach, spans_of
from tpm_design.checker.regions import Box, Domain
from tpm_design.checker.statements import Length, Locus, Reach, Statement
from tpm_design.study import load_study

Certificate = dict[str, Any]
DEPTH = 24

STUDY = """
version: 1
name: small
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters:
    {db: {min: 0, max: 400}, dp: 60, f: {min: 150, max: 600}, r: {min: 150, max: 600}, k: {values: [1, 2]}}
  mode: {octant: "+++", elbows: "+++"}
  limits: {theta3: {min: -170, max: -10}}
region: %s
objectives: [{metric: total_link_length, sense: minimize}]
constraints:
%s
certify: {tolerance: {db: 0.1, f: 0.1, r2: 0.05}}
"""

REGION = "{type: box, size: [40, 50, 60], center: {x: {min: 0, max: 900}, y: 155, z: {min: 0, max: 900}}}"
DESIGN = {"db": 0.186, "dp": 0.06, "f": 0.244, "r": 0.186, "k": 1.0}
CENTRE = (0.16, 0.155, 0.15)

CONSTRAINTS: dict[str, tuple[str, list[dict[str, Any]]]] = {
    "coverage": ("min: 1", []),
    "conditioning_min": ("min: 0.4", [{"kind": "condition", "drive": "motor", "floor": 0.41}]),
    "conditioning_min ": (
        "min: 0.5, norm: frobenius, label: frobenius",
        [{"kind": "frobenius", "drive": "motor", "floor": 0.55}],
    ),
    "actuation_singularity_distance": (
        "min: 20",
        [{"kind": "locus", "name": "actuation", "distance": 0.021}],
    ),
    "rotation_singularity_distance": ("min: 50", [{"kind": "locus", "name": "rotation", "distance": 0.055}]),
    "boundary_distance": ("min: 30", [{"kind": "reach", "floor": 0.031}]),
    "singularity_margin_min": ("min: 0.2", [{"kind": "serial", "floor": 0.25}]),
    "velocity_min": ("min: 1", [{"kind": "slowest", "drive": "motor", "floor": 0.06}]),
    "velocity_max": ("max: 8", [{"kind": "fastest", "drive": "motor", "ceiling": 0.4}]),
    "transmission_min": ("min: 0.2", [{"kind": "transmission", "floor": 0.25}]),
    "position_sensitivity": ("max: 4", [{"kind": "sensitivity", "drive": "motor", "ceiling": 3.5}]),
    "total_link_length": ("max: 1300, label: length", [{"kind": "length", "ceiling": 1.2911}]),
}
"""Metric → what is asked, and what its last statement says."""

SHARED: list[dict[str, Any]] = [
    {"kind": "reach", "floor": 0.0},
    *(
        {"kind": "determinant", "name": name, "sign": 1, "floor": 0.2}
        for name in ("translation", "actuation", "rotation")
    ),
]


@cache
def resolved_study(region: str, metrics: tuple[str, ...]) -> str:
    """The study as the program itself writes it out."""
    lines = [f"  - {{metric: {metric.strip()}, {CONSTRAINTS[metric][0]}}}" for metric in metrics]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "study.yaml"
        path.write_text(STUDY % (region, "\n".join(lines)), encoding="utf-8")
        return json.dumps(load_study(path).resolved())


def unproved(
    metrics: Sequence[str], region: str = REGION, placed: dict[str, Any] | None = None
) -> Certificate:
    """A certificate of the metrics' constraints, with statements that have no covers yet."""
    study = json.loads(resolved_study(region, tuple(metrics)))
    statements = copy.deepcopy(SHARED)
    requirements = []
    for entry, metric in zip(study["constraints"], metrics, strict=True):
        own = copy.deepcopy(CONSTRAINTS[metric][1])
        places = [*range(len(SHARED)), *range(len(statements), len(statements) + len(own))]
        statements += own
        options = {k: v for k, v in entry.items() if k not in ("metric", "label", "min", "max")}
        requirements.append(
            {
                "label": entry["label"],
                "metric": entry["metric"],
                "options": options,
                "min": in_si(metric, entry.get("min")),
                "max": in_si(metric, entry.get("max")),
                "outcome": "proved",
                "slack": None,
                "statements": places if metric != "total_link_length" else places[-1:],
                "breaking": None,
                "reason": "",
            }
        )
    for statement in statements:
        statement |= {"outcome": "proved", "covers": []}
    x, y, z = CENTRE
    box = {"form": "box", "centre": list(CENTRE), "half": [0.02, 0.025, 0.03]}
    return {
        "format": 1,
        "versions": {"tpm-design": "0", "python": "3", "numpy": "2", "numba": "0"},
        "study": study,
        "design": DESIGN | {"center_x": x, "center_y": y, "center_z": z, "mode": "+++ +++"},
        "machine": {
            "type": "uru",
            "parameters": {name: [value] * 3 for name, value in DESIGN.items()},
            "limits": {"theta3": [math.radians(-170), math.radians(-10)]},
        },
        "mode": {"octant": "+++", "elbows": "+++"},
        "tolerance": {"db": 1e-4, "f": 1e-4, "r2": 5e-5},
        "assumptions": ["axis directions are exact: misaligned axes are not covered"],
        "region": copy.deepcopy(placed or box),
        "statements": statements,
        "requirements": requirements,
        "outcome": "proved",
    }


def in_si(metric: str, value: float | None) -> float | None:
    if value is None or metric.startswith(("coverage", "conditioning", "singularity", "transm", "position")):
        return value
    return value / 1000 * 180 / math.pi if metric.startswith("velocity") else value / 1000


def prove(certificate: Certificate) -> Certificate:
    """The certificate with covers of all its statements, and its hashes."""
    fields = Fields(certificate, "certificate.json")
    machine, region = read_machine(fields), read_region(fields)
    machines = machine.within_tolerance()
    assert region is not None
    for data, entry in zip(certificate["statements"], fields.entries("statements"), strict=True):
        statement = KINDS[data["kind"]](entry, machine.mechanism)
        if isinstance(statement, Length):
            continue
        distance = statement.distance if isinstance(statement, Locus) else 0.0
        data["covers"] = []
        for body in region.parts:
            domain = Domain(body, distance)
            root = outer_box(domain)
            tree = "".join(letters(statement, machines, domain, root, 0))
            data["covers"].append({"root": [list(interval) for interval in root], "tree": tree})
    return signed(certificate)


def outer_box(domain: Domain) -> Box:
    """The bounding box in floats that hold it; a pose is its own."""
    ends = []
    for low, high in domain.bounds():
        down, up = float(low), float(high)
        down = math.nextafter(down, -math.inf) if down > low else down
        ends.append((down, math.nextafter(up, math.inf) if up < high else up))
    return ends[0], ends[1], ends[2]


def letters(statement: Statement, machines: Machines, domain: Domain, box: Box, depth: int) -> list[str]:
    if domain.outside(box):
        return ["o"]
    spans = spans_of(machines, box)
    in_mode = not isinstance(statement, Reach) or on_its_sides(machines, box)
    if in_mode and all_positive(statement, machines, spans):
        return ["p"]
    if isinstance(statement, Locus) and out_of_reach(machines, box, spans):
        return ["n"]
    widths = [high - low for low, high in box]
    assert depth < DEPTH, f"{statement} cannot be proved at {box}"
    axis = widths.index(max(widths))
    lower, upper = halves(box, axis)
    return [
        "xyz"[axis],
        *letters(statement, machines, domain, lower, depth + 1),
        *letters(statement, machines, domain, upper, depth + 1),
    ]


def signed(certificate: Certificate) -> Certificate:
    """With hashes of what it holds now."""
    body = {key: value for key, value in certificate.items() if key != "sha256"}
    body["study_sha256"] = canonical_sha256(body["study"])
    return body | {"sha256": canonical_sha256(body)}


def written(certificate: Certificate, folder: Path) -> Path:
    path = folder / "certificate.json"
    path.write_text(json.dumps(certificate, indent=1), encoding="utf-8")
    return path
