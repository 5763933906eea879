"""Figure: the best design so far against the number of the evaluation."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tpm_design.report.history import History, history
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
from tpm_design.runs.tables import goal_unit

VIEWED = (2.0, 98.0)
"""Percentiles of the feasible evaluations that are sure to be in view, beside the best so far."""


def convergence_figure(reported: Reported) -> Figure | None:
    """None where nothing could be evaluated."""
    course = history(reported.problem, reported.run.entries)
    has_objective = bool(course.feasible.any())
    if not has_objective and not (course.violation > 0.0).any():
        return None
    # once a design is feasible the least violation is 0 and has nothing more to tell
    both = has_objective and bool((course.violation[: int(np.argmax(course.feasible))] > 0.0).any())
    figure = new_figure(7.5, 5.2 if both else 4.0, "constrained")
    if both:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.2))
        _draw_objective(upper, course, reported)
        _draw_violation(lower, course)
        last = lower
    elif has_objective:
        last = figure.subplots()
        _draw_objective(last, course, reported)
    else:
        last = figure.subplots()
        _draw_violation(last, course)
    last.set_xlabel("evaluation", fontsize=TEXT)
    last.xaxis.set_major_locator(MaxNLocator(integer=True))
    title(figure, convergence_finding(reported))
    return figure


def convergence_finding(reported: Reported) -> str:
    """How far the search came."""
    course = history(reported.problem, reported.run.entries)
    count = len(course.numbers)
    first = course.first_feasible
    if first is None:
        return f"No feasible design in {count} evaluations: least violation {np.nanmin(course.violation):.3g}"
    goal, units = reported.problem.objectives[0], reported.study.units
    unit = goal_unit(reported.problem, goal)
    reached = course.best[np.isfinite(course.best)]
    if reached[0] == reached[-1]:
        return (
            f"{goal.label}: {units.written(reached[-1], unit, 4)} at evaluation {first}, "
            f"not bettered in {count} evaluations"
        )
    # the last round that has a feasible design has the result
    last = course.rounds == course.rounds[np.isfinite(course.best)].max()
    found = int(course.numbers[np.argmax(last & (course.best == reached[-1]))])
    if course.rounds.max() > 1:
        return (
            f"{goal.label}: {units.written(reached[-1], unit, 4)} at evaluation {found} of {count}, in round "
            f"{course.rounds[last][0]} of {course.rounds.max()}; later rounds ask for more"
        )
    return (
        f"{goal.label} went from {units.written(reached[0], unit, 4)} (first feasible design, evaluation "
        f"{first}) to {units.written(reached[-1], unit, 4)} (evaluation {found} of {count})"
    )


def _draw_objective(axes: Axes, course: History, reported: Reported) -> None:
    goal, units = reported.problem.objectives[0], reported.study.units
    unit = goal_unit(reported.problem, goal)
    factor = units.from_si(1.0, unit)
    values, best = course.objective * factor, course.best * factor
    for chosen, colour, size, name in (
        (~course.feasible & np.isfinite(values), GREY, 9, "infeasible"),
        (course.feasible, BLUE, 12, "feasible"),
    ):
        if chosen.any():
            across, up = course.numbers[chosen], values[chosen]
            axes.scatter(across, up, s=size, color=colour, alpha=0.5, linewidths=0, label=name)
    axes.step(course.numbers, best, where="post", color=BLUE, linewidth=2.0, label="best feasible so far")
    shown = np.concatenate([best[np.isfinite(best)], np.nanpercentile(values[course.feasible], VIEWED)])
    room = 0.06 * (np.ptp(shown) or abs(float(shown[0])) or 1.0)
    axes.set_ylim(float(shown.min()) - room, float(shown.max()) + room)
    _mark_first_feasible(axes, course)
    _mark_rounds(axes, course)
    axes.set_ylabel(wrapped(f"{goal.label} [{units.name(unit)}]", 36), fontsize=TEXT)
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, frameon=False, fontsize=SMALL, markerscale=1.8
    )
    tidy(axes)


def _draw_violation(axes: Axes, course: History) -> None:
    positive = course.violation > 0.0
    axes.scatter(
        course.numbers[positive], course.violation[positive], s=9, color=GREY, alpha=0.5, linewidths=0
    )
    closest = np.where(course.closest > 0.0, course.closest, np.nan)
    axes.step(course.numbers, closest, where="post", color=VERMILLION, linewidth=2.0)
    axes.set_yscale("log")
    axes.set_ylabel("violation [–]\nline: least so far", fontsize=SMALL)
    _mark_first_feasible(axes, course)
    _mark_rounds(axes, course)
    tidy(axes)


def _mark_rounds(axes: Axes, course: History) -> None:
    for start in course.numbers[1:][np.diff(course.rounds) > 0]:
        label = "new round" if start == course.numbers[course.rounds > 1][0] else None
        axes.axvline(start, color=GREY, linewidth=1.0, linestyle=(0, (1, 2)), label=label)


def _mark_first_feasible(axes: Axes, course: History) -> None:
    if course.first_feasible is not None and not course.feasible[0]:
        axes.axvline(
            course.first_feasible, color=GREEN, linewidth=1.2, linestyle=(0, (4, 3)), label="first feasible"
        )
