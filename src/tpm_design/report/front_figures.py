"""Figures: the front of several objectives, and the hypervolume it dominates as the search went on."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tpm_design.problem import Goal
from tpm_design.report.reported import Reported
from tpm_design.report.style import (
    BLUE,
    GREEN,
    GREY,
    SMALL,
    TEXT,
    VERMILLION,
    new_figure,
    tidy,
    title,
    wrapped,
)
from tpm_design.runs.entry import Entry
from tpm_design.runs.front import FloatArray, FrontBox, extended, front_box
from tpm_design.runs.marks import KNEE, front_marks
from tpm_design.runs.ranking import scaled_objectives
from tpm_design.runs.tables import goal_unit

MOST_PANELS = 6
ROOM = 0.15
"""Free margin around the front, as a share of its range; feasible designs far from it are not in view."""


def front_figure(reported: Reported) -> Figure | None:
    """A panel for each pair of objectives; None where there is no front."""
    if not reported.front:
        return None
    pairs = list(combinations(reported.problem.objectives, 2))[:MOST_PANELS]
    across = min(3, len(pairs))
    down = -(-len(pairs) // across)
    figure = new_figure(6.4 if len(pairs) == 1 else 4.0 * across, 1.0 + 3.8 * down, "constrained")
    panels = figure.subplots(down, across, squeeze=False).flat
    for axes, (one, other) in zip(panels, pairs, strict=False):
        _draw_pair(axes, reported, one, other)
    for axes in list(panels)[len(pairs) :]:
        axes.set_axis_off()
    figure.axes[0].legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False, fontsize=SMALL, handletextpad=0.3
    )
    title(figure, front_finding(reported))
    return figure


def front_finding(reported: Reported) -> str:
    """The range of every objective over the front."""
    units = reported.study.units
    ranges = []
    for goal in reported.problem.objectives:
        values = _values(reported, reported.front, goal)
        unit = goal_unit(reported.problem, goal)
        first, last = units.written(values[0], unit, 4), units.written(values[-1], unit, 4)
        ranges.append(f"{goal.label} from {first} to {last}")
    return f"Front of {len(reported.front)}: {', '.join(ranges)}"


def _draw_pair(axes: Axes, reported: Reported, one: Goal, other: Goal) -> None:
    units, problem = reported.study.units, reported.problem
    goals = (one, other)
    factors = [units.from_si(1.0, goal_unit(problem, goal)) for goal in goals]
    feasible = [e for e in reported.run.entries if e.evaluation.status == "feasible"]
    chosen = {entry.number for entry in reported.front}
    dominated = [entry for entry in feasible if entry.number not in chosen]
    x, y = (_values(reported, dominated, g) * f for g, f in zip(goals, factors, strict=True))
    axes.scatter(x, y, s=7, color=GREY, alpha=0.25, linewidths=0, label="feasible, dominated")
    x, y = (_values(reported, reported.front, g) * f for g, f in zip(goals, factors, strict=True))
    axes.scatter(x, y, s=16, color=BLUE, linewidths=0, label="front", zorder=3)
    marks = front_marks(problem, reported.front)
    for place, mark in enumerate(marks):
        if not mark:
            continue
        is_knee = KNEE in mark.split("; ")
        axes.scatter(
            x[place],
            y[place],
            s=150 if is_knee else 60,
            marker="*" if is_knee else "D",
            color=VERMILLION if is_knee else GREEN,
            linewidths=0,
            label="knee" if is_knee else "best by one objective" if mark == _first_best(marks) else None,
            zorder=4,
        )
    for values, limit in ((x, axes.set_xlim), (y, axes.set_ylim)):
        room = ROOM * (np.ptp(values) or abs(float(values[0])) or 1.0)
        limit(float(values.min()) - room, float(values.max()) + room)
    for goal, label in ((one, axes.set_xlabel), (other, axes.set_ylabel)):
        word = "less" if goal.sense == "minimize" else "more"
        unit = units.name(goal_unit(problem, goal))
        label(wrapped(f"{goal.label} [{unit}], {word} is better", 40), fontsize=TEXT)
    tidy(axes)


def _first_best(marks: list[str]) -> str:
    return next((mark for mark in marks if mark and KNEE not in mark.split("; ")), "")


def _values(reported: Reported, entries: tuple[Entry, ...] | list[Entry], goal: Goal) -> FloatArray:
    return np.array([entry.evaluation.metrics[goal.label] for entry in entries], dtype=np.float64)


# ------------------------------------------------------------------------------------- hypervolume


def box_of(reported: Reported) -> FrontBox | None:
    """Where the hypervolume of a run is measured; None where its front has no range in an objective."""
    if not reported.front:
        return None
    values = [scaled_objectives(reported.problem, entry.evaluation) for entry in reported.front]
    return front_box(np.array(values))


def hypervolume_course(reported: Reported, box: FrontBox) -> FloatArray:
    """The hypervolume (N,) of the front so far after each entry of the log."""
    course = np.zeros(len(reported.run.entries))
    front = np.empty((0, len(reported.problem.objectives)))
    reached = 0.0
    for place, entry in enumerate(reported.run.entries):
        if entry.evaluation.status == "feasible":
            values = np.array(scaled_objectives(reported.problem, entry.evaluation))
            longer = extended(front, values)
            if longer is not front:
                front, reached = longer, box.hypervolume(longer)
        course[place] = reached
    return course


def reference_text(reported: Reported, box: FrontBox) -> str:
    """The reference point in the study's units: ``total_link_length 1500 mm, gci 0.2``."""
    units = reported.study.units
    parts = []
    for goal, scaled in zip(reported.problem.objectives, box.reference, strict=True):
        value = scaled * goal.metric.scale * (1.0 if goal.sense == "minimize" else -1.0)
        parts.append(f"{goal.label} {units.written(value, goal_unit(reported.problem, goal), 4)}")
    return ", ".join(parts)


def hypervolume_figure(reported: Reported, course: FloatArray) -> Figure:
    """The hypervolume against the number of the evaluation."""
    figure = new_figure(7.5, 3.6, "constrained")
    axes = figure.subplots()
    numbers = [entry.number for entry in reported.run.entries]
    axes.step(numbers, course, where="post", color=BLUE, linewidth=2.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_xlabel("evaluation", fontsize=TEXT)
    axes.set_ylabel("hypervolume, share of the box [–]", fontsize=TEXT)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    tidy(axes)
    title(figure, hypervolume_finding(reported, course))
    return figure


def hypervolume_finding(reported: Reported, course: FloatArray) -> str:
    """What was reached, and when nine tenths and 99 % of it were."""
    entries = reported.run.entries
    when = [entries[int(np.argmax(course >= share * course[-1]))].number for share in (0.9, 0.99)]
    return (
        f"Hypervolume {course[-1]:.3f} after {len(entries)} evaluations: 90 % of it by evaluation {when[0]}, "
        f"99 % by {when[1]}"
    )
