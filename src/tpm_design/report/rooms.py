"""Figure: how much room every constraint leaves to its bound."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter

from tpm_design.problem import Problem
from tpm_design.report.readings import Reading, readings
from tpm_design.report.reported import Reported
from tpm_design.report.style import (
    BLUE,
    INK,
    ORANGE,
    SMALL,
    TEXT,
    VERMILLION,
    new_figure,
    plain,
    tidy,
    title,
    wrapped,
)
from tpm_design.report.words import asked
from tpm_design.runs.tables import goal_unit
from tpm_design.units import Units

FULL = 1.0
"""Room of the whole bound fills the axis; more is cut there and marked."""

SHORTEST = 0.1


def rooms_figure(reported: Reported) -> Figure | None:
    """None without constraints, or without a design that could be measured."""
    if reported.best is None:
        return None
    rows = readings(reported.problem, reported.best.evaluation)
    if not rows:
        return None
    figure = new_figure(8.2, 1.7 + 0.62 * len(rows), "constrained")
    axes = figure.subplots()
    low, high = _limits(rows)
    for place, row in enumerate(rows):
        share = row.share if math.isfinite(row.value) else 0.0
        colour, length = _colour(row), max(low, min(high, share))
        axes.barh(place, length, height=0.5, color=colour)
        if abs(length) < 0.01 * (high - low):  # too short for a bar
            axes.plot([length], [place], marker="o", color=colour, markersize=9, clip_on=False, zorder=3)
        if length != share:  # the bar goes on
            inside = length - math.copysign(0.015 * (high - low), length)
            marker = ">" if length > 0.0 else "<"
            axes.plot([inside], [place], marker=marker, color="white", markersize=8, zorder=3)
        axes.annotate(
            plain(_reading_text(row, reported.problem, reported.study.units)),
            (1.03, place), xycoords=("axes fraction", "data"), va="center", fontsize=SMALL, color=INK,
            annotation_clip=False,
        )  # fmt: skip
    axes.axvline(0.0, color=INK, linewidth=1.2)
    axes.set_xlim(low, high)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_yticks(range(len(rows)), [_row_name(row, reported) for row in rows])
    axes.xaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100.0 * share:.6g} %"))
    axes.set_xlabel("room to the bound, as a share of the bound (0: at the bound)", fontsize=TEXT)
    axes.grid(axis="x", color="#DDDDDD", linewidth=0.8)
    axes.set_axisbelow(True)
    tidy(axes)
    axes.tick_params(axis="y", length=0, pad=9)
    figure.legend(handles=_keys(rows), loc="outside lower center", ncols=3, frameon=False, fontsize=SMALL)
    title(figure, rooms_finding(reported))
    return figure


def _colour(row: Reading) -> str:
    if not row.met:
        return VERMILLION
    return ORANGE if row.binding else BLUE


def _limits(rows: Sequence[Reading]) -> tuple[float, float]:
    """Ends of the axis: what the shares need, at most the whole bound on either side."""
    shares = [row.share for row in rows if math.isfinite(row.value)]
    low, high = max(-FULL, 1.1 * min([0.0, *shares])), min(FULL, 1.1 * max([0.0, *shares]))
    return low, max(high, SHORTEST if low > -SHORTEST else 0.0)


def _keys(rows: Sequence[Reading]) -> list[Patch]:
    texts = {BLUE: "met with room", ORANGE: "binding: within 1 % of its scale", VERMILLION: "missed"}
    present = {_colour(row) for row in rows}
    return [Patch(color=colour, label=text) for colour, text in texts.items() if colour in present]


def _row_name(row: Reading, reported: Reported) -> str:
    name = wrapped(row.goal.label, 34)
    return f"{name}\n{plain(asked(row.goal, reported.study.units, goal_unit(reported.problem, row.goal)))}"


def _reading_text(row: Reading, problem: Problem, units: Units) -> str:
    unit = goal_unit(problem, row.goal)
    if not math.isfinite(row.value):
        return "no value"
    word = "room" if row.met else "missed by"
    percent = 100.0 * abs(row.share)
    share = f"{percent:.0f}" if percent >= 100.0 else f"{percent:.3g}"
    return f"{units.written(row.value, unit, 4)}\n{word} {units.written(abs(row.slack), unit, 3)} ({share} %)"


def rooms_finding(reported: Reported) -> str:
    """Which constraints are missed, binding, or nearest to their bound."""
    rows = readings(reported.problem, reported.best.evaluation) if reported.best else ()
    missed = [row.goal.label for row in rows if not row.met]
    if missed:
        return f"{len(missed)} of {len(rows)} constraints missed: {', '.join(missed)}"
    tight = [row.goal.label for row in rows if row.binding]
    if tight:
        return f"All constraints met; {', '.join(tight)} binding"
    nearest = min(rows, key=lambda row: row.slack / row.goal.metric.scale)
    return f"All constraints met, none binding; {nearest.goal.label} is the nearest to its bound"
