"""Draw the gap between proved bounds against time, for three ways of paving the same set.

    python benchmarks/gap_against_time.py gap.png

Uniform: every undecided box is halved in each wave. Natural: an undecided box counts as a whole, from nothing
inside to all of it. Linear forms: what the package does, largest gaps first and two half-spaces per box.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from certified_volume import MARGIN
from paved_designs import paved_machine
from tpm_design.workspace.paving import PavedSet, Paving, largest

SECONDS = 6.0
# the signs of the largest aspects' determinants
SIDES = {"R2": (1.0, 1.0, 1.0), "R4": (1.0, 1.0, 1.0)}
Step = Callable[[Paving], tuple[float, float]]


def uniform(paving: Paving) -> tuple[float, float]:
    paving.halve(np.ones(len(paving.leaves.volumes), np.bool_))
    return paving.bounds


def natural(paving: Paving) -> tuple[float, float]:
    paving.halve(largest(paving.leaves.volumes, np.inf, 10**7))
    return paving.decided, paving.decided + float(paving.leaves.volumes.sum())


def linear_forms(paving: Paving) -> tuple[float, float]:
    paving.refine(0.0, 10**7)
    return paving.bounds


def course(name: str, step: Step) -> list[tuple[float, float]]:
    """(seconds, gap as a share of the lower bound) after each wave."""
    points = []
    paving = Paving(PavedSet(*paved_machine(name), SIDES[name], MARGIN))
    began = time.perf_counter()
    while (spent := time.perf_counter() - began) < SECONDS:
        lower, upper = step(paving)
        if lower > 0.0:
            points.append((time.perf_counter() - began, (upper - lower) / lower))
        if points and points[-1][0] - spent > SECONDS / 4:
            break
    return points


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("picture", type=Path)
    path = parser.parse_args().picture
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, len(SIDES), figsize=(10, 4), sharey=True, layout="constrained")
    for ax, name in zip(axes, SIDES, strict=True):
        for label, step in (("uniform", uniform), ("natural", natural), ("linear forms", linear_forms)):
            points = course(name, step)
            ax.loglog(*zip(*points, strict=True), marker=".", label=label)
            print(f"{name} {label}: gap {points[-1][1]:.2e} after {points[-1][0]:.1f} s")
        ax.set(title=name, xlabel="time (s)", ylim=(5e-4, 2.0))
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("gap / lower bound")
    axes[0].legend()
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
