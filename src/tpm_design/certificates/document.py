"""certificate.json: what was proved, and enough to prove it again by other means.

The file holds the study, the machine, its tolerances, the region, every statement with the boxes of its
proof, and which statements each requirement needs. Lengths in metres, angles in radians.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tpm_design.certificates.settlement import Settlement, breaking_data
from tpm_design.certificates.verdict import Requirement, Verdict
from tpm_design.digests import canonical_sha256
from tpm_design.errors import UsageError, unwritable
from tpm_design.problem import Problem
from tpm_design.workspace.region_geometry import BOX, CYLINDER, POINTS, PlacedRegion

FORMAT = 1
FILE = "certificate.json"
LIBRARIES = ("tpm-design", "numpy", "numba")
ASSUMPTIONS = (
    "axis directions are exact: the tolerances are on lengths and ratios, of each limb by itself, and "
    "misaligned axes are not covered",
)


def document(problem: Problem, study: Mapping[str, Any], study_hash: str, verdict: Verdict) -> dict[str, Any]:
    """The certificate as plain data, its own hash included. ``study``: the resolved study."""
    mechanism = verdict.context.mechanism
    data: dict[str, Any] = {
        "format": FORMAT,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}},
        "study": dict(study),
        "study_sha256": study_hash,
        "design": dict(verdict.design),
        "machine": {
            "type": mechanism.kind.name,
            "parameters": {name: list(values) for name, values in mechanism.parameters.items()},
            "limits": {
                name: list(value) if isinstance(value, list | tuple) else value
                for name, value in problem.limits.items()
            },
        },
        "mode": dict(problem.modes[str(verdict.design["mode"])]),
        "tolerance": dict(verdict.tolerance),
        "assumptions": list(ASSUMPTIONS),
        "region": None if verdict.context.region is None else region_data(verdict.context.region),
        "statements": [statement_data(settlement) for settlement in verdict.settlements],
        "requirements": [requirement_data(requirement) for requirement in verdict.requirements],
        "outcome": verdict.outcome,
    }
    # what was computed must be what is read back
    data = dict(json.loads(json.dumps(data, ensure_ascii=False, allow_nan=False)))
    return data | {"sha256": canonical_sha256(data)}


def region_data(region: PlacedRegion) -> dict[str, Any]:
    """A placed region as a certificate writes it."""
    if region.form == POINTS:
        return {"form": "points", "points": region.points.tolist()}
    form = {BOX: "box", CYLINDER: "cylinder"}.get(region.form, "ellipsoid")
    return {"form": form, "centre": list(region.centre), "half": list(region.half)}


def statement_data(settlement: Settlement) -> dict[str, Any]:
    """One statement with the covers of its proof."""
    covers = [
        {"root": [list(side) for side in cover.root], "tree": cover.tree} for cover in settlement.covers
    ]
    return settlement.demand.data(settlement.level) | {
        "outcome": settlement.outcome,
        "reason": settlement.reason,
        "open_box": None if settlement.open_box is None else [list(side) for side in settlement.open_box],
        "covers": covers,
    }


def requirement_data(requirement: Requirement) -> dict[str, Any]:
    """One requirement with the numbers of its statements."""
    goal = requirement.goal
    return {
        "label": goal.label,
        "metric": goal.metric.name,
        "options": {name: _plain(value) for name, value in goal.options.items()},
        "min": goal.minimum,
        "max": goal.maximum,
        "outcome": requirement.outcome,
        "slack": requirement.slack,
        "statements": list(requirement.settlements),
        "breaking": breaking_data(requirement.breaking),
        "reason": requirement.reason,
    }


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def check_place(path: Path) -> None:
    """Raises UsageError where there can be no certificate: to be asked before a long proof."""
    if not path.name or path.is_dir():
        raise UsageError(
            "The certificate needs a file name.", where=str(path), remedy="Write --output certificate.json."
        )
    if not path.absolute().parent.is_dir():
        raise UsageError(
            f"The certificate cannot be written: there is no folder {path.parent}.",
            where=str(path),
            remedy="Choose another place with --output.",
        )


def write_document(path: Path, data: Mapping[str, Any]) -> None:
    """Write a certificate, whole or not at all. Raises UsageError where it cannot be written."""
    check_place(path)
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        os.replace(part, path)
    except OSError as error:
        raise unwritable(
            "The certificate cannot be written", error, path, "Choose another place with --output."
        ) from None
