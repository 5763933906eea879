"""The largest inscribed bodies: closed forms, a search on a grid, and nothing larger beside them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tpm_design.errors import ParameterError, RefusedError, UsageError
from tpm_design.mechanisms import MECHANISMS, mechanism
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.optimizers.polytope import extents, largest_between
from tpm_design.synthesis.body_forms import BODIES, body_form
from tpm_design.synthesis.inscribed import InscribedBody, largest_body
from tpm_design.workspace.sampling import lattice

FloatArray = NDArray[np.float64]

ROOT2, ROOT3, ROOT6 = math.sqrt(2.0), math.sqrt(3.0), math.sqrt(6.0)
PRECISE = 1e-6
# the Orthoglide's determinant touches 0 with the square of the distance: its least margin of 1e-9 is met
# 3e-5 away
TOUCHING = 2e-4
# the solver's tolerance is on the volume, of which the sizes are the root
SOLVED = 1e-4


def octant_ball(radius: float) -> tuple[Mechanism, Mode]:
    """A 3-URU whose singularity-free region is the octant +++ of a ball: d_b = d_p, f = r, k = 1."""
    built = mechanism("uru", db=0.1, dp=0.1, f=0.5 * radius, r=0.5 * radius, k=1.0)
    return built, built.mode_of({"octant": "+++", "elbows": "+++"})


def three_cylinders(f: float, r: float, *, fold: bool) -> tuple[Mechanism, Mode]:
    """An isotropic 3-CRR: three cylinders of radius f + r about the axes, without those of |f − r|."""
    built = MECHANISMS["crr"].build({"f": f, "r": r}, {"fold": fold})
    return built, built.mode_of({"elbows": "+++"})


def orthoglide() -> tuple[Mechanism, Mode]:
    """Struts of 1 m; singular on the diagonal at t = 1/√6, and where all carriages meet, at |p| = 1 m."""
    built = mechanism("orthoglide", L=1.0)
    return built, built.mode_of({"carriages": "+++"})


def halves(found: InscribedBody | None) -> list[float]:
    assert found is not None
    half: list[float] = found.form.half(found.sizes).tolist()
    return half


# largest body with a corner (or an edge) at the planes, its far corner on the ball: Lagrange
IN_OCTANT = {
    "sphere": (1.0 / (1.0 + ROOT3),) * 3,
    "ellipsoid": (1.0 / (1.0 + ROOT3),) * 3,
    "box": (0.5 / ROOT3,) * 3,
    "cylinder": (math.sqrt(2.0 / 3.0) / (1.0 + ROOT2),) * 2 + (0.5 / ROOT3,),
}
# within all three cylinders: every pair of half sizes within the circle
IN_CYLINDERS = {"ellipsoid": (1.0,) * 3, "box": (1.0 / ROOT2,) * 3}
# and beside the axes, where the limbs are folded: half way between axis and cylinder
BESIDE_THE_AXES = {
    "box": (0.5 / ROOT2, 0.5 / ROOT2, 1.0 / ROOT2),
    "cylinder": (math.sqrt(2.0 / 3.0) / (1.0 + 1.0 / ROOT2),) * 2 + (0.5 / ROOT3,),
}


@pytest.mark.parametrize("name", BODIES)
def test_the_octant_of_a_ball(name: str) -> None:
    found = largest_body(*octant_ball(2.0), name)
    assert halves(found) == pytest.approx([2.0 * value for value in IN_OCTANT[name]], rel=PRECISE)
    assert found is not None and found.gap is not None and found.gap < PRECISE


@pytest.mark.xdist_group("crr")
@pytest.mark.parametrize("name", ["box", "ellipsoid"])
def test_three_cylinders(name: str) -> None:
    found = largest_body(*three_cylinders(0.6, 0.6, fold=False), name)
    assert halves(found) == pytest.approx([1.2 * value for value in IN_CYLINDERS[name]], rel=PRECISE)


def test_the_stroke_of_the_carriages_bounds_the_body() -> None:
    """A carriage of an orthogonal 3-CRR moves as far as the platform does along its axis."""
    limits = {"fold": False, "stroke": (-0.1, 0.3)}
    built = MECHANISMS["crr"].build({"f": 0.5, "r": 0.5}, limits)
    found = largest_body(built, built.mode_of({"elbows": "+++"}), "box")
    assert halves(found) == pytest.approx([0.2] * 3, rel=PRECISE)
    assert found is not None and found.centre == pytest.approx([0.1] * 3, rel=PRECISE)
    # each face lies on a bound of its own
    assert found.gap is not None and found.gap < PRECISE


@pytest.mark.parametrize("name", ["box", "cylinder"])
def test_no_body_holds_a_pose_at_which_a_limb_is_folded(name: str) -> None:
    found = largest_body(*three_cylinders(0.5, 0.5, fold=True), name)
    # which of the axes an edge lies along is free
    assert sorted(halves(found)) == pytest.approx(sorted(BESIDE_THE_AXES[name]), rel=PRECISE)


def test_links_that_differ_leave_a_ball_between_the_cylinders() -> None:
    found = largest_body(*three_cylinders(0.7, 0.4, fold=True), "sphere")
    assert halves(found) == pytest.approx([0.4] * 3, rel=PRECISE)


def test_a_determinant_that_touches_zero_without_a_change_of_sign_bounds_the_body() -> None:
    ball = largest_body(*orthoglide(), "sphere")
    assert halves(ball) == pytest.approx([0.5 * (1.0 + 1.0 / ROOT2)] * 3, rel=TOUCHING)
    cube = largest_body(*orthoglide(), "box")
    assert halves(cube) == pytest.approx([0.5 * (1.0 / ROOT3 + 1.0 / ROOT6)] * 3, rel=TOUCHING)
    assert cube is not None
    assert cube.centre == pytest.approx([0.5 * (1.0 / ROOT6 - 1.0 / ROOT3)] * 3, rel=10.0 * TOUCHING)


def test_proportions() -> None:
    # the far corner (2, 1, 1) s on the ball
    bar = largest_body(*octant_ball(1.0), "box", proportions=(2.0, 1.0, 1.0))
    assert halves(bar) == pytest.approx([1.0 / ROOT6, 0.5 / ROOT6, 0.5 / ROOT6], rel=PRECISE)
    # r, r, r/2 of a cylinder: (1 + √2)² r² + r² = 1
    disc = largest_body(*octant_ball(1.0), "cylinder", proportions=(2.0, 2.0, 1.0))
    radius = 1.0 / math.hypot(1.0 + ROOT2, 1.0)
    assert halves(disc) == pytest.approx([radius, radius, 0.5 * radius], rel=PRECISE)


def test_a_larger_margin_leaves_a_smaller_body_and_scale_changes_nothing() -> None:
    found = [largest_body(*octant_ball(1.0), "sphere", margin=margin) for margin in (0.1, 0.3, 0.6)]
    radii = [halves(one)[0] for one in found]
    assert radii == sorted(radii, reverse=True)
    assert IN_OCTANT["sphere"][0] > 1.05 * radii[0]
    for one in found:
        assert one is not None
        assert all(least.value - least.error >= least.asked for least in one.margins.values())
    scaled = largest_body(*octant_ball(100.0), "sphere", margin=0.3)
    assert halves(scaled) == pytest.approx([100.0 * radii[1]] * 3, rel=PRECISE)


def test_nothing_fits_where_no_pose_has_the_margin() -> None:
    # |det H| of a 3-URU is at most 1/√2
    assert largest_body(*octant_ball(1.0), "sphere", margin=0.75) is None


DESIGNS: dict[str, dict[str, Any]] = {
    "uru": {"db": 0.25, "dp": 0.1, "f": 0.6, "r": (0.5, 0.55, 0.52), "k": (1.0, 1.5, 0.8)},
    "delta": {"w": 0.2, "u": 0.05, "L": 0.5, "l": 1.1},
    "linear_delta": {"R": 0.15, "r": 0.07, "l": 0.3, "rail": 0.4},
}


def design(name: str) -> tuple[Mechanism, Mode]:
    built = mechanism(name, **DESIGNS[name])
    signs = {"uru": {"octant": "+++", "elbows": "+++"}, "delta": {"elbows": "+++"}}
    return built, built.mode_of(signs.get(name, {"carriages": "+++"}))


def broken(built: Mechanism, mode: Mode, poses: FloatArray, margin: float) -> NDArray[np.bool_]:
    """Poses that are out of reach or have a determinant within ``margin`` of 0, by the public margins."""
    found = built.margins(poses, mode)
    out = found["reach"] < 0.0
    for name in built.kind.determinants:
        out |= ~(np.abs(found[name]) >= margin)
    return np.asarray(out)


@pytest.mark.parametrize("name", ["uru", "delta"])
def test_the_ball_is_the_largest_that_a_grid_finds(name: str) -> None:
    from scipy.ndimage import distance_transform_edt

    (built, mode), margin, count = design(name), 0.1, 61
    found = largest_body(built, mode, "sphere", margin=margin)
    assert found is not None
    radius = built.reach_radius()
    step = 2.0 * radius / (count - 1)
    axes = np.linspace(-radius, radius, count)
    poses = np.stack(np.meshgrid(axes, axes, axes, indexing="ij"), axis=-1).reshape(-1, 3)
    free = ~broken(built, mode, poses, margin).reshape(count, count, count)
    deepest = float(distance_transform_edt(free).max()) * step
    # a point of the grid is within √3/2 steps of any pose, and so is the nearest one that is not free
    assert halves(found)[0] == pytest.approx(deepest, abs=ROOT3 * step)


@pytest.mark.parametrize(
    ("name", "body"),
    [("uru", "box"), ("uru", "ellipsoid"), ("delta", "cylinder"), ("linear_delta", "box")],
)
def test_the_body_is_free_and_nothing_larger_beside_it_is(name: str, body: str) -> None:
    (built, mode), margin = design(name), 0.1
    found = largest_body(built, mode, body, margin=margin)
    assert found is not None
    form, centre, sizes = found.form, np.asarray(found.centre), found.sizes

    def poses(at: FloatArray, of: FloatArray) -> FloatArray:
        return lattice(form.region(at, of), 60).reshape(-1, 3)

    assert not broken(built, mode, poses(centre, sizes), margin).any()
    for number in range(sizes.size):
        grown = sizes.copy()
        grown[number] *= 1.002
        assert broken(built, mode, poses(centre, grown), margin).any()
    # moved and reshaped, and 0.3 % larger
    random = np.random.default_rng(5)
    for _ in range(10):
        way = random.normal(size=3 + sizes.size)
        way *= 0.003 * sizes.max() / np.linalg.norm(way)
        other = sizes + way[3:]
        other *= (1.01 * found.volume / form.volume(other)) ** (1.0 / 3.0)
        assert broken(built, mode, poses(centre + way[:3], other), margin).any()


def test_the_largest_body_between_planes() -> None:
    faces = np.vstack([np.eye(3), -np.eye(3)])
    for name in ("box", "cylinder", "ellipsoid"):
        form = body_form(name)
        found = largest_between(form.unit, form.spread, faces, np.array([1.0, 1.0, 3.0, 1.0, 1.0, 1.0]), 10.0)
        assert found is not None
        assert form.half(found.sizes).tolist() == pytest.approx([1.0, 1.0, 2.0], abs=SOLVED)
        assert found.centre.tolist() == pytest.approx([0.0, 0.0, 1.0], abs=SOLVED)
    # an octahedron |x| + |y| + |z| ≤ 1: the cube of half edge 1/3, the ball of radius 1/√3
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    cube = largest_between("box", np.eye(3), signs, np.ones(8), 10.0)
    ball = largest_between("ellipsoid", np.eye(3), signs, np.ones(8), 10.0)
    assert cube is not None and ball is not None
    assert cube.sizes.tolist() == pytest.approx([1.0 / 3.0] * 3, abs=SOLVED)
    assert ball.sizes.tolist() == pytest.approx([1.0 / ROOT3] * 3, abs=SOLVED)
    assert largest_between("box", np.eye(3), faces, np.array([1.0, 1.0, 1.0, -2.0, 1.0, 1.0]), 10.0) is None


def test_extents_are_those_of_the_farthest_points() -> None:
    random = np.random.default_rng(3)
    half = np.array([0.3, 0.3, 0.7])
    for name in ("box", "cylinder", "ellipsoid"):
        form = body_form(name)
        sizes = half if name != "cylinder" else half[1:]
        normal = random.normal(size=3)
        normal /= np.linalg.norm(normal)
        points = lattice(form.region(np.zeros(3), sizes), 120).reshape(-1, 3)
        farthest = float((points @ normal).max())
        assert extents(form.unit, normal[None], half)[0] == pytest.approx(farthest, rel=2e-3)


@pytest.mark.parametrize(
    ("body", "margin", "proportions", "error"),
    [
        ("cone", 0.0, None, UsageError),
        ("box", 1.0, None, ParameterError),
        ("box", math.nan, None, ParameterError),
        ("sphere", 0.0, (1.0, 1.0, 1.0), UsageError),
        ("cylinder", 0.0, (1.0, 2.0, 1.0), UsageError),
        ("box", 0.0, (1.0, 0.0, 1.0), UsageError),
        ("box", 0.0, (1.0, 1.0), UsageError),
    ],
)
def test_arguments_without_a_meaning_are_refused(
    body: str, margin: float, proportions: tuple[float, ...] | None, error: type[Exception]
) -> None:
    with pytest.raises(error):
        largest_body(*octant_ball(1.0), body, margin=margin, proportions=proportions)


def test_poses_that_are_no_positions_hold_no_body() -> None:
    built = mechanism("puu", **MECHANISMS["puu"].example)
    with pytest.raises(RefusedError, match="not positions"):
        largest_body(built, built.mode_of({"carriages": "+++"}), "sphere")


def test_equal_searches_give_equal_bodies() -> None:
    one, other = (largest_body(*design("delta"), "sphere", margin=0.05) for _ in range(2))
    assert one is not None and other is not None
    assert (one.centre, one.shape) == (other.centre, other.shape)
