"""Figure: a mechanism as a labelled line drawing, limb 1 with everything, the others lighter."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.report.marks import Angle, AtPoint, Mark, marks
from tpm_design.report.placing import beside_line, beside_point
from tpm_design.report.sheet import CENTRE_LINE, LETTER, Sheet
from tpm_design.report.skeleton import AXES, ORIGIN, FloatArray, Skeleton, skeleton
from tpm_design.report.style import ASPECT_FILL, BLUE, GREY, INK, PALE, VERMILLION
from tpm_design.report.symbols import equation, mathematics
from tpm_design.report.viewpoint import Viewpoint, best_viewpoint
from tpm_design.units import Units, si_unit

# points on the page
WIDTH, TALLEST, LOWEST = 504.0, 548.0, 302.0
MARGIN, KEY = 46.0, 34.0
JOINT, SPOT = 8.5, 4.0
# shares of the machine's size
AXIS_LENGTH, ROD_SPREAD = 0.13, 0.03
LIGHT, RAIL, LIGHT_RAIL = "#A9A9A9", "#6E6E6E", "#C9C9C9"
# from the back of the sheet to its front; what belongs to limbs is between two whole numbers by its depth
BASE_LAYER, AXES_LAYER, RAIL_LAYER, MARK_LAYER, LINK_LAYER, JOINT_LAYER, POINT_LAYER = 1, 2, 3, 3.5, 4, 6, 8


def mechanism_figure(
    mechanism: Mechanism, mode: Mode, pose: Sequence[float], units: Units | None = None
) -> Figure | None:
    """The machine at ``pose``; with ``units`` the marks say limb 1's dimensions too. None where it cannot be
    at the pose."""
    body = skeleton(mechanism, mode, pose)
    if body is None:
        return None
    drawn = marks(body)
    scene = _Scene(body, best_viewpoint(body, drawn), drawn)
    _draw_bodies(scene)
    _draw_axes(scene)
    for limb in reversed(range(len(body.limbs))):
        _draw_limb(scene, limb)
    for mark in sorted(drawn, key=_freedom):
        _draw_mark(scene, mark, units)
    _draw_names(scene)
    scene.sheet.key(_key(body, drawn))
    return scene.sheet.figure


class _Scene:
    """A machine, a view of it, and the sheet that it fills."""

    def __init__(self, body: Skeleton, view: Viewpoint, drawn: Sequence[Mark]) -> None:
        self.body, self.view = body, view
        seen = view.seen(_extent(body, drawn))
        low, high = seen.min(axis=0), seen.max(axis=0)
        room = np.array([WIDTH - 2.0 * MARGIN, TALLEST - 2.0 * MARGIN - KEY])
        self._scale = float(np.min(room / np.maximum(high - low, 1e-9 * body.size)))
        height = max(LOWEST, self._scale * float(high[1] - low[1]) + 2.0 * MARGIN + KEY)
        self._shift = np.array([0.5 * WIDTH, 0.5 * (height + KEY)]) - 0.5 * self._scale * (low + high)
        self.sheet = Sheet(WIDTH, height, KEY)

    def at(self, points: FloatArray | Sequence[FloatArray]) -> FloatArray:
        """Points in space (…, 3) in metres → on the sheet (…, 2) in points."""
        return np.asarray(self._scale * self.view.seen(np.asarray(points)) + self._shift)

    def depth(self, point: FloatArray) -> float:
        """In (0, 1), nearer to the viewer is more."""
        middle = self.body.limbs.mean(axis=(0, 1))
        return 0.5 + 0.5 * float(np.tanh((point - middle) @ self.view.toward / self.body.size))

    def line(self, points: Sequence[FloatArray], colour: str, width: float, layer: float) -> None:
        self.sheet.line(self.at(points), colour, width, layer)


def _extent(body: Skeleton, drawn: Sequence[Mark]) -> FloatArray:
    """Everything that must be on the sheet."""
    tips = AXIS_LENGTH * body.size * np.array([*AXES.values()])
    lines = [np.array(line) for limb in range(len(body.limbs)) for line in body.lines(limb)]
    arcs = [mark.arc for mark in drawn if isinstance(mark, Angle)]
    return np.vstack([np.zeros((1, 3)), tips, body.platform[None], body.bases, *lines, *arcs])


def _draw_bodies(scene: _Scene) -> None:
    """Base and platform, each an outline with lines to its point."""
    body = scene.body
    platform_layer = LINK_LAYER + scene.depth(body.platform)
    outlines = (
        (body.bases, np.zeros(3), PALE, GREY, BASE_LAYER),
        (body.limbs[:, -1], body.platform, ASPECT_FILL, INK, platform_layer),
    )
    for corners, middle, fill, edge, layer in outlines:
        if np.linalg.norm(corners - corners.mean(axis=0), axis=1).min() < 1e-3 * body.size:
            continue
        scene.sheet.face(scene.at(corners), fill, edge, layer)
        for corner in corners:
            scene.sheet.line(scene.at([middle, corner]), edge, 0.8, layer + 0.01, dash=CENTRE_LINE)


def _draw_axes(scene: _Scene) -> None:
    origin = scene.at(np.zeros(3))
    for name, direction in AXES.items():
        tip = scene.at(AXIS_LENGTH * scene.body.size * np.array(direction))
        scene.sheet.arrow(origin, tip, INK, "-|>", AXES_LAYER)
        words = f"${name}$"
        scene.sheet.words(words, INK, beside_point(tip, scene.sheet.half(words), 1.0))


def _draw_limb(scene: _Scene, limb: int) -> None:
    body = scene.body
    if body.rails:
        _draw_rail(scene, limb)
    for place, (start, end) in enumerate(itertools.pairwise(body.limbs[limb])):
        if body.is_rail(place):
            continue
        if body.drawing.joints[place : place + 2] == body.drawing.parallelogram:
            _draw_rods(scene, limb, start, end)
        else:
            colour, width = (INK, 3.0) if limb == 0 else (LIGHT, 2.4)
            layer = LINK_LAYER + scene.depth(0.5 * (start + end))
            scene.sheet.line(scene.at([start, end]), colour, width, layer, halo=True)
    for place, centre in enumerate(body.limbs[limb]):
        if body.is_rail(place):
            continue
        driven = body.joint(body.drawing.driven) == place
        scene.sheet.spot(
            scene.at(centre), _joint_marker(body, driven), JOINT, VERMILLION if driven else "white",
            INK if limb == 0 else GREY, JOINT_LAYER + scene.depth(centre),
        )  # fmt: skip


def _joint_marker(body: Skeleton, driven: bool) -> str:
    """A square where it slides."""
    return "s" if driven and body.rails else "o"


def _draw_rail(scene: _Scene, limb: int) -> None:
    first, last = scene.body.rail_ends(limb)
    start = scene.body.rails[limb].start
    scene.sheet.line(scene.at([start, first]), GREY, 0.8, RAIL_LAYER - 0.5, dash=CENTRE_LINE)
    scene.line([first, last], RAIL if limb == 0 else LIGHT_RAIL, 6.0, RAIL_LAYER)
    scene.line([first, last], "white", 3.2, RAIL_LAYER + 0.01)


def _draw_rods(scene: _Scene, limb: int, start: FloatArray, end: FloatArray) -> None:
    """The parallelogram between two joints."""
    colour, width = (INK, 2.0) if limb == 0 else (LIGHT, 1.6)
    layer = LINK_LAYER + scene.depth(0.5 * (start + end))
    lever = float(np.linalg.norm(scene.body.limbs[limb, -1] - scene.body.platform))
    spread = min(ROD_SPREAD * scene.body.size, max(0.4 * lever, 0.3 * ROD_SPREAD * scene.body.size))
    aside = spread * scene.body.hinges[limb]
    for side in (aside, -aside):
        scene.sheet.line(scene.at([start + side, end + side]), colour, width, layer, halo=True)
    for bar in (start, end):
        scene.line([bar - aside, bar + aside], colour, width, layer + 0.001)


def _freedom(mark: Mark) -> int:
    """What has fewer places comes first."""
    if isinstance(mark, Angle):
        return 0
    if isinstance(mark, AtPoint):
        return 3
    return 1 if mark.on_link else 2


def _draw_mark(scene: _Scene, mark: Mark, units: Units | None) -> None:
    words, colour, sheet = _mark_words(scene.body, mark, units), _mark_colour(scene.body, mark), scene.sheet
    half = sheet.half(words)
    if isinstance(mark, AtPoint):
        sheet.words(words, colour, beside_point(scene.at(mark.at), half, 6.0))
    elif isinstance(mark, Angle):
        for end in (mark.arc[0], mark.arc[-1]):
            scene.line([mark.vertex, mark.vertex + 1.25 * (end - mark.vertex)], colour, 0.6, MARK_LAYER - 0.1)
        scene.line(list(mark.arc), colour, 1.1, MARK_LAYER)
        sheet.words(words, colour, beside_point(scene.at(mark.arc[len(mark.arc) // 2]), half, 2.0))
    elif mark.on_link:
        sheet.words(words, colour, beside_line(scene.at(mark.start), scene.at(mark.end), half, 6.0))
    else:
        sheet.dimension(words, colour, scene.at(mark.start), scene.at(mark.end))


def _mark_colour(body: Skeleton, mark: Mark) -> str:
    """Parameters blue, coordinates as the driven joints."""
    return VERMILLION if body.mechanism.kind.parameter(mark.name) is None else BLUE


def _mark_words(body: Skeleton, mark: Mark, units: Units | None) -> str:
    parameter = body.mechanism.kind.parameter(mark.name)
    if parameter is None:
        return mathematics(mark.name, 1)
    symbol = mathematics(parameter.symbol, 1)
    if units is None:
        return symbol
    value = body.mechanism.parameters[parameter.name][0]
    return equation(symbol, units.written(value, si_unit(parameter.dimension), 4))


def _draw_names(scene: _Scene) -> None:
    """The points O and P, then the joints, those of limb 1 first."""
    body, sheet = scene.body, scene.sheet
    for name, point in ((ORIGIN, np.zeros(3)), (body.platform_name, body.platform)):
        words, at = f"${name}$", scene.at(point)
        sheet.spot(at, "o", SPOT, INK, INK, POINT_LAYER)
        sheet.words(words, INK, beside_point(at, sheet.half(words), SPOT))
    for limb in range(len(body.limbs)):
        colour, size = (INK, LETTER) if limb == 0 else (GREY, LETTER - 2.0)
        for letter in body.letters():
            shared = body.shared(letter)
            if shared and limb > 0:
                continue
            at_joint = body.point(letter, limb)
            if at_joint is not None and not body.is_point(at_joint, letter):
                words = f"${letter}_{{{'i' if shared else limb + 1}}}$"
                places = beside_point(scene.at(at_joint), sheet.half(words, size), 6.0)
                sheet.words(words, colour, places, size)


def _key(body: Skeleton, drawn: Sequence[Mark]) -> list[Line2D]:
    """What markers and colours mean, as far as they occur."""
    joints = [("white", "o", "joint")]
    if body.drawing.driven:
        joints.insert(0, (VERMILLION, _joint_marker(body, True), "driven joint"))
    colours = [(BLUE, "design parameter"), (VERMILLION, "joint coordinate")]
    present = {_mark_colour(body, mark) for mark in drawn}
    return [
        *(
            Line2D([], [], linestyle="none", marker=marker, markersize=8.0, markerfacecolor=fill,
                markeredgecolor=INK, markeredgewidth=1.5, label=label)
            for fill, marker, label in joints
        ),
        *(
            Line2D([], [], color=colour, linewidth=1.1, label=label)
            for colour, label in colours
            if colour in present
        ),
    ]  # fmt: skip
