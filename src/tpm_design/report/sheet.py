"""A sheet of paper for line drawings: lines, arrows and words that keep clear of what is there already.

Everything on the sheet is in points, its origin at the lower left.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.patheffects import withStroke

from tpm_design.report.placing import Label, Place, across, beside_line, best_place, dense, place_cost
from tpm_design.report.skeleton import FloatArray
from tpm_design.report.style import SMALL, new_figure

POINTS_PER_INCH = 72.0
LETTER = 13.0
HALO = 3.0
SHORTEST_WITH_ARROWS = 22.0
DIMENSION_DISTANCES = (13.0, 20.0, 28.0, 37.0, 47.0)
SERIF = "stix"

Dash = Literal["solid"] | tuple[float, tuple[float, ...]]
CENTRE_LINE: Dash = (0.0, (6.0, 2.0, 1.0, 2.0))


class Sheet:
    """A sheet of ``width`` × ``height`` points; its lowest ``key`` points are kept for the key."""

    def __init__(self, width: float, height: float, key: float) -> None:
        self.figure: Figure = new_figure(width / POINTS_PER_INCH, height / POINTS_PER_INCH, None)
        self._size = (width, height)
        self._axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self._axes.set_xlim(0.0, width)
        self._axes.set_ylim(0.0, height)
        self._axes.set_axis_off()
        self._lines: list[FloatArray] = []
        self._labels: list[Label] = [Label((0.5 * width, 0.5 * key), (0.5 * width, 0.5 * key))]

    def line(
        self, path: FloatArray, colour: str, width: float, layer: float, *, dash: Dash = "solid",
        halo: bool = False,
    ) -> None:  # fmt: skip
        """A polyline (n, 2); with a ``halo`` it seems to pass in front of what it crosses."""
        self._lines.append(path)
        effects = [withStroke(linewidth=width + HALO, foreground="white")] if halo else []
        self._axes.add_line(
            Line2D(
                path[:, 0], path[:, 1], color=colour, linewidth=width, linestyle=dash, zorder=layer,
                solid_capstyle="round", path_effects=effects,
            )
        )  # fmt: skip

    def face(self, corners: FloatArray, fill: str, edge: str, layer: float) -> None:
        """A polygon (n, 2) through which one can see a little."""
        self._lines.append(np.vstack([corners, corners[:1]]))
        self._axes.add_patch(
            Polygon(corners, facecolor=fill, edgecolor=edge, linewidth=1.2, alpha=0.75, zorder=layer)
        )

    def arrow(self, start: FloatArray, end: FloatArray, colour: str, style: str, layer: float) -> None:
        """An arrow in one of matplotlib's styles."""
        self._lines.append(np.array([start, end]))
        self._axes.add_patch(
            FancyArrowPatch(
                (float(start[0]), float(start[1])), (float(end[0]), float(end[1])), arrowstyle=style,
                mutation_scale=8.0, shrinkA=0.0, shrinkB=0.0, color=colour, linewidth=0.9, zorder=layer,
            )
        )  # fmt: skip

    def spot(self, at: FloatArray, marker: str, size: float, fill: str, edge: str, layer: float) -> None:
        """A marker that words keep clear of."""
        half = 0.5 * size
        self._lines.append(at + half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]))
        self._axes.add_line(
            Line2D(
                [at[0]], [at[1]], linestyle="none", marker=marker, markersize=size, markerfacecolor=fill,
                markeredgecolor=edge, markeredgewidth=1.5, zorder=layer,
            )
        )  # fmt: skip

    def half(self, words: str, size: float = LETTER) -> tuple[float, float]:
        """Half width and half height of words."""
        text = self._axes.text(0.0, 0.0, words, fontsize=size, math_fontfamily=SERIF)
        box = text.get_window_extent()
        text.remove()
        scale = 0.5 * POINTS_PER_INCH / self.figure.dpi
        return scale * box.width + 1.0, scale * box.height + 1.0

    def words(self, words: str, colour: str, places: Sequence[Place], size: float = LETTER) -> None:
        """Words at the best of some places."""
        self._write(words, colour, best_place(places, self._labels, dense(self._lines), self._size), size)

    def dimension(self, words: str, colour: str, start: FloatArray, end: FloatArray) -> None:
        """A dimension line beside what it measures, with extension lines and words."""
        half, normal, lines = self.half(words), across(start, end), dense(self._lines)
        best: tuple[float, FloatArray, Label] | None = None
        for away in DIMENSION_DISTANCES:
            for side in (1.0, -1.0):
                offset = side * away * normal
                path = dense([np.array([start + offset, end + offset])])
                crossed = int((np.abs(path[:, None] - lines[None]).max(axis=-1) < 2.0).any(axis=1).sum())
                crossed += sum(3 * label.covered(path) for label in self._labels)
                for place in beside_line(start + offset, end + offset, half, 2.0):
                    cost = crossed + 0.25 * away + place_cost(place, self._labels, lines, self._size)
                    if best is None or cost < best[0]:
                        best = cost, offset, place.label
        assert best is not None
        _, offset, label = best
        beyond = offset * (1.0 + 4.0 / float(np.hypot(*offset)))
        for corner in (start, end):
            self.line(np.array([corner, corner + beyond]), colour, 0.6, 3.4)
        short = float(np.hypot(*(end - start))) < SHORTEST_WITH_ARROWS
        self.arrow(start + offset, end + offset, colour, "-" if short else "<|-|>", 3.5)
        self._write(words, colour, label, LETTER)

    def key(self, entries: Sequence[Line2D]) -> None:
        """What markers and colours mean, at the foot of the sheet."""
        self._axes.legend(
            handles=list(entries), loc="lower center", ncols=len(entries), frameon=False, fontsize=SMALL
        )

    def _write(self, words: str, colour: str, label: Label, size: float) -> None:
        self._labels.append(label)
        self._axes.text(
            *label.centre, words, color=colour, fontsize=size, ha="center", va="center", zorder=9.0,
            math_fontfamily=SERIF,
            bbox={"boxstyle": "square,pad=0", "facecolor": "white", "edgecolor": "none", "alpha": 0.7},
        )  # fmt: skip
