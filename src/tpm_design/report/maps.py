"""Figures: three slices through the workspace, one set with the singularities, one with the conditioning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from tpm_design.mechanisms.base import MechanismKind
from tpm_design.report.slices import FloatArray, Plane, Slice, region_outline
from tpm_design.report.style import (
    ASPECT_FILL,
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    SMALL,
    TEXT,
    VERMILLION,
    new_figure,
    plain,
    tidy,
    title,
)
from tpm_design.report.survey import ConditioningShown, Survey
from tpm_design.units import Units
from tpm_design.workspace.region_geometry import POINTS

Dash = Literal["solid"] | tuple[float, tuple[float, ...]]

LOCUS_STYLES: tuple[tuple[str, Dash], ...] = (
    (ORANGE, (0, (5, 2))),
    (VERMILLION, "solid"),
    (PURPLE, (0, (4, 1.5, 1, 1.5))),
    (BLUE, (0, (1, 1))),
)
LEVELS = np.linspace(0.0, 1.0, 11)
SHORTEST = 0.02
"""A locus has an entry in the legend from this length on, as a share of the panel."""


@dataclass(frozen=True)
class _Frame:
    """What both figures share of the three panels."""

    survey: Survey
    units: Units

    def factors(self, plane: Plane) -> FloatArray:
        """From SI to the study's units, of the coordinates across and up (2,)."""
        units = [self.kind.coordinate_units[side] for side in (plane.across, plane.up)]
        return np.array([self.units.from_si(1.0, unit) for unit in units])

    def axis_name(self, coordinate: int) -> str:
        """``x [mm]``; a name alone where there is no unit."""
        name = self.kind.coordinates[coordinate]
        unit = self.units.name(self.kind.coordinate_units[coordinate])
        return name if unit == "-" else f"{name} [{unit}]"

    @property
    def kind(self) -> MechanismKind:
        return self.survey.context.mechanism.kind


def workspace_figure(survey: Survey, units: Units) -> Figure:
    """Reach, aspect, singularity loci and region on three planes."""
    frame = _Frame(survey, units)
    figure, panels = _panels(frame, 12.0)
    drawn: set[int] = set()
    for axes, view in zip(panels, survey.slices, strict=True):
        factors = frame.factors(view.plane)
        across, up = view.across * factors[0], view.up * factors[1]
        axes.contourf(across, up, view.reach, levels=[0.0, np.inf], colors=[PALE])
        axes.contourf(across, up, view.aspect, levels=[0.0, np.inf], colors=[ASPECT_FILL])
        _draw_lines(axes, view.reach_outline(), factors, INK, 1.0, "solid")
        for part in range(len(frame.kind.determinants)):
            lines = view.determinant_lines(part)
            colour, dash = LOCUS_STYLES[part % len(LOCUS_STYLES)]
            _draw_lines(axes, lines, factors, colour, 2.0, dash)
            if sum(map(_length, lines)) > SHORTEST * survey.slices[0].longest:
                drawn.add(part)
        _draw_region(axes, view, frame)
        _draw_nearest(axes, view, frame)
        _note_plane(axes, view, frame.kind)
    figure.legend(
        handles=[*_fill_keys(survey), *_locus_keys(frame.kind, drawn), *_region_keys(survey),
            *_nearest_keys(survey)],
        loc="outside lower center", ncols=3, frameon=False, fontsize=SMALL, handlelength=2.6,
    )  # fmt: skip
    title(figure, survey.headline(units))
    return figure


def conditioning_figure(survey: Survey, shown: ConditioningShown, units: Units) -> Figure:
    """1/κ on three planes, with a contour at the study's bound."""
    frame = _Frame(survey, units)
    figure, panels = _panels(frame, 11.0)
    filled = None
    for axes, view in zip(panels, survey.slices, strict=True):
        factors = frame.factors(view.plane)
        across, up = view.across * factors[0], view.up * factors[1]
        filled = axes.contourf(
            across, up, np.clip(view.conditioning, 0.0, 1.0), levels=LEVELS, cmap="cividis",
            norm=BoundaryNorm(LEVELS, 256),
        )  # fmt: skip
        outline = axes.contourf(across, up, view.reach, levels=[0.0, np.inf], colors=["none"])
        reachable = outline.get_paths()[0]
        filled.set_clip_path(reachable, transform=axes.transData)
        if shown.bound is not None:
            edge = axes.contour(
                across, up, view.conditioning, levels=[shown.bound], colors=["white"], linewidths=2.2
            )
            edge.set_clip_path(reachable, transform=axes.transData)
            edge = axes.contour(
                across, up, view.conditioning, levels=[shown.bound], colors=[VERMILLION], linewidths=1.4
            )
            edge.set_clip_path(reachable, transform=axes.transData)
        _draw_lines(axes, view.reach_outline(), factors, INK, 1.0, "solid")
        _draw_region(axes, view, frame)
        _note_plane(axes, view, frame.kind)
    if filled is not None:
        bar = figure.colorbar(filled, ax=panels, shrink=0.8, aspect=28, pad=0.015)
        bar.set_label(plain(shown.name), fontsize=TEXT)
        bar.ax.tick_params(labelsize=SMALL)
    keys: list[Line2D | Patch] = [Line2D([], [], color=INK, linewidth=1.0, label="edge of reach")]
    if shown.bound is not None:
        keys.append(Line2D([], [], color=VERMILLION, linewidth=1.4, label=f"bound {shown.bound:g}"))
    figure.legend(
        handles=[*keys, *_region_keys(survey)], loc="outside lower center", ncols=3, frameon=False,
        fontsize=SMALL,
    )  # fmt: skip
    title(figure, survey.conditioning_headline(shown))
    return figure


def _panels(frame: _Frame, room: float) -> tuple[Figure, Sequence[Axes]]:
    """Three panels side by side at one scale, ``room`` inches together."""
    views = frame.survey.slices
    widths, heights = [1.0] * len(views), [1.0] * len(views)
    if frame.kind.translational:
        widths = [float(np.ptp(view.across)) for view in views]
        heights = [float(np.ptp(view.up)) for view in views]
    scale = room / sum(widths)
    figure = new_figure(13.5, min(9.0, max(3.0, scale * max(heights)) + 1.6), "compressed")
    panels = figure.subplots(1, len(views), width_ratios=widths)
    for axes, view in zip(panels, views, strict=True):
        plane = view.plane
        factors = frame.factors(plane)
        if frame.kind.translational:
            axes.set_aspect("equal")
        axes.set_xlim(*(factors[0] * view.across[[0, -1]]))
        axes.set_ylim(*(factors[1] * view.up[[0, -1]]))
        axes.set_xlabel(frame.axis_name(plane.across), fontsize=TEXT)
        axes.set_ylabel(frame.axis_name(plane.up), fontsize=TEXT)
        height = frame.units.written(plane.height, frame.kind.coordinate_units[plane.normal], 4)
        axes.set_title(f"{frame.kind.coordinates[plane.normal]} = {height}", fontsize=TEXT, color=INK)
        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.yaxis.set_major_locator(MaxNLocator(6))
        tidy(axes)
    return figure, list(panels)


def _draw_lines(
    axes: Axes, lines: Sequence[FloatArray], factors: FloatArray, colour: str, width: float, dash: Dash
) -> None:
    axes.add_collection(
        LineCollection(
            [factors * line for line in lines], colors=colour, linewidths=width, linestyles=[dash], zorder=3
        )
    )


def _length(line: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _draw_nearest(axes: Axes, view: Slice, frame: _Frame) -> None:
    if frame.survey.nearest is None:
        return
    pose = np.asarray(frame.survey.nearest.pose)[[view.plane.across, view.plane.up]]
    at = frame.factors(view.plane) * pose
    axes.plot(*at, marker="x", color="white", markersize=9, markeredgewidth=4.0, zorder=5)
    axes.plot(*at, marker="x", color=INK, markersize=8, markeredgewidth=2.0, zorder=5)


def _nearest_keys(survey: Survey) -> list[Line2D]:
    if survey.nearest is None:
        return []
    return [
        Line2D(
            [], [], color=INK, marker="x", linestyle="none", markersize=8, markeredgewidth=2.0,
            label=f"nearest {survey.nearest.name} (projected)",
        )
    ]  # fmt: skip


def _draw_region(axes: Axes, view: Slice, frame: _Frame) -> None:
    region = frame.survey.context.region
    if region is None:
        return
    outline = frame.factors(view.plane) * region_outline(region, view.plane)
    if region.form == POINTS:
        axes.plot(outline[:, 0], outline[:, 1], ".", color=GREEN, markersize=6, zorder=4)
        return
    axes.plot(outline[:, 0], outline[:, 1], color="white", linewidth=4.0, zorder=4)
    axes.plot(outline[:, 0], outline[:, 1], color=GREEN, linewidth=2.4, zorder=4)


def _note_plane(axes: Axes, view: Slice, kind: MechanismKind) -> None:
    """Say so where a plane is not what it seems."""
    names = [name for part, name in enumerate(kind.determinants) if view.vanishing(part)]
    words = f"singular all over ({', '.join(names)})" if names else ""
    if not view.reachable:
        words = "nothing of this plane is within reach"
    axes.text(0.5, 0.99, words, transform=axes.transAxes, ha="center", va="top", fontsize=SMALL, color=INK)


def _fill_keys(survey: Survey) -> list[Patch | Line2D]:
    keys: list[Patch | Line2D] = [
        Line2D([], [], color=INK, linewidth=1.0, label="edge of reach"),
        Patch(facecolor=PALE, edgecolor=GREY, label="within reach, beyond a singularity"),
    ]
    if survey.aspect is not None:
        keys.append(Patch(facecolor=ASPECT_FILL, edgecolor=GREY, label="singularity-free side"))
    return keys


def _locus_keys(kind: MechanismKind, drawn: set[int]) -> list[Line2D]:
    return [
        Line2D(
            [], [], color=LOCUS_STYLES[part % len(LOCUS_STYLES)][0], linewidth=2.0,
            linestyle=LOCUS_STYLES[part % len(LOCUS_STYLES)][1], label=plain(locus_name(kind, part)),
        )
        for part in sorted(drawn)
    ]  # fmt: skip


def _region_keys(survey: Survey) -> list[Line2D]:
    region = survey.context.region
    if region is None:
        return []
    if region.form == POINTS:
        return [
            Line2D([], [], color=GREEN, marker=".", linestyle="none", markersize=8, label="poses (projected)")
        ]
    return [Line2D([], [], color=GREEN, linewidth=2.4, label="useful region")]


def locus_name(kind: MechanismKind, part: int) -> str:
    """``actuation: det W = 0, eq. (35), (36)``"""
    name = kind.determinants[part]
    for singularity in kind.singularities:
        if singularity.name == name:
            return f"{name}: {singularity.condition.split(':')[0]}, eq. {singularity.equation}"
    return f"{name}: determinant 0"
