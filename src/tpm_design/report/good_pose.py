"""Where a mechanism is drawn if nobody says where."""

from __future__ import annotations

import numpy as np

from tpm_design.mechanisms.mechanism import Mechanism, Mode

LATTICE = 25


def first_mode(mechanism: Mechanism) -> Mode:
    """The working mode with all signs +."""
    return mechanism.mode_of({field.name: "+" * field.length for field in mechanism.kind.mode_fields})


def good_pose(mechanism: Mechanism, mode: Mode) -> tuple[float, ...] | None:
    """The pose of a lattice that is farthest inside reach and from all singularities, each as a share of
    what is best there. Where poses are not positions, the one that the mechanism declares for its drawing.
    None where there is none, or none is reachable."""
    if not mechanism.kind.translational:
        return mechanism.kind.drawing.pose
    radius = mechanism.reach_radius()
    side = np.linspace(-radius, radius, LATTICE)
    # off the planes that a symmetric mechanism is singular on
    poses = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3) + 1e-3 * radius
    margins = mechanism.margins(poses, mode)
    score = np.full(len(poses), np.inf)
    for values in margins.values():
        sizes = np.nan_to_num(np.abs(np.where(margins["reach"] > 0.0, values, 0.0)))
        best = float(sizes.max())
        if best > 0.0:
            score = np.minimum(score, sizes / best)
    inside = (margins["reach"] > 0.0) & np.isfinite(score)
    if not inside.any():
        return None
    best_pose = poses[int(np.argmax(np.where(inside, np.round(score, 9), -1.0)))]
    return tuple(float(value) for value in best_pose)
