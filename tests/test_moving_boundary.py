"""Volumes of neighbouring machines to first order: closed forms, homogeneity, and the ray volume itself."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tpm_design.mechanisms import MECHANISMS, mechanism
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.metrics import METRICS
from tpm_design.metrics.base import Measurement, Nearby
from tpm_design.metrics.context import Context
from tpm_design.metrics.neighbourhood import Neighbourhood
from tpm_design.workspace.aspects import RayField, mode_field, region_fields
from tpm_design.workspace.moving_boundary import (
    MovingBoundary,
    field_near,
    mode_field_near,
    moving_boundary,
)
from tpm_design.workspace.region_geometry import place
from tpm_design.workspace.regions import Box

NAMES = ("uru", "delta", "orthoglide", "linear_delta", "crr")
FLOORS = (None, 0.0, 0.08)
STEP = 1e-7

Parameters = dict[str, Any]


def machine(name: str, parameters: Parameters) -> tuple[Mechanism, Mode]:
    built = mechanism(name, **parameters)
    return built, built.mode_of({field.name: "+" * field.length for field in built.kind.mode_fields})


def random_parameters(name: str, seed: int) -> Parameters:
    """The example with each limb's lengths up to 5 % off, so that nothing is symmetrical."""
    random = np.random.default_rng(seed)
    return {
        p.name: _around(MECHANISMS[name].example[p.name], p.per_limb, random)
        if p.dimension == "length"
        else MECHANISMS[name].example[p.name]
        for p in MECHANISMS[name].parameters
        if p.name in MECHANISMS[name].example
    }


def _around(value: float, per_limb: bool, random: np.random.Generator) -> Any:
    return tuple(value * random.uniform(0.95, 1.05, 3)) if per_limb else value * random.uniform(0.95, 1.05)


def lengths(name: str, parameters: Parameters) -> list[str]:
    return [p.name for p in MECHANISMS[name].parameters if p.dimension == "length" and p.name in parameters]


def with_change(parameters: Parameters, name: str, limb: int, share: float) -> Parameters:
    """One length times 1 + ``share``."""
    if isinstance(parameters[name], float):
        return parameters | {name: parameters[name] * (1.0 + share)}
    values = list(parameters[name])
    values[limb] *= 1.0 + share
    return parameters | {name: tuple(values)}


def each_length(name: str, parameters: Parameters) -> list[tuple[str, int]]:
    return [
        (length, limb)
        for length in lengths(name, parameters)
        for limb in range(1 if isinstance(parameters[length], float) else 3)
    ]


def chosen(field: RayField, floor: float | None) -> int | None:
    return None if floor is None else field.largest()


def boundary_of(built: Mechanism, mode: Mode, floor: float | None, order: int = 9) -> MovingBoundary:
    field = mode_field(built, mode, order=order, sided=floor is not None, floor=floor or 0.0)
    return moving_boundary(built, mode, field, chosen(field, floor), floor)


def volume_near(boundary: MovingBoundary, built: Mechanism) -> float:
    return float(np.sum(mode_field_near(boundary, built).volumes))


def slope(boundary: MovingBoundary, name: str, parameters: Parameters, length: str, limb: int) -> float:
    """θ ∂V/∂θ of what is moved."""
    above, below = (
        volume_near(boundary, machine(name, with_change(parameters, length, limb, step))[0])
        for step in (STEP, -STEP)
    )
    return (above - below) / (2.0 * STEP)


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("name", NAMES)
def test_own_volume_and_scale(name: str, floor: float | None) -> None:
    """The machine's own volume to the last digit, and Euler's theorem: V is homogeneous of degree 3 in all
    lengths, so that Σ θ ∂V/∂θ = 3 V; for the sum over the rays as for the volume."""
    parameters = random_parameters(name, 3)
    built, mode = machine(name, parameters)
    boundary = boundary_of(built, mode, floor)
    volume = float(boundary.field.volumes.sum())
    assert volume > 0.0
    assert volume_near(boundary, built) == volume
    total = sum(slope(boundary, name, parameters, *which) for which in each_length(name, parameters))
    assert total == pytest.approx(3.0 * volume, rel=2e-7)


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_slopes_of_the_ray_volume(name: str, seed: int, floor: float | None) -> None:
    """Central differences of the traced volume, extrapolated from two steps, where the same rays are met.

    The difference of the two steps says how well the quotient itself is known.
    """
    parameters = random_parameters(name, seed)
    built, mode = machine(name, parameters)
    boundary = boundary_of(built, mode, floor)
    volume = float(boundary.field.volumes.sum())
    compared = 0
    for length, limb in each_length(name, parameters):
        found = [
            _traced(name, with_change(parameters, length, limb, step), floor, boundary)
            for step in (1e-5, -1e-5, 5e-6, -5e-6)
        ]
        if any(value is None for value in found):
            continue
        a, b, c, d = (value for value in found if value is not None)
        wide, narrow = (a - b) / 2e-5, (c - d) / 1e-5
        quotient, doubt = (4.0 * narrow - wide) / 3.0, abs(narrow - wide)
        deviation = abs(slope(boundary, name, parameters, length, limb) - quotient)
        assert deviation <= 1e-6 * volume + doubt, (length, limb)
        compared += 1
    assert compared >= 3


def _traced(name: str, parameters: Parameters, floor: float | None, boundary: MovingBoundary) -> float | None:
    """Volume of a machine if the same segments are met as in the boundary."""
    built, mode = machine(name, parameters)
    field = mode_field(built, mode, order=9, sided=floor is not None, floor=floor or 0.0)
    part = chosen(field, floor)
    kept = slice(None) if part is None else field.component == part
    same = np.array_equal(field.segments.ray[kept], boundary.field.segments.ray)
    return float(field.volumes[slice(None) if part is None else part].sum()) if same else None


def test_balls() -> None:
    """d_b = d_p, f = r = R: reach is the ball of radius 2R, V = 32πR³/3, and dV/df = its surface 16πR²: the
    hole of radius |f − r| has no volume to first order. With k = 1 an octant of it is one aspect."""
    size = 0.7
    ball = {"db": 0.3, "dp": 0.3, "f": size, "r": size, "k": 1.0}
    built = mechanism("uru", **ball)
    for octant, floor, share in (("any", None, 1.0), ("+++", None, 0.125), ("+++", 0.0, 0.125)):
        mode = built.mode_of({"octant": octant, "elbows": "+++"})
        field = mode_field(built, mode, order=12, sided=floor is not None)
        boundary = moving_boundary(built, mode, field, chosen(field, floor), floor)
        volume = share * 32.0 * math.pi * size**3 / 3.0
        larger = mechanism("uru", **ball | {"f": size * (1.0 + STEP), "r": size * (1.0 + STEP)})
        assert volume_near(boundary, built) == pytest.approx(volume, rel=1e-8)
        assert volume_near(boundary, larger) - volume_near(boundary, built) == pytest.approx(
            3.0 * STEP * volume, rel=1e-6
        )
        if floor is None:
            longer = mechanism("uru", **ball | {"f": size + STEP})
            change = volume_near(boundary, longer) - volume_near(boundary, built)
            assert change == pytest.approx(share * 16.0 * math.pi * size**2 * STEP, rel=1e-6)


@pytest.mark.parametrize("floor", [None, 0.05])
def test_equal_limbs_have_equal_shares(floor: float | None) -> None:
    """On planes of symmetry two limbs end a ray at once: each gets half, so that a third of the slope of all
    limbs' length is each one's."""
    parameters = {"db": 0.178, "dp": 0.06, "f": (0.198,) * 3, "r": 0.209, "k": 2.0}
    built, mode = machine("uru", parameters)
    boundary = boundary_of(built, mode, floor)
    shares = [slope(boundary, "uru", parameters, "f", limb) for limb in range(3)]
    whole = slope(boundary, "uru", parameters | {"f": 0.198}, "f", 0)
    assert shares == pytest.approx([whole / 3.0] * 3, rel=1e-7)


def test_slope_of_the_volume_beyond_its_rays() -> None:
    """Of 16² rays a square against differences of the volume by 48²."""
    parameters = {"db": 0.178, "dp": 0.06, "f": 0.198, "r": 0.209, "k": 2.0}
    built, mode = machine("uru", parameters)
    boundary = boundary_of(built, mode, 0.0, order=16)
    for length in ("db", "f", "r"):
        above, below = (
            mode_field(*machine("uru", with_change(parameters, length, 0, h)), order=48, sided=True)
            for h in (1e-3, -1e-3)
        )
        quotient = (above.volumes.max() - below.volumes.max()) / 2e-3
        assert slope(boundary, "uru", parameters, length, 0) == pytest.approx(
            quotient, abs=2e-3 * above.volumes.max()
        )


@pytest.mark.parametrize("floor", FLOORS)
def test_moved_ends(floor: float | None) -> None:
    """End by end as traced anew: off by the square of the step."""
    parameters = random_parameters("uru", 5)
    built, mode = machine("uru", parameters)
    boundary = boundary_of(built, mode, floor)
    errors = []
    for step in (2e-5, 1e-5):
        other, _ = machine("uru", with_change(parameters, "f", 1, step))
        moved = mode_field_near(boundary, other)
        field = mode_field(other, mode, order=9, sided=floor is not None, floor=floor or 0.0)
        kept = slice(None) if floor is None else field.component == field.largest()
        assert np.array_equal(field.segments.ray[kept], moved.segments.ray)
        errors.append(np.median(np.abs(field.segments.end[kept] - moved.segments.end)))
    assert errors[1] < 1e-10
    assert errors[1] <= 0.3 * errors[0] + 1e-12


def test_region_that_moves_along() -> None:
    """Parts of a region whose centre moves while the machine changes."""
    parameters = random_parameters("uru", 7)
    built, mode = machine("uru", parameters)
    other, _ = machine("uru", with_change(parameters, "r", 2, 1e-6))
    shape = Box((0.3, 0.25, 0.28))
    centres = (0.2, 0.18, 0.22), (0.2 + 2e-7, 0.18, 0.22 - 1e-7)
    regions = [place(shape, centre) for centre in centres]
    field, _ = region_fields(built, mode, regions[0], orders=(6, 3))
    expected, _ = region_fields(other, mode, regions[1], orders=(6, 3))
    boundary = moving_boundary(built, mode, field, None, 0.0)
    moved = field_near(boundary, other, regions[1].centre, regions[1].half)
    assert 0.0 < field.volumes.sum() < 0.99 * field.whole
    change = expected.volumes.sum() - field.volumes.sum()
    assert abs(change) > 1e-8 * field.whole
    assert moved.volumes.sum() - field.volumes.sum() == pytest.approx(change, rel=1e-3)


def near(measured: Measurement, *neighbours: Context) -> Nearby:
    assert measured.near is not None
    return measured.near(Neighbourhood(neighbours))


def slope_near(measured: Measurement, above: Context, below: Context) -> float:
    one, other = near(measured, above, below).values.tolist()
    return float(one - other) / (2.0 * STEP)


@pytest.mark.parametrize(
    ("metric", "options"),
    [
        ("reachable_volume", {}),
        ("singularity_free_volume", {"margin": 0.0, "home": None}),
        ("singularity_free_volume", {"margin": 0.1, "home": None}),
        ("singularity_free_volume", {"margin": 0.0, "home": (0.15, 0.15, 0.15)}),
    ],
)
def test_metrics_near(metric: str, options: dict[str, Any]) -> None:
    """A measurement says of its own design what it is, and of others its slope."""
    parameters = {"db": 0.178, "dp": 0.06, "f": 0.198, "r": 0.209, "k": 2.0}

    def context(share: float) -> Context:
        return Context(*machine("uru", with_change(parameters, "f", 0, share)), None, 1e-3, 9)

    measured = METRICS[metric].compute(context(0.0), options)
    own = near(measured, context(0.0))
    assert (own.values.tolist(), own.errors.tolist()) == ([measured.value], [measured.error])
    above, below = (METRICS[metric].compute(context(h), options).value for h in (1e-5, -1e-5))
    assert slope_near(measured, context(STEP), context(-STEP)) == pytest.approx(
        (above - below) / 2e-5, rel=1e-5
    )


MEANS = [
    ("robot_size", "aspect", "2"),
    *(
        (f"conditioning_{mean}", over, norm)
        for mean in ("mean", "share")
        for over in ("aspect", "region")
        for norm in ("2", "frobenius")
    ),
]


@pytest.mark.parametrize(("metric", "over", "norm"), MEANS)
def test_means_near(metric: str, over: str, norm: str) -> None:
    """Means over an aspect and over a region that is partly out of reach, against the metric itself."""
    parameters = {"db": 0.178, "dp": 0.06, "f": 0.198, "r": 0.19, "k": 2.0}
    options = {"norm": norm, "drive": "motor", "over": over, "threshold": 0.25}
    shape = Box((0.3, 0.25, 0.28))

    def context(length: str, share: float) -> Context:
        built, mode = machine("uru", with_change(parameters, length, 0, share))
        return Context(built, mode, place(shape, (0.2 + share, 0.18, 0.22)), 1e-3, 9)

    measured = METRICS[metric].compute(context("f", 0.0), options)
    own = near(measured, context("f", 0.0))
    assert own.values == pytest.approx(measured.value, rel=1e-12)
    assert own.errors == pytest.approx(measured.error, rel=1e-12, abs=1e-14)
    for length in ("db", "f", "r", "k"):
        above, below = (METRICS[metric].compute(context(length, h), options).value for h in (1e-5, -1e-5))
        assert slope_near(measured, context(length, STEP), context(length, -STEP)) == pytest.approx(
            (above - below) / 2e-5, rel=1e-4, abs=1e-6
        )


@pytest.mark.parametrize("metric", ["conditioning_mean", "conditioning_share", "robot_size"])
@pytest.mark.parametrize("name", NAMES)
def test_means_of_every_mechanism(name: str, metric: str) -> None:
    """Over the largest aspect, 1/κ₂ among them constant (3-CRR): to 1e-6 of their size."""
    parameters = random_parameters(name, 2)
    drive = MECHANISMS[name].drives[0]
    options = {"norm": "2", "drive": drive, "over": "aspect", "threshold": 0.25}

    def context(length: str, limb: int, share: float) -> Context:
        return Context(*machine(name, with_change(parameters, length, limb, share)), None, 1e-3, 9)

    for length, limb in each_length(name, parameters)[:4]:
        measured = METRICS[metric].compute(context(length, limb, 0.0), options)
        above, below = (
            METRICS[metric].compute(context(length, limb, h), options).value for h in (1e-5, -1e-5)
        )
        assert slope_near(
            measured, context(length, limb, STEP), context(length, limb, -STEP)
        ) == pytest.approx((above - below) / 2e-5, abs=1e-6 * max(1.0, measured.value))
