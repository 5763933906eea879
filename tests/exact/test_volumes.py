"""Volumes by rays: known balls, an independent grid's references, symmetries, honest errors, smoothness."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tpm_design.errors import ParameterError
from tpm_design.mechanisms import mechanism
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.metrics import METRICS
from tpm_design.metrics.context import Context
from tpm_design.workspace.aspects import RayField, locate, located, mode_field
from tpm_design.workspace.volume import VolumeKind, volume_at, workspace_volume

R1 = {"db": 0.3, "dp": 0.3, "f": 1.0, "r": 1.0, "k": 1.0}
R2 = R1 | {"dp": 0.0}
R3 = R2 | {"r": 0.8, "k": 0.5}
UNEQUAL = {
    "db": (0.3, 0.2, 0.25),
    "dp": (0.1, 0.05, 0.0),
    "f": (0.6, 0.5, 0.55),
    "r": (0.5, 0.6, 0.45),
    "k": (1.0, -1.5, 0.8),
}


def machine(parameters: dict[str, Any], octant: str = "+++", elbows: str = "+++") -> tuple[Mechanism, Mode]:
    built = mechanism("uru", **parameters)
    return built, built.mode_of({"octant": octant, "elbows": elbows})


def random_parameters(random: np.random.Generator) -> dict[str, Any]:
    return {
        "db": tuple(random.uniform(0.0, 0.4, 3)),
        "dp": tuple(random.uniform(0.0, 0.3, 3)),
        "f": tuple(random.uniform(0.4, 1.0, 3)),
        "r": tuple(random.uniform(0.4, 1.0, 3)),
        "k": tuple(random.uniform(0.4, 2.0, 3) * random.choice([-1.0, 1.0], 3)),
    }


def random_signs(random: np.random.Generator) -> str:
    return "".join(random.choice(["+", "-"], 3))


@pytest.mark.parametrize(
    ("parameters", "reachable", "free"),
    [(R1, 4 * math.pi / 3, 4 * math.pi / 3), (R2, 4.4632, 4.3750), (R3, 3.2392, 3.1790)],
)
def test_reference_designs(parameters: dict[str, float], reachable: float, free: float) -> None:
    """A 360³ grid, good to 3e-4, for R2 and R3."""
    built, mode = machine(parameters)
    assert workspace_volume(built, mode, "reachable").value == pytest.approx(reachable, rel=5e-4)
    assert workspace_volume(built, mode).value == pytest.approx(free, rel=5e-4)


def test_ball_and_octant() -> None:
    """d_b = d_p, f = r = R: 32πR³/3 and, k = 1, 4πR³/3, to nearly all digits."""
    parameters = R1 | {"f": 0.7, "r": 0.7}
    built, anywhere = machine(parameters, octant="any")
    assert workspace_volume(built, anywhere, "reachable").value == pytest.approx(32 * math.pi * 0.343 / 3)
    assert workspace_volume(*machine(parameters)).value == pytest.approx(4 * math.pi * 0.343 / 3)


@pytest.mark.parametrize("kind", ["reachable", "singularity_free"])
def test_scaling(kind: VolumeKind) -> None:
    scaled = {
        name: value if name == "k" else tuple(np.multiply(3.7, value)) for name, value in UNEQUAL.items()
    }
    one, many = (volume_at(*machine(p, elbows="+-+"), kind, 0.05, 9).value for p in (UNEQUAL, scaled))
    assert many == pytest.approx(3.7**3 * one, rel=1e-8)
    assert one > 0.0


@pytest.mark.parametrize("kind", ["reachable", "singularity_free"])
def test_cyclic_permutation_of_the_limbs(kind: VolumeKind) -> None:
    turned = {name: (*value[1:], value[0]) for name, value in UNEQUAL.items()}
    one = volume_at(*machine(UNEQUAL, "+-+", "++-"), kind, 0.0, 9)
    other = volume_at(*machine(turned, "-++", "+-+"), kind, 0.0, 9)
    assert one.value == pytest.approx(other.value, rel=1e-9)
    assert one.error == pytest.approx(other.error, rel=1e-6, abs=1e-12)


def test_any_octant() -> None:
    """Reachable volumes add up; aspects end at the coordinate planes."""
    octants = [a + b + c for a in "+-" for b in "+-" for c in "+-"]
    every = {
        kind: [volume_at(*machine(UNEQUAL, octant), kind, 0.0, 8).value for octant in octants]
        for kind in ("reachable", "singularity_free")
    }
    anywhere = machine(UNEQUAL, "any")
    assert volume_at(*anywhere, "reachable", 0.0, 8).value == pytest.approx(sum(every["reachable"]), rel=1e-9)
    free = volume_at(*anywhere, "singularity_free", 0.0, 8).value
    assert free == pytest.approx(max(every["singularity_free"]), rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_reachable_volume_by_counting(seed: int) -> None:
    """Against 400 000 random poses, four standard deviations."""
    random = np.random.default_rng(seed)
    built, mode = machine(random_parameters(random), random_signs(random))
    cube = built.reach_radius()
    poses = random.uniform(0.0, cube, (400_000, 3)) * mode.signs.octant
    share = float((built.margins(poses, mode)["reach"] >= 0.0).mean())
    deviation = cube**3 * math.sqrt(share * (1.0 - share) / 400_000)
    volume = workspace_volume(built, mode, "reachable")
    assert volume.value == pytest.approx(cube**3 * share, abs=4.0 * deviation + volume.error)


@pytest.mark.parametrize("margin", [0.05, 0.1, 0.3])
def test_margin(margin: float) -> None:
    """R1's octant is one aspect: so is what keeps the margin, which counting gives too."""
    built, mode = machine(R1)
    random = np.random.default_rng(7)
    poses = random.uniform(0.0, 2.0, (400_000, 3))
    margins = built.margins(poses, mode)
    kept = margins["reach"] >= 0.0
    for name in ("translation", "actuation", "rotation"):
        kept &= np.abs(np.nan_to_num(margins[name])) > margin
    share = float(kept.mean())
    deviation = 8.0 * math.sqrt(share * (1.0 - share) / 400_000)
    volume = workspace_volume(built, mode, margin=margin, rtol=2e-3)
    assert volume.value == pytest.approx(8.0 * share, abs=4.0 * deviation + volume.error)
    assert volume.value < workspace_volume(built, mode).value


@pytest.mark.parametrize("kind", ["reachable", "singularity_free"])
def test_errors_are_honest(kind: VolumeKind) -> None:
    """Random designs and modes, unequal limbs: a third of the true error is nearly always stated."""
    random = np.random.default_rng(11)
    honest, stated, true = [], 0.0, 0.0
    for _ in range(20):
        built, mode = machine(random_parameters(random), random_signs(random), random_signs(random))
        best = volume_at(built, mode, kind, 0.0, 40).value
        rough = volume_at(built, mode, kind, 0.0, 8)
        wrong = abs(rough.value - best)
        honest.append(wrong <= 3.0 * rough.error + 1e-5 * best)
        stated, true = stated + rough.error / best, true + wrong / best
    assert np.mean(honest) >= 0.85
    assert true <= stated
    assert true / 20 < (1e-3 if kind == "reachable" else 1e-2)


@pytest.mark.parametrize("kind", ["reachable", "singularity_free"])
@pytest.mark.parametrize("change", [{"f": 0.1, "r": -0.05}, {"db": 0.1}, {"f": -0.1, "dp": 0.05}])
def test_volumes_are_smooth_in_the_design(kind: VolumeKind, change: dict[str, float]) -> None:
    """Central differences at a fixed level: the difference falls with half the step."""
    start = {"db": 0.15, "dp": 0.06, "f": 0.55, "r": 0.45, "k": 1.0}

    def along(t: float) -> float:
        return volume_at(
            *machine({n: v + t * change.get(n, 0.0) for n, v in start.items()}), kind, 0.0, 8
        ).value

    wide, middle, narrow = ((along(h) - along(-h)) / (2.0 * h) for h in (2e-2, 1e-2, 5e-3))
    assert middle == pytest.approx(narrow, rel=1e-3)
    assert abs(middle - narrow) <= 0.5 * abs(wide - middle) + 1e-9
    assert abs(narrow) > 0.01


def test_home_chooses_the_aspect() -> None:
    """The aspects of homes on both sides of a locus, and none for a home out of reach."""
    built, mode = machine(R3)
    random = np.random.default_rng(3)
    poses = random.uniform(0.0, 1.8, (200_000, 3))
    margins = built.margins(poses, mode)
    code = np.where(
        margins["reach"] >= 0.0, 1 + (margins["translation"] > 0) + 2 * (margins["actuation"] > 0), 0
    )
    counts = np.bincount(code, minlength=5)
    cell = 1.8**3 / len(poses)
    context = Context(built, mode, None, 1e-4, 9)

    def volume(home: tuple[float, ...] | None) -> float:
        return METRICS["singularity_free_volume"].compute(context, {"margin": 0.0, "home": home}).value

    common = int(np.argmax(counts[1:])) + 1
    rare = [k for k in range(1, 5) if k != common and counts[k] > 200]
    inside = poses[code == common][0]
    assert volume(tuple(inside)) == volume(None) == pytest.approx(counts[common] * cell, rel=0.01)
    assert rare
    for other in rare:
        found = volume(tuple(poses[code == other][0]))
        assert 0.0 < found <= 1.2 * counts[other] * cell
    assert volume((1.8, 1.8, 1.8)) == 0.0


def middles(field: RayField) -> np.ndarray:
    """The middle (S, 3) of every segment."""
    parts = field.segments
    along = 0.5 * (parts.start + parts.end)[:, None]
    return np.asarray(
        np.array(field.origin) + along * np.array(field.scale) * field.rays.directions[parts.ray]
    )


def test_segments_lie_in_their_own_component() -> None:
    """All at once and one by one; by a coarser field the sides, at least, are told apart."""
    for parameters in (R3, UNEQUAL):
        built, mode = machine(parameters)
        field = mode_field(built, mode, order=8, sided=True)
        poses = middles(field)
        found = located(built, mode, field, poses)
        np.testing.assert_array_equal(found, field.component)
        assert [locate(built, mode, field, tuple(pose)) for pose in poses] == found.tolist()
        other = mode_field(built, mode, order=6, sided=True)
        by_other = located(built, mode, other, poses)
        met = by_other >= 0
        assert met.mean() > 0.95
        np.testing.assert_array_equal(other.sides[by_other[met]], field.segments.code[met])
        beyond = np.array([[2.0 * built.reach_radius()] * 3, poses[0], [-0.1, 0.1, 0.1]])
        assert located(built, mode, field, beyond).tolist() == [-1, found[0], -1]


def test_sides_and_middles_of_components() -> None:
    for parameters in (R3, UNEQUAL):
        field = mode_field(*machine(parameters), order=8, sided=True)
        assert len(field.sides) == len(field.middles) == len(field.volumes) > 1
        lengths, every = field.segments.end - field.segments.start, middles(field)
        for number in range(len(field.sides)):
            members = np.flatnonzero(field.component == number)
            longest = members[np.argmax(lengths[members])]
            assert set(field.segments.code[members].tolist()) == {field.sides[number]}
            np.testing.assert_allclose(field.middles[number], every[longest], rtol=1e-14)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"kind": "reachabel"}, "Did you mean 'reachable'"),
        ({"margin": 1.0}, "margin"),
        ({"margin": -0.1}, "margin"),
        ({"rtol": 0.0}, "rtol"),
    ],
)
def test_bad_requests(arguments: dict[str, Any], told: str) -> None:
    with pytest.raises(ParameterError, match=told):
        workspace_volume(*machine(R1), **arguments)


def test_nothing_reachable() -> None:
    """Legs so unequal that no pose suits all three."""
    built, mode = machine(R1 | {"f": (1.0, 0.1, 0.1), "r": (0.2, 0.1, 0.1)})
    for kind in ("reachable", "singularity_free"):
        assert workspace_volume(built, mode, kind).value == 0.0
