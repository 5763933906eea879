"""Random designs whose region is reachable, and samples of regions, for the tests in this folder."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpm_design.mechanisms import mechanism
from tpm_design.mechanisms.mechanism import FloatArray
from tpm_design.metrics.context import Context
from tpm_design.workspace.region_geometry import BOX, CYLINDER, PlacedRegion, place
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Shape, Sphere

SHAPES = ("box", "cylinder", "sphere", "ellipsoid")


def random_parameters(random: np.random.Generator) -> dict[str, Any]:
    """Equal limbs half of the time."""
    if random.random() < 0.5:
        f, r = random.uniform(0.4, 1.0, 2)
        return {
            "db": random.uniform(0.0, 0.4),
            "dp": 0.06,
            "f": f,
            "r": r,
            "k": random.choice([0.5, 1.0, 2.0]),
        }
    return {
        "db": tuple(random.uniform(0.0, 0.4, 3)),
        "dp": tuple(random.uniform(0.0, 0.3, 3)),
        "f": tuple(random.uniform(0.4, 1.0, 3)),
        "r": tuple(random.uniform(0.4, 1.0, 3)),
        "k": tuple(random.uniform(0.4, 2.0, 3) * random.choice([-1.0, 1.0], 3)),
    }


def random_signs(random: np.random.Generator) -> str:
    return "".join(random.choice(["+", "-"], 3))


def shape_of(name: str, s: float) -> Shape:
    shapes: dict[str, Shape] = {
        "box": Box((2.0 * s, 1.6 * s, 1.8 * s)),
        "cylinder": Cylinder(s, 1.5 * s),
        "sphere": Sphere(s),
        "ellipsoid": Ellipsoid((s, 0.6 * s, 0.8 * s)),
    }
    return shapes[name]


def reachable_context(
    random: np.random.Generator, name: str, *, whole: bool = False, samples: int = 9, octant: str = "+++"
) -> Context:
    """A random design, elbows and place; the region reachable and off the coordinate planes. ``whole``: no
    determinant changes sign in it, with a margin of 0.02."""
    while True:
        built = mechanism("uru", **random_parameters(random))
        elbows = "+++" if random.random() < 0.5 else random_signs(random)
        mode = built.mode_of({"octant": octant, "elbows": elbows})
        size = random.uniform(0.04, 0.12)
        centre = random.uniform(size + 0.02, 0.7, 3) * np.array(mode.signs.octant)
        region = place(shape_of(name, size), (float(centre[0]), float(centre[1]), float(centre[2])))
        context = Context(built, mode, region, 1e-3, samples)
        if not context.reachable or context.reach.value < 0.005:
            continue
        if whole and min(side.margin for side in context.sides) < 0.02:
            continue
        return context


def into(region: PlacedRegion, poses: FloatArray) -> FloatArray:
    """Poses (N, 3) moved into the region, towards its centre or its faces."""
    half, centre = np.array(region.half), np.array(region.centre)
    unit = (poses - centre) / half
    if region.form == BOX:
        unit = np.clip(unit, -1.0, 1.0)
    elif region.form == CYLINDER:
        unit[:, :2] /= np.maximum(1.0, np.linalg.norm(unit[:, :2], axis=1))[:, None]
        unit[:, 2] = np.clip(unit[:, 2], -1.0, 1.0)
    else:
        unit /= np.maximum(1.0, np.linalg.norm(unit, axis=1))[:, None]
    return np.asarray(centre + unit * half)


def inside(region: PlacedRegion, count: int, random: np.random.Generator) -> FloatArray:
    """Poses spread evenly through the region."""
    half, centre = np.array(region.half), np.array(region.centre)
    poses = centre + half * random.uniform(-1.0, 1.0, (2 * count, 3))
    kept = poses[np.linalg.norm(into(region, poses) - poses, axis=1) == 0.0] if region.form == BOX else poses
    if region.form != BOX:
        unit = (poses - centre) / half
        size = np.linalg.norm(unit[:, :2] if region.form == CYLINDER else unit, axis=1)
        kept = poses[size <= 1.0]
    return np.asarray(kept[:count])


def throughout(region: PlacedRegion, count: int, random: np.random.Generator) -> FloatArray:
    """Poses in the region, on its faces and at its edges."""
    half, centre = np.array(region.half), np.array(region.centre)
    return into(region, centre + half * random.uniform(-1.6, 1.6, (count, 3)))
