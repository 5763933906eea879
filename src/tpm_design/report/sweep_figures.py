"""Figures of a sweep: every metric against every swept quantity, and maps of grids of two."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullLocator

from tpm_design.problem import Goal
from tpm_design.report.reported import Reported
from tpm_design.report.style import BLUE, GREY, INK, PALE, SMALL, new_figure, tidy, title, wrapped
from tpm_design.report.swept import is_logarithmic, metric_values, parameter_values
from tpm_design.runs.tables import goal_unit
from tpm_design.study import GridSweep
from tpm_design.study.sweep_points import plan_of_sweep, plan_size, swept_names

MOST_DOTS = 5000
"""Dots in one panel; of more points every second, third, … one is drawn."""

MOST_MARKED = 2500
"""Feasible cells of a map are marked up to a plan of this size."""


def scatter_figure(reported: Reported) -> Figure | None:
    """A panel for each metric and each swept quantity; None where no metric has a value."""
    goals, names = _measured(reported), swept_names(plan_of_sweep(reported.study))
    if not goals:
        return None
    entries = reported.run.entries
    step = -(-len(entries) // MOST_DOTS)
    feasible = np.array([entry.evaluation.status == "feasible" for entry in entries])[::step]
    figure = new_figure(1.4 + 2.3 * len(names), 1.2 + 2.0 * len(goals), "constrained")
    panels = figure.subplots(len(goals), len(names), sharex="col", sharey="row", squeeze=False)
    for column, name in enumerate(names):
        heading, given = parameter_values(reported, name)
        across = np.array(given)[::step]
        for row, goal in enumerate(goals):
            axes, values = panels[row, column], metric_values(reported, goal)[::step]
            for chosen, colour, label in ((~feasible, GREY, "infeasible"), (feasible, BLUE, "feasible")):
                axes.scatter(
                    across[chosen], values[chosen], s=9, color=colour, alpha=0.6, linewidths=0, label=label
                )
            tidy(axes)
            if column == 0:
                axes.set_ylabel(wrapped(_heading(reported, goal), 31), fontsize=SMALL)
        panels[-1, column].set_xlabel(wrapped(heading, 26), fontsize=SMALL)
        if is_logarithmic(reported, name):
            panels[-1, column].set_xscale("log")
            _label_few(panels[-1, column].xaxis)
    panels[0, -1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, fontsize=SMALL)
    title(figure, sweep_finding(reported))
    return figure


def map_figure(reported: Reported) -> Figure | None:
    """A map of each metric over a grid of two quantities with numbers; None for every other plan."""
    plan, goals = plan_of_sweep(reported.study), _measured(reported)
    if not goals or not isinstance(plan, GridSweep) or len(plan.axes) != 2 or plan.axes[-1][0] == "mode":
        return None
    (across, xs), (up, ys) = (parameter_values(reported, name) for name, _ in plan.axes)
    columns, column_of = np.unique(np.array(xs, dtype=np.float64), return_inverse=True)
    rows, row_of = np.unique(np.array(ys, dtype=np.float64), return_inverse=True)
    if min(len(columns), len(rows)) < 2:
        return None
    wide = min(3, len(goals))
    high = math.ceil(len(goals) / wide)
    figure = new_figure(3.5 * wide, 0.8 + 3.0 * high, "constrained")
    panels = figure.subplots(high, wide, squeeze=False).ravel()
    feasible = np.array([entry.evaluation.status == "feasible" for entry in reported.run.entries])
    for axes, goal in zip(panels, goals, strict=False):
        cells = np.full((len(rows), len(columns)), np.nan)
        cells[row_of, column_of] = metric_values(reported, goal)
        axes.set_facecolor(PALE)
        mesh = axes.pcolormesh(columns, rows, cells, shading="nearest", cmap="cividis")
        if plan_size(plan) <= MOST_MARKED:
            # ringed in white: seen on the dark end of the colours too
            across_at, up_at = columns[column_of[feasible]], rows[row_of[feasible]]
            axes.scatter(across_at, up_at, s=14, color=INK, edgecolors="white", linewidths=0.8)
        bar = figure.colorbar(mesh, ax=axes)
        bar.ax.tick_params(labelsize=SMALL)
        axes.set_title(wrapped(_heading(reported, goal), 34), fontsize=SMALL)
        axes.set_xlabel(wrapped(across, 34), fontsize=SMALL)
        axes.set_ylabel(wrapped(up, 34), fontsize=SMALL)
        if is_logarithmic(reported, plan.axes[0][0]):
            axes.set_xscale("log")
            _label_few(axes.xaxis)
        if is_logarithmic(reported, plan.axes[1][0]):
            axes.set_yscale("log")
            _label_few(axes.yaxis)
        tidy(axes)
    for axes in panels[len(goals) :]:
        axes.set_axis_off()
    title(figure, sweep_finding(reported))
    return figure


def _label_few(axis: Axis) -> None:
    """Plain numbers at 1, 2 and 5 of each decade."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_locator(NullLocator())


def sweep_finding(reported: Reported) -> str:
    """How many designs are feasible, and what the first metric came to."""
    entries = reported.run.entries
    feasible = sum(entry.evaluation.status == "feasible" for entry in entries)
    words = f"{feasible} of {len(entries)} designs are feasible"
    goals = _measured(reported)
    if not goals:
        return words
    values = metric_values(reported, goals[0])
    unit = reported.study.units.name(goal_unit(reported.problem, goals[0]))
    unit = "" if unit == "-" else f" {unit}"
    least, greatest = (f"{end(values):.4g}{unit}" for end in (np.nanmin, np.nanmax))
    return f"{words}; {goals[0].label} is between {least} and {greatest}"


def _measured(reported: Reported) -> list[Goal]:
    """The metrics that have a value at some point."""
    problem = reported.problem
    goals = (*problem.objectives, *problem.constraints, *problem.record)
    return [goal for goal in goals if np.isfinite(metric_values(reported, goal)).any()]


def _heading(reported: Reported, goal: Goal) -> str:
    return reported.study.units.heading(goal.label, goal_unit(reported.problem, goal))
