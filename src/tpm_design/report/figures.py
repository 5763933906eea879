"""The figures of a report, each with the sentence that goes below it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from tpm_design.metrics.context import Context
from tpm_design.report.convergence import convergence_figure, convergence_finding
from tpm_design.report.drawing import mechanism_figure
from tpm_design.report.front_figures import (
    box_of,
    front_figure,
    front_finding,
    hypervolume_course,
    hypervolume_figure,
    hypervolume_finding,
    reference_text,
)
from tpm_design.report.good_pose import good_pose
from tpm_design.report.maps import conditioning_figure, workspace_figure
from tpm_design.report.reported import Reported, best_context
from tpm_design.report.rooms import rooms_figure, rooms_finding
from tpm_design.report.style import save
from tpm_design.report.survey import conditioning_shown, has_conditioning, survey
from tpm_design.report.sweep_figures import map_figure, scatter_figure, sweep_finding
from tpm_design.units import Units

FIGURES = "figures"
DRAWING = "mechanism.png"


@dataclass(frozen=True)
class Picture:
    """One figure: its file, what it shows in one sentence, and how to read it in another."""

    file: str
    finding: str
    caption: str
    figure: Figure


def pictures(reported: Reported) -> tuple[Picture, ...]:
    """What there is to draw of a run, in the order of the report."""
    rooms = rooms_figure(reported)
    # the course of one objective says little of a front; of a search that found none it shows the violation
    course = None if reported.swept or reported.front else convergence_figure(reported)
    context = best_context(reported)
    found = [] if context is None else _drawings(context, reported.study.units)
    if reported.swept:
        found += _sweep_pictures(reported)
    found += _front_pictures(reported)
    found += _slice_pictures(reported)
    if rooms is not None:
        found.append(
            Picture(
                "constraints.png",
                rooms_finding(reported),
                "Distance of every constraint to its bound after the numeric error is taken off, as a share "
                "of the bound (of the metric's scale where the bound is 0); bars are cut at 100 %.",
                rooms,
            )
        )
    if course is not None:
        found.append(
            Picture(
                "convergence.png",
                convergence_finding(reported),
                "The best feasible objective and the least violation so far; a dot is one evaluated design.",
                course,
            )
        )
    return tuple(found)


def _drawings(context: Context, units: Units) -> list[Picture]:
    """The machine in the middle of its useful region; where it cannot be there, well inside its workspace."""
    machine, mode = context.mechanism, context.mode
    places = {"well inside its workspace": good_pose(machine, mode)}
    if context.region is not None and machine.kind.translational:
        places = {"in the middle of the useful region": context.region.centre, **places}
    for where, pose in places.items():
        figure = None if pose is None else mechanism_figure(machine, mode, pose, units)
        if figure is not None:
            caption = "Limb 1 carries the names and its own dimensions; the links are to scale."
            return [Picture(DRAWING, f"{machine.kind.title} {where}", caption, figure)]
    return []


def _front_pictures(reported: Reported) -> list[Picture]:
    figure = front_figure(reported)
    if figure is None:
        return []
    caption = (
        "Nothing on the front is better by one objective without being worse by another. Star: the knee, "
        "farthest from the straight line (with more objectives: the plane) through the extremes, each "
        "objective as a share of its range; diamonds: the best by each objective."
    )
    found = [Picture("front.png", front_finding(reported), caption, figure)]
    box = box_of(reported)
    if box is not None:
        course = hypervolume_course(reported, box)
        caption = (
            "The share dominated of the box between the best of each objective and the reference point, 10 % "
            f"of the front's range beyond its worst: {reference_text(reported, box)}."
        )
        finding, grown = hypervolume_finding(reported, course), hypervolume_figure(reported, course)
        found.append(Picture("hypervolume.png", finding, caption, grown))
    return found


def _sweep_pictures(reported: Reported) -> list[Picture]:
    figures = {
        "sweep.png": (scatter_figure(reported), "Every metric against every swept quantity."),
        "sweep-map.png": (
            map_figure(reported),
            "Every metric over the grid. A dot is a feasible design; a pale cell has no value.",
        ),
    }
    finding = sweep_finding(reported)
    return [
        Picture(file, finding, caption, figure)
        for file, (figure, caption) in figures.items()
        if figure is not None
    ]


def _slice_pictures(reported: Reported) -> list[Picture]:
    context = best_context(reported)
    view = None if context is None else survey(context, reported.problem)
    if view is None:
        return []
    units = reported.study.units
    middle = "useful region" if view.context.region is not None else "singularity-free side"
    found = [
        Picture(
            "workspace.png",
            view.headline(units),
            f"Three planes through the middle of the {middle}: what the working mode reaches, the "
            "singularity-free side the design works on, and the curves where a determinant vanishes.",
            workspace_figure(view, units),
        )
    ]
    if has_conditioning(reported.problem):
        shown = conditioning_shown(reported.problem)
        found.append(
            Picture(
                "conditioning.png",
                view.conditioning_headline(shown),
                f"{shown.name} on the same planes: 1 is isotropic, 0 is singular.",
                conditioning_figure(view, shown, units),
            )
        )
    return found


def write_pictures(folder: Path, found: tuple[Picture, ...]) -> tuple[Path, ...]:
    """Save the figures below ``folder``."""
    target = folder / FIGURES
    target.mkdir(exist_ok=True)
    for picture in found:
        save(picture.figure, target / picture.file)
    return tuple(target / picture.file for picture in found)
