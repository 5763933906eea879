"""What was proved of the reported design, read from the run's certificate."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from tpm_design.certificates.document import FILE
from tpm_design.digests import canonical_sha256
from tpm_design.report.escape import code, code_cell, table, text
from tpm_design.report.reported import Reported, best_context
from tpm_design.report.words import asked, machines_text, pose_text
from tpm_design.runs.tables import goal_unit

SENTENCES = {
    "proved": "Proved over the whole region",
    "refuted": "Refuted: at least one requirement is broken",
    "undecided": "Not proved",
}


def certificate_lines(reported: Reported) -> list[str]:
    """A section on the certificate; empty where the run has none, or one of another design."""
    data = _certificate(reported)
    if data is None:
        return []
    if not _unaltered(data):
        return ["## What is proved", "", f"{FILE} was altered: nothing is claimed from it.", ""]
    rows = []
    stored = {str(one["label"]): one for one in data["requirements"]}
    for goal in reported.problem.constraints:
        one = stored.get(goal.label)
        if one is None:
            continue
        unit = goal_unit(reported.problem, goal)
        slack = one["slack"]
        spare = "–" if slack is None else text(reported.study.units.written(float(slack), unit, 3))
        bound = text(asked(goal, reported.study.units, unit))
        rows.append([code_cell(goal.label), bound, text(str(one["outcome"])), spare, _why(reported, one)])
    headings = ["requirement", "asked", "outcome", "proved to spare", "why"]
    outcome = str(data["outcome"])
    machines = machines_text(reported.problem.kind, data["tolerance"], reported.study.units)
    sentence = f"{SENTENCES[outcome]}, {machines}."
    if outcome == "refuted":
        sentence = f"{SENTENCES[outcome]} by {machines.removeprefix('for ').replace('every', 'a', 1)}."
    lines = ["## What is proved", "", text(sentence), "", *table(headings, rows), ""]
    if reported.study.plug_in is not None:
        return [
            *lines,
            f"By the formulas of {code(reported.study.plug_in.name)}; no second implementation "
            "of them can check the proof.",
        ]
    return [*lines, f"[{FILE}]({FILE}) can be checked again: {code(f'tpm-design certify --check {FILE}')}."]


def _certificate(reported: Reported) -> Mapping[str, Any] | None:
    path = reported.run.folder / FILE
    if reported.best is None or not path.is_file():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        return None
    if not isinstance(data, dict) or data.get("design") != dict(reported.best.evaluation.design):
        return None
    return data


def _unaltered(data: Mapping[str, Any]) -> bool:
    """Whether the contents have the hash that they carry."""
    contents = {name: value for name, value in data.items() if name != "sha256"}
    return canonical_sha256(contents) == data.get("sha256")


def _why(reported: Reported, one: Mapping[str, Any]) -> str:
    breaking = one["breaking"]
    if breaking is None or breaking["pose"] is None:
        return text(str(one["reason"]))
    context = best_context(reported)
    if context is None:
        return text(str(one["reason"]))
    pose = context.mechanism.poses(np.array([breaking["pose"]]))[0]
    at = pose_text(reported.problem.kind, pose.tolist(), reported.study.units)
    return text(f"broken at {at}: {one['reason']}")
