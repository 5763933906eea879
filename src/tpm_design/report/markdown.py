"""The report as Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from tpm_design.certificates.document import FILE as CERTIFICATE
from tpm_design.evaluation.result import Evaluation
from tpm_design.problem import Goal
from tpm_design.report.certified import certificate_lines
from tpm_design.report.escape import code, code_cell, table, text
from tpm_design.report.figures import DRAWING, FIGURES, Picture
from tpm_design.report.fronts import front_lines
from tpm_design.report.local_optima import optima_lines
from tpm_design.report.readings import AT_BOUND, at_end, limiting, nearest_constraint, readings
from tpm_design.report.reported import Reported
from tpm_design.report.swept import sweep_lines
from tpm_design.report.words import (
    MOST_LISTED,
    asked,
    centre_text,
    gap_text,
    options_text,
    range_text,
    shape_text,
)
from tpm_design.runs.entry import Entry
from tpm_design.runs.folder import DESIGNS, LOG, STUDY, SUMMARY, TABLE
from tpm_design.runs.tables import goal_unit, parameter_columns

NONE = "–"
FILES = (
    (DESIGNS, "the result, with numeric errors"),
    (TABLE, "every evaluation"),
    (LOG, "every evaluation with exact numbers"),
    (CERTIFICATE, "what is proved of the design, with its proof"),
    (STUDY, "the study as resolved"),
    (SUMMARY, "seed, versions, machine"),
)


def report_markdown(reported: Reported, pictures: Sequence[Picture]) -> str:
    """The whole report, figures embedded by relative path."""
    sections = [
        _head(reported),
        _question(reported),
        sweep_lines(reported) if reported.swept else [],
        front_lines(reported),
        _design(reported),
        _figures("Mechanism", [picture for picture in pictures if picture.file == DRAWING]),
        _metrics(reported),
        certificate_lines(reported),
        [] if reported.swept else _limits(reported),
        [] if reported.swept else _optimality(reported),
        [] if reported.swept else optima_lines(reported),
        _evaluated(reported) if reported.swept else _search(reported),
        _figures("Figures", [picture for picture in pictures if picture.file != DRAWING]),
        _caveats(reported),
        _files(reported),
    ]
    return "\n\n".join("\n".join(lines) for lines in sections if lines) + "\n"


def status_text(reported: Reported) -> str:
    """How the run ended; of a run that was cut short, what there is."""
    if reported.finished:
        return str(reported.run.summary.get("status", "The run ended."))
    count = len(reported.run.entries)
    start = f"The run was cut short: {SUMMARY} is missing. "
    if reported.best is None:
        return f"{start}No design was evaluated."
    number = reported.best.number
    if reported.feasible:
        if reported.front:
            return (
                f"{start}Front of {len(reported.front)} designs from the {count} evaluations in the log; "
                f"its knee is number {number}."
            )
        return f"{start}Best feasible design of the {count} evaluations in the log: number {number}."
    return f"{start}None of the {count} designs in the log is feasible; the closest is number {number}."


def _head(reported: Reported) -> list[str]:
    study = reported.study
    return [
        f"# {text(study.name)}: {text(reported.problem.kind.title)}",
        "",
        f"**{text(status_text(reported))}**",
        "",
        f"Run {code(reported.run.folder.resolve().name)}.",
    ]


# ------------------------------------------------------------------------------------- the question


def _question(reported: Reported) -> list[str]:
    problem, units = reported.problem, reported.study.units
    lines = ["## Question", ""]
    for goal in problem.objectives:
        word = "Minimise" if goal.sense == "minimize" else "Maximise"
        lines.append(f"{word} {_goal_text(reported, goal)}.")
    if problem.constraints:
        lines += ["", "Subject to:", ""]
        for goal in problem.constraints:
            bound = text(asked(goal, units, goal_unit(problem, goal)))
            lines.append(f"- {_goal_text(reported, goal, bound)}")
    if problem.record:
        lines += ["", "Recorded besides:", ""]
        lines += [f"- {_goal_text(reported, goal)}" for goal in problem.record]
    if problem.region is None:
        lines += ["", "There is no useful region: figures are measured over the workspace itself."]
    else:
        where = f"{shape_text(problem.region, units)}, {centre_text(problem, units)}"
        lines += ["", f"The useful region is {text(where)}."]
    if not problem.kind.mode_fields:
        return lines
    modes = ", ".join(code(label) for label in problem.modes)
    if len(problem.modes) > MOST_LISTED:
        modes = f"any of {len(problem.modes)}"
    fields = ", ".join(field.name for field in problem.kind.mode_fields)
    lines += ["", f"Working mode ({text(fields)}): {modes}."]
    return lines


def _goal_text(reported: Reported, goal: Goal, bound: str = "") -> str:
    """``label`` [mm] ≥ 20 mm: what it is (options)"""
    unit = _unit_name(reported, goal)
    asked_for = " ".join(part for part in ("" if unit == NONE else f"\\[{unit}\\]", bound) if part)
    options = options_text(goal, reported.study.units)
    name = "" if goal.label == goal.metric.name else f"{code(goal.metric.name)}, "
    after = f" ({text(options)})" if options else ""
    return f"{code(goal.label)} {asked_for}".rstrip() + f": {name}{text(goal.metric.description)}{after}"


def _unit_name(reported: Reported, goal: Goal) -> str:
    """The study's unit of a metric, a dash where it has none."""
    name = reported.study.units.name(goal_unit(reported.problem, goal))
    return NONE if name == "-" else name


# ------------------------------------------------------------------------------------- the answer


def _design(reported: Reported) -> list[str]:
    if reported.best is None:
        return []
    problem, units = reported.problem, reported.study.units
    rows = []
    for column in parameter_columns(problem, units):
        value = reported.best.evaluation.design[column.name]
        parameter = problem.kind.parameter(column.name)
        shown = code_cell(value) if isinstance(value, str) else f"{units.from_si(value, column.unit):.6g}"
        meaning = parameter.description if parameter else _own_meaning(column.name)
        rows.append(
            [
                code_cell(column.name),
                shown,
                NONE if column.unit in {"", "-"} else units.name(column.unit),
                text(range_text(problem, column.name, units)),
                text(meaning),
            ]
        )
    best = "Knee of the front" if reported.front else "Best design"
    word = best if reported.feasible else "Closest design, not feasible"
    headings = ["parameter", "value", "unit", "range", "meaning"]
    return [f"## {word} (number {reported.best.number})", "", *table(headings, rows)]


def _own_meaning(name: str) -> str:
    return "working mode" if name == "mode" else f"{name.removeprefix('center_')} of the region's centre"


def _metrics(reported: Reported) -> list[str]:
    if reported.best is None:
        return []
    evaluation = reported.best.evaluation
    if evaluation.status == "failed":
        return ["## Metrics", "", f"The design could not be evaluated: {text(evaluation.reason)}"]
    problem = reported.problem
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    headings = ["metric", "value", "± numeric error", "unit", "asked", "slack", "met"]
    lines = ["## Metrics", "", *table(headings, [_metric_row(reported, evaluation, goal) for goal in goals])]
    lines += [
        "",
        "Slack is the distance to the bound after the numeric error is taken off; where a metric is flat "
        "(coverage of 1, a region that is singular) it is the metric's worst margin instead.",
    ]
    notes = [f"- {code(name)}: {text(note)}" for name, note in evaluation.notes.items()]
    return [*lines, "", *notes] if notes else lines


def _metric_row(reported: Reported, evaluation: Evaluation, goal: Goal) -> list[str]:
    units = reported.study.units
    unit = goal_unit(reported.problem, goal)

    def shown(value: float, digits: int) -> str:
        return f"{units.from_si(value, unit):.{digits}g}" if math.isfinite(value) else NONE

    value = evaluation.metrics.get(goal.label, math.nan)
    error = evaluation.errors.get(goal.label, math.nan) if math.isfinite(value) else math.nan
    slack = evaluation.slacks.get(goal.label)
    return [
        code_cell(goal.label),
        shown(value, 6),
        shown(error, 2),
        _unit_name(reported, goal),
        text(asked(goal, units, unit)),
        NONE if slack is None or not math.isfinite(value) else shown(slack, 3),
        NONE if slack is None else ("yes" if slack >= 0.0 else "**no**"),
    ]


def _limits(reported: Reported) -> list[str]:
    if reported.best is None or reported.best.evaluation.status == "failed":
        return []
    if not reported.feasible:
        return ["## What is missing", "", *_missing(reported, reported.best.evaluation)]
    lines = ["## What limits the design", ""]
    tight = limiting(reported.problem, reported.best)
    ends = at_end(reported.problem, reported.best.evaluation)
    if tight:
        lines.append(
            f"Binding constraints (within {100.0 * AT_BOUND:g} % of their metric's scale): {_names(tight)}."
        )
    if ends:
        lines.append(f"Quantities at an end of their range: {', '.join(code(v.name) for v in ends)}.")
    if not tight and not ends:
        nearest = nearest_constraint(reported.problem, reported.best)
        lines.append(
            "Nothing binds: no constraint is at its bound and no quantity at an end of its range."
            if nearest is None
            else f"Nothing binds: the nearest constraint is {code(nearest.goal.label)}."
            if reported.front
            else f"Nothing binds yet: the nearest constraint is {code(nearest.goal.label)}. "
            "A larger budget may find a better design."
        )
    return lines


def _optimality(reported: Reported) -> list[str]:
    bound = reported.run.summary.get("bound")
    if not isinstance(bound, dict) or not isinstance(bound.get("least"), float):
        return []
    least, gap = reported.study.units.written(bound["least"], "m"), bound.get("gap")
    words = gap_text(str(bound.get("objective")), least, gap if isinstance(gap, float) else None)
    return [
        "## How far from the optimum",
        "",
        text(words),
        "",
        "The bound is the optimum of a convex relaxation: outer reach over the whole region, octant, ranges "
        "and ties; inner reach, elbows, singularities and other constraints can only lengthen the links.",
    ]


def _missing(reported: Reported, evaluation: Evaluation) -> Iterable[str]:
    units = reported.study.units
    yield f"No feasible design was found. The closest has a violation of {evaluation.violation:.3g}:"
    yield ""
    for reading in readings(reported.problem, evaluation):
        if not reading.met:
            unit = goal_unit(reported.problem, reading.goal)
            found = "it has no value"
            if math.isfinite(reading.value):
                shortfall = units.written(-reading.slack, unit, 3)
                found = f"it is {units.written(reading.value, unit)}, missed by {shortfall}"
            yield f"- {code(reading.goal.label)} {text(f'{asked(reading.goal, units, unit)}: {found}')}"
    if evaluation.reason:
        yield ""
        yield f"Reason noted by the evaluation: {text(evaluation.reason)}."


def _names(goals: Iterable[Goal]) -> str:
    return ", ".join(code(goal.label) for goal in goals)


# ------------------------------------------------------------------------------------- how it was found


def _search(reported: Reported) -> list[str]:
    summary, settings, entries = reported.run.summary, reported.study.optimizer, reported.run.entries
    polish = f", polished by {code(settings.polish)}" if settings.polish else ""
    feasible = sum(entry.evaluation.status == "feasible" for entry in entries)
    failed = sum(entry.evaluation.status == "failed" for entry in entries)
    ended_early = sum(entry.evaluation.status == "aborted" for entry in entries)
    aborted = f", {ended_early} ended early, sure to be worse than others" if ended_early else ""
    lines = [
        "## How it was found",
        "",
        f"- method: {code(settings.method)}{polish}",
        f"- seed {settings.seed}, budget {settings.budget} evaluations",
        f"- {len(entries)} evaluations: {feasible} feasible, {failed} failed{aborted}",
        *_rounds(entries),
        f"- {_time(reported)}",
    ]
    lines += [f"- {words}" for words in _provenance(summary)]
    lines += [f"- {text(str(remark))}" for remark in summary.get("remarks") or ()]
    return lines


def _evaluated(reported: Reported) -> list[str]:
    lines = ["## How it was evaluated", "", f"- {_time(reported)}"]
    return lines + [f"- {words}" for words in _provenance(reported.run.summary)]


def _time(reported: Reported) -> str:
    wall, resumed = reported.run.summary.get("seconds"), reported.run.summary.get("resumed_after")
    seconds = sum(entry.evaluation.seconds for entry in reported.run.entries)
    if isinstance(resumed, int):
        return f"{seconds:.3g} s evaluating (summed over workers); resumed after {resumed} evaluations"
    if isinstance(wall, int | float) and math.isfinite(wall):
        return f"{wall:.3g} s wall time, {seconds:.3g} s of it evaluating (summed over workers)"
    return f"{seconds:.3g} s evaluating (summed over workers); the wall time is not known"


def _rounds(entries: Sequence[Entry]) -> Iterable[str]:
    rounds = max((entry.round for entry in entries), default=1)
    if rounds > 1:
        yield (
            f"- {rounds} rounds: what broke the best design of one (a machine within the tolerances, a pose) "
            "had to be met in the next; the slacks above are the least of these too"
        )


def _provenance(summary: Any) -> Iterable[str]:
    versions, machine = summary.get("versions"), summary.get("machine")
    if isinstance(versions, dict):
        yield text("versions: " + ", ".join(f"{name} {value}" for name, value in versions.items()))
    if isinstance(machine, dict):
        yield text("machine: " + ", ".join(f"{name} {value}" for name, value in machine.items()))


def _figures(heading: str, pictures: Sequence[Picture]) -> list[str]:
    lines = [f"## {heading}"] if pictures else []
    for picture in pictures:
        finding = text(picture.finding)
        lines += ["", f"![{finding}]({FIGURES}/{picture.file})", "", f"*{finding}.* {picture.caption}"]
    return lines


def _caveats(reported: Reported) -> list[str]:
    beyond = " beyond what is said above" if certificate_lines(reported) else ""
    return [
        "## Caveats",
        "",
        "- Distances to singularities and least values over the region are found by search (a lattice and "
        f"local refinement); they are not proved{beyond}.",
        "- The numeric errors are estimates: the change between two resolutions. A constraint counts as met "
        "only on the unfavourable side of its error.",
        f"- Volumes and averages aim at a relative error of {reported.problem.accuracy.volume:g}; the "
        f"region is sampled at {reported.problem.accuracy.region_samples} poses along its longest edge.",
        f"- The {'front holds the best designs' if reported.front else 'best design is the best one'} "
        "evaluated; no claim is made that none is better.",
        "- Axes are taken as exact and links as rigid.",
    ]


def _files(reported: Reported) -> list[str]:
    present = [(name, what) for name, what in FILES if (reported.run.folder / name).is_file()]
    plug_in = reported.study.plug_in
    if plug_in is not None:
        present.append((plug_in.name, "the mechanism's formulas, the user's own"))
    return ["## Files", "", *(f"- [{name}]({name}): {what}" for name, what in present)]
