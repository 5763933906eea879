"""How figures look: one palette that colour-blind readers can tell apart, one set of sizes.

Figures are made through matplotlib's objects, not through its global state; only what SVG files need is set
there while one is written.
"""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Literal

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Okabe, Ito, Color Universal Design, 2008
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILLION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
INK, GREY, PALE = "#222222", "#8C8C8C", "#E9E9E9"
ASPECT_FILL = "#CFE4F3"

DPI = 150
TITLE, TEXT, SMALL = 12.0, 10.0, 9.0


def new_figure(width: float, height: float, layout: Literal["constrained", "compressed"] | None) -> Figure:
    """An empty figure (inches) whose parts keep clear of each other. ``layout`` "compressed": for axes of
    equal scales; None: for axes that have their place."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def plain(text: str) -> str:
    """Text as it is: no mathematics between dollar signs."""
    return text.replace("$", r"\$")


def wrapped(text: str, width: int) -> str:
    """Text in lines of at most ``width`` characters."""
    return plain(textwrap.fill(" ".join(text.split()), width, break_long_words=True))


def title(figure: Figure, text: str) -> None:
    """The figure's finding, as wide as the figure allows."""
    width = int(figure.get_figwidth() * 72.0 / (0.56 * TITLE))
    figure.suptitle(wrapped(text, width), fontsize=TITLE, color=INK)


def tidy(axes: Axes) -> None:
    """Readable ticks, no frame where there is no axis."""
    axes.spines[["top", "right"]].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(GREY)
    axes.tick_params(labelsize=SMALL, colors=INK)
    axes.xaxis.get_offset_text().set_fontsize(SMALL)
    axes.yaxis.get_offset_text().set_fontsize(SMALL)


def save(figure: Figure, path: Path) -> None:
    """PNG at 150 dpi, or SVG by the name of the file; the same figure gives the same bytes."""
    if path.suffix == ".svg":
        with rc_context({"svg.hashsalt": "tpm-design", "svg.fonttype": "path"}):
            figure.savefig(path, format="svg", metadata={"Date": None, "Creator": None})
    else:
        figure.savefig(path, dpi=DPI, format="png")
