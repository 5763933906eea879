"""The command that proves, and the one that checks a proof."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tpm_design.certificates.document import FILE, check_place, document, write_document
from tpm_design.certificates.tolerances import LargestTolerance, largest_tolerance
from tpm_design.certificates.verdict import Requirement, Verdict, verdict
from tpm_design.checker import Progress, check_certificate
from tpm_design.cli.commands import chosen_design, worker_threads
from tpm_design.cli.guard import NOT_PROVED, complain
from tpm_design.cli.progress import SECONDS_BETWEEN_LINES
from tpm_design.cli.results import design_rows
from tpm_design.cli.text import table
from tpm_design.errors import UsageError
from tpm_design.problem import Design
from tpm_design.report.words import asked, machines_text, pose_text, pose_unit_names, tolerances_text
from tpm_design.runs.tables import goal_unit, parameter_unit
from tpm_design.study import Study
from tpm_design.study.study import Certification

NOTHING_ASKED = Certification({}, 400_000)


def certify_one(
    path: Path | None,
    settings: Sequence[str],
    max_tolerance: bool,
    check: Path | None,
    output: Path | None,
    workers: int | None,
    *,
    allow_code: bool,
    as_json: bool,
    quiet: bool,
) -> int | None:
    threads = worker_threads(workers)
    if check is not None:
        if path is not None or settings or max_tolerance or output is not None or allow_code:
            raise UsageError(
                "--check stands alone.", where="certify", remedy="Write `tpm-design certify --check FILE`."
            )
        return _check(check, threads, as_json=as_json, quiet=quiet)
    if path is None:
        raise UsageError(
            "Nothing to certify.", where="certify", remedy="Name a study, a run folder, or --check FILE."
        )
    study, design, assumptions = chosen_design(path, settings, allow_code=allow_code)
    if not study.problem.constraints:
        raise UsageError(
            "The study has no constraints, so that there is nothing to prove.",
            where=str(path),
            remedy="Add `constraints:`, such as {metric: coverage, min: 1}.",
        )
    if assumptions and not quiet and not as_json:
        print("Assumed: " + "; ".join(assumptions) + ".\n")
    if max_tolerance:
        return _largest(study, design, threads, as_json=as_json, quiet=quiet)
    target = output or (path / FILE if path.is_dir() and not settings else Path(FILE))
    check_place(target)
    asked_for = study.certification or NOTHING_ASKED
    if not (quiet or as_json):
        print("Proving; the equations are compiled on first use, for up to a minute.", file=sys.stderr)
    found = verdict(study.problem, design, asked_for.tolerance, boxes=asked_for.boxes, workers=threads)
    write_document(target, document(study.problem, study.resolved(), study.study_hash, found))
    if as_json:
        print(json.dumps(verdict_data(study, found) | {"certificate": str(target)}, ensure_ascii=False))
    else:
        if not quiet:
            print(
                table(["design", "value", "searched in"], design_rows(study.problem, study.units, design))
                + "\n"
            )
        print(verdict_text(study, found))
        print(f"Certificate: {target}\n{_next(study, target)}")
    return None if found.outcome == "proved" else NOT_PROVED


def _next(study: Study, target: Path) -> str:
    if study.plug_in is not None:
        return f"It rests on the formulas of {study.plug_in.name}: no second implementation can check it."
    return f"Next: tpm-design certify --check {target}"


def verdict_text(study: Study, found: Verdict) -> str:
    """A verdict as a table and one sentence, in the study's units."""
    rows = [_requirement_row(study, found, requirement) for requirement in found.requirements]
    heads = ["requirement", "asked", "verdict", "proved to spare", "worst found", "why"]
    effort = f"{found.boxes} boxes, {found.seconds:.2g} s"
    sentences = {
        "proved": f"Proved {_scope(study, found)} ({effort}).",
        "refuted": f"Refuted: at least one requirement is broken by {_culprit(study, found)} ({effort}).",
        "undecided": f"Not proved {_scope(study, found)} ({effort}).",
    }
    return f"{table(heads, rows)}\n\n{sentences[found.outcome]}"


def _scope(study: Study, found: Verdict) -> str:
    where = "at every pose of the region" if found.context.region is not None else "for the design"
    return f"{where}, {machines_text(study.problem.kind, found.tolerance, study.units)}"


def _culprit(study: Study, found: Verdict) -> str:
    tolerances = tolerances_text(study.problem.kind, found.tolerance, study.units)
    if not tolerances:
        return "the exact dimensions"
    return f"a machine within {tolerances} (each limb by itself, axis directions exact)"


def _user_pose(found: Verdict, coordinates: Sequence[float]) -> list[float]:
    """A pose as users write it (SI)."""
    values = found.context.mechanism.poses(np.array([coordinates]))[0]
    return [float(value) for value in values]


def _pose_text(study: Study, found: Verdict, coordinates: Sequence[float]) -> str:
    return pose_text(study.problem.kind, _user_pose(found, coordinates), study.units)


def _machine_text(study: Study, found: Verdict, parameters: Mapping[str, tuple[float, ...]]) -> str:
    """The dimensions in which a machine differs from the design: `` with f1 = 250.1 mm, …``."""
    parts = []
    for name, values in parameters.items():
        unit = parameter_unit(study.problem.kind, name)
        nominal = found.context.mechanism.parameters[name]
        for limb, (value, exact) in enumerate(zip(values, nominal, strict=True), start=1):
            if value != exact:
                parts.append(f"{name}{limb} = {study.units.written(value, unit)}")
    return f" with {', '.join(parts)}" if parts else ""


def _requirement_row(study: Study, found: Verdict, requirement: Requirement) -> list[str]:
    goal = requirement.goal
    unit = goal_unit(study.problem, goal)
    spare = "" if requirement.slack is None else study.units.written(requirement.slack, unit, digits=3)
    why = requirement.reason
    if requirement.breaking is not None and requirement.breaking.pose is not None:
        machine = _machine_text(study, found, requirement.breaking.parameters)
        why = f"broken at {_pose_text(study, found, requirement.breaking.pose)}{machine}: {why}"
    if requirement.open_box is not None:
        middle = [0.5 * (low + high) for low, high in requirement.open_box]
        why = f"not proved around {_pose_text(study, found, middle)}: {why}"
    return [
        goal.label,
        asked(goal, study.units, unit),
        requirement.outcome,
        spare,
        _worst(study, requirement),
        why,
    ]


def _worst(study: Study, requirement: Requirement) -> str:
    """The worst value that a search found, at the worst machine within tolerance."""
    if requirement.worst is None:
        return ""
    if not math.isfinite(requirement.worst):
        return "no locus"
    return study.units.written(requirement.worst, goal_unit(study.problem, requirement.goal))


def verdict_data(study: Study, found: Verdict) -> dict[str, Any]:
    """A verdict for --json, in the study's units."""
    requirements = {}
    for requirement in found.requirements:
        unit = goal_unit(study.problem, requirement.goal)
        data: dict[str, Any] = {
            "outcome": requirement.outcome,
            "reason": requirement.reason,
            "unit": study.units.name(unit),
        }
        if requirement.slack is not None:
            data["slack"] = study.units.from_si(requirement.slack, unit)
        if requirement.worst is not None and math.isfinite(requirement.worst):
            data["worst_found"] = study.units.from_si(requirement.worst, unit)
        if requirement.breaking is not None and requirement.breaking.pose is not None:
            pose = _user_pose(found, requirement.breaking.pose)
            kind = study.problem.kind
            data["pose"] = [study.units.from_si(v, u) for v, u in zip(pose, kind.pose_units, strict=True)]
            data["pose_unit"] = pose_unit_names(kind, study.units)
        requirements[requirement.goal.label] = data
    return {
        "study": study.name,
        "outcome": found.outcome,
        "requirements": requirements,
        "boxes": found.boxes,
        "seconds": round(found.seconds, 3),
    }


def _largest(study: Study, design: Design, workers: int, *, as_json: bool, quiet: bool) -> int | None:
    asked_for = study.certification or NOTHING_ASKED
    if not any(bound > 0.0 for bound in asked_for.tolerance.values()):
        raise UsageError(
            "The study names no tolerances to scale.",
            where="certify.tolerance",
            remedy="Add one, such as certify: {tolerance: {f: 0.1}}, ± in the study's units.",
        )

    def watch(factor: float, outcome: str) -> None:
        if not (quiet or as_json):
            complain(f"tolerances times {factor:.4g}: {outcome}")

    found = largest_tolerance(
        study.problem, design, asked_for.tolerance, boxes=asked_for.boxes, workers=workers, watch=watch
    )
    if as_json:
        print(json.dumps(_largest_data(study, asked_for, found), ensure_ascii=False))
    else:
        print(_largest_text(study, asked_for, found))
    return None if found.factor >= 1.0 else NOT_PROVED


def _scaled(study: Study, asked_for: Certification, factor: float) -> dict[str, tuple[float, str]]:
    """Tolerances times a factor: name → value and unit as the study writes them."""
    scaled = {}
    for name, bound in asked_for.tolerance.items():
        unit = parameter_unit(study.problem.kind, name)
        scaled[name] = (study.units.from_si(factor * bound, unit), study.units.name(unit))
    return scaled


def _largest_text(study: Study, asked_for: Certification, found: LargestTolerance) -> str:
    if found.factor == 0.0:
        return (
            "No tolerance can be proved; `certify` without --max-tolerance names the requirement that fails."
        )
    proved = ", ".join(
        f"{name} ± {value:.4g} {unit}".removesuffix(" -")
        for name, (value, unit) in _scaled(study, asked_for, found.factor).items()
    )
    limit = (
        "nothing larger was tried"
        if found.failed is None
        else f"at {found.failed:.4g} times they are {found.outcome}"
    )
    return f"Largest tolerances proved: {proved} ({found.factor:.4g} times the study's; {limit})."


def _largest_data(study: Study, asked_for: Certification, found: LargestTolerance) -> dict[str, Any]:
    scaled = _scaled(study, asked_for, found.factor)
    return {
        "study": study.name,
        "factor": found.factor,
        "failed_factor": found.failed,
        "outcome_there": found.outcome,
        "tolerance": {name: {"value": value, "unit": unit} for name, (value, unit) in scaled.items()},
    }


def _check(path: Path, workers: int, *, as_json: bool, quiet: bool) -> int | None:
    found = check_certificate(path, workers=workers, watch=_silent if as_json or quiet else _told_at_times())
    if as_json:
        print(
            json.dumps(
                {"certificate": str(path), "valid": found.valid, "faults": list(found.faults),
                 "outcome": _claimed(path) if found.valid else None,
                 "leaves": found.leaves, "seconds": round(found.seconds, 3)},
                ensure_ascii=False,
            )
        )  # fmt: skip
    else:
        for fault in found.faults:
            print(fault)
        word = "Valid" if found.valid else "REJECTED"
        claim = f' It says "{_claimed(path)}".' if found.valid else ""
        print(f"{word}: {found.leaves} boxes checked in {found.seconds:.3g} s.{claim}")
    return None if found.valid else NOT_PROVED


def _claimed(path: Path) -> str:
    """The outcome that a certificate states."""
    return str(json.loads(path.read_text(encoding="utf-8"))["outcome"])


def _silent(_: Progress) -> None:
    """Tells nothing."""


def _told_at_times() -> Callable[[Progress], None]:
    """Tells the progress of a check, on standard error, every few seconds."""
    began = last = time.monotonic()

    def watch(progress: Progress) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= SECONDS_BETWEEN_LINES:
            last = now
            left = (now - began) * (progress.total - progress.done) / progress.done
            complain(f"{progress.done} of {progress.total} boxes checked, some {left:.0f} s left")

    return watch
