"""The command that finds the largest body in the singularity-free region of one design."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tpm_design.certificates.document import FILE, document, write_document
from tpm_design.cli.certify import NOTHING_ASKED, verdict_text
from tpm_design.cli.commands import chosen_design, worker_threads
from tpm_design.cli.guard import NOT_PROVED, NOTHING_FEASIBLE, complain
from tpm_design.cli.results import design_rows, error_text
from tpm_design.cli.text import table
from tpm_design.errors import UsageError
from tpm_design.evaluation.contexts import design_context
from tpm_design.problem import CENTRE, Design, Problem
from tpm_design.report.words import lengths_text
from tpm_design.study import Study
from tpm_design.study.inscribed import region_of, study_of
from tpm_design.study.plain import dump_yaml
from tpm_design.synthesis.inscribed import InscribedBody, largest_body
from tpm_design.synthesis.inscribed_proof import ProvedBody, proved_body
from tpm_design.units import Units

# digits of lengths, as many as are told of a region
DIGITS = 10
LARGEST_GAP = 1.0


def inscribe_one(
    path: Path,
    settings: Sequence[str],
    body: str,
    margin: float,
    proportions: str | None,
    certify: bool,
    output: Path | None,
    workers: int | None,
    *,
    allow_code: bool,
    as_json: bool,
    quiet: bool,
) -> int | None:
    threads = worker_threads(workers)
    shares = None if proportions is None else _proportions(proportions)
    if output is not None and not certify:
        raise UsageError(
            "Without a proof there is no certificate.", where="--output", remedy="Add --certify."
        )
    if not (math.isfinite(margin) and 0.0 <= margin < 1.0):
        raise UsageError(
            f"{margin:g} is no margin.", where="--margin", remedy="Choose a number from 0, less than 1."
        )
    study, design, assumptions = chosen_design(path, settings, allow_code=allow_code)
    context = design_context(study.problem, design)
    told = not (quiet or as_json)
    # where the study's region lies plays no part
    assumed = [line for line in assumptions if not line.startswith(CENTRE)]
    if told and assumed:
        print("Assumed: " + "; ".join(assumed) + ".\n")
    if told:
        print("Searching; the equations are compiled on first use, for up to a minute.", file=sys.stderr)
    found = largest_body(
        context.mechanism,
        context.mode,
        body,
        margin=margin,
        proportions=shares,
        near=None if context.region is None else context.region.centre,
    )
    if found is None:
        complain(
            f"No {body} fits: the mode has no singularity-free region with margins of at least {margin:g}.\n"
            "  Ask for a smaller --margin, or for another mode or other dimensions with --set."
        )
        return NOTHING_FEASIBLE
    proof, target = None, output or Path(FILE)
    if certify:
        proof = _proved(study, design, found, threads)
        asked, _ = study_of(study, design, proof.body)
        write_document(target, document(asked.problem, asked.resolved(), asked.study_hash, proof.verdict))
    if as_json:
        data = _data(study, found, proof)
        print(json.dumps(data | ({"certificate": str(target)} if proof else {}), ensure_ascii=False))
    else:
        if told:
            rows = [
                row
                for row in design_rows(study.problem, study.units, design)
                if not row[0].startswith(CENTRE)
            ]
            print(table(["design", "value", "searched in"], rows))
            print()
        print(_text(study, found, proof))
        if proof is not None:
            print(f"\nCertificate: {target}")
    return None if proof is None or proof.proved else NOT_PROVED


def _proved(study: Study, design: Design, found: InscribedBody, workers: int) -> ProvedBody:
    def stated(body: InscribedBody) -> tuple[Problem, Design]:
        asked, placed = study_of(study, design, body)
        return asked.problem, placed

    boxes = (study.certification or NOTHING_ASKED).boxes
    return proved_body(found, stated, boxes=boxes, workers=workers)


def _proportions(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise UsageError(
            f"{text!r} are no proportions.",
            where="--proportions",
            remedy="Write the sizes along x, y and z in any unit, such as 1,1,0.5.",
        ) from None


def _sizes(body: InscribedBody) -> list[tuple[str, float, float]]:
    """Name, value (m) and by how much (m) it can grow at most while the others stay."""
    half, growths = body.form.half(body.sizes).tolist(), body.growths
    each = growths if len(growths) > 1 else growths * 3
    if body.form.name == "sphere":
        names, values = ["radius"], half[:1]
    elif body.form.name == "cylinder":
        names, values = ["radius", "height"], [half[0], 2.0 * half[2]]
    elif body.form.name == "ellipsoid":
        names, values = ["semi-axis x", "semi-axis y", "semi-axis z"], half
    else:
        names, values = ["size x", "size y", "size z"], [2.0 * value for value in half]
    return [(name, v, growth * v) for name, v, growth in zip(names, values, each, strict=False)]


def _text(study: Study, found: InscribedBody, proof: ProvedBody | None) -> str:
    units, body = study.units, found if proof is None else proof.body
    rows = [
        [name, units.written(value, "m", DIGITS), f"< {units.written(growth, 'm', 2)}"]
        for name, value, growth in _sizes(body)
    ]
    rows.append(["center", _centre_text(body, units), ""])
    rows.append(["volume", units.written(body.volume, "m³", DIGITS), ""])
    margins = [
        [
            name,
            units.written(one.value, one.unit),
            f"± {error_text(units, one.error, one.unit)}",
            f"≥ {units.written(one.asked, one.unit)}",
        ]
        for name, one in body.margins.items()
    ]
    parts = [
        table([f"largest {body.form.name}", "value", "can grow alone by"], rows),
        table(["margin over it", "least value", "numeric error", "asked"], margins),
        _verified(study, found, proof),
        dump_yaml({"region": region_of(body, units)}).rstrip(),
    ]
    return "\n\n".join(parts)


def _centre_text(body: InscribedBody, units: Units) -> str:
    numbers = ", ".join(f"{units.from_si(value, 'm'):.{DIGITS}g}" for value in body.centre)
    return f"({numbers}) {units.name('m')}"


def _verified(study: Study, found: InscribedBody, proof: ProvedBody | None) -> str:
    form = found.form.name
    if found.gap is not None and found.gap < LARGEST_GAP:
        gap = (
            f"The largest {form} between the planes that touch the region where this one does is larger by "
            f"{100.0 * max(found.gap, 1e-8):.2g} % of the volume: next to nothing at a local optimum."
        )
    else:
        gap = (
            f"How near it is to a local optimum is not known: the planes where it touches bound no {form} "
            "of its size."
        )
    if proof is None:
        return f"Sampled, not proved: the least margins were found by a search. --certify proves.\n{gap}"
    if not proof.proved:
        return f"{verdict_text(study, proof.verdict)}\n{gap}"
    effort = f"{proof.verdict.boxes} boxes, {proof.verdict.seconds:.2g} s"
    return (
        f"Proved at every pose of the body, for exact dimensions ({effort}). Its sizes are "
        f"{100.0 * proof.share:g} % less than those of the largest that was found by sampling, "
        f"{lengths_text([value for _, value, _ in _sizes(found)], study.units)}.\n{gap}"
    )


def _data(study: Study, found: InscribedBody, proof: ProvedBody | None) -> dict[str, Any]:
    units, body = study.units, found if proof is None else proof.body
    length = units.name("m")
    data: dict[str, Any] = {
        "study": study.name,
        "body": body.form.name,
        "verified": "sampled" if proof is None else proof.verdict.outcome,
        "region": region_of(body, units),
        "sizes": {
            name: {"value": units.from_si(value, "m"), "growth": units.from_si(growth, "m"), "unit": length}
            for name, value, growth in _sizes(body)
        },
        "center": {"value": [units.from_si(value, "m") for value in body.centre], "unit": length},
        "volume": {"value": units.from_si(body.volume, "m³"), "unit": units.name("m³"), "gap": found.gap},
        "margins": {
            name: {
                "value": units.from_si(one.value, one.unit),
                "error": units.from_si(one.error, one.unit),
                "asked": units.from_si(one.asked, one.unit),
                "unit": units.name(one.unit),
            }
            for name, one in body.margins.items()
        },
    }
    if proof is not None:
        data |= {
            "shrunk": proof.share,
            "largest_found": region_of(found, units),
            "boxes": proof.verdict.boxes,
            "seconds": round(proof.verdict.seconds, 3),
        }
    return data
