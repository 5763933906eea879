"""The largest inscribed bodies: closed forms, an independent search on a grid, and nothing larger beside them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tpm_design as tpm
from tpm_design.checker import check_certificate
from tpm_design.errors import ParameterError, RefusedError, UsageError
from tpm_design.mechanisms.mechanism import Mechanism, Mode
from tpm_design.optimizers.polytope import extents, largest_between
from tpm_design.synthesis.body_forms import BODIES, body_form
from tpm_design.synthesis.inscribed import InscribedBody, largest_body
from tpm_design.workspace.sampling import lattice
from tests.cli.command_line import tpm_design, written

FloatArray = NDArray[np.float64]

ROOT2, ROOT3, ROOT6 = math.sqrt(2.0), math.sqrt(3.0), math.sqrt(6.0)
PRECISE = 1e-6
# the Orthoglide's determinant touches 0 with the square of the distance: its least margin of 1e-9 is met
# 3e-5 away
TOUCHING = 2e-4


def octant_ball(radius: float) -> tuple[Mechanism, Mode]:
    """A 3-URU whose singularity-free region is the octant +++ of a ball: d_b = d_p, f = r, k = 1."""
    built = tpm.mechanism("uru", db=0.1, dp=0.1, f=0.5 * radius, r=0.5 * radius, k=1.0)
    return built, built.mode_of({"octant": "+++", "elbows": "+++"})


def three_cylinders(f: float, r: float, *, fold: bool) -> tuple[Mechanism, Mode]:
    """An isotropic 3-CRR: three cylinders of radius f + r about the axes, without those of |f − r|."""
    from tpm_design.mechanisms import MECHANISMS

    built = MECHANISMS["crr"].build({"f": f, "r": r}, {"fold": fold})
    return built, built.mode_of({"elbows": "+++"})


def orthoglide() -> tuple[Mechanism, Mode]:
    """Struts of 1 m; singular on the diagonal at t = 1/√6, and where all carriages meet, at |p| = 1 m."""
    built = tpm.mechanism("orthoglide", L=1.0)
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
IN_CYLINDERS = {
    "sphere": (1.0,) * 3,
    "ellipsoid": (1.0,) * 3,
    "box": (1.0 / ROOT2,) * 3,
    "cylinder": (math.sqrt(2.0 / 3.0),) * 2 + (1.0 / ROOT3,),
}
# and beside the axes, where the limbs are folded: half way between axis and cylinder
BESIDE_THE_AXES = {
    "sphere": (0.5,) * 3,
    "ellipsoid": (0.5,) * 3,
    "box": (0.5 / ROOT2, 0.5 / ROOT2, 1.0 / ROOT2),
    "cylinder": (math.sqrt(2.0 / 3.0) / (1.0 + 1.0 / ROOT2),) * 2 + (0.5 / ROOT3,),
}


@pytest.mark.parametrize("name", BODIES)
def test_the_octant_of_a_ball(name: str) -> None:
    found = largest_body(*octant_ball(2.0), name)
    assert halves(found) == pytest.approx([2.0 * value for value in IN_OCTANT[name]], rel=PRECISE)
    assert found is not None and found.gap is not None and found.gap < PRECISE


@pytest.mark.parametrize("name", BODIES)
def test_three_cylinders(name: str) -> None:
    found = largest_body(*three_cylinders(0.6, 0.6, fold=False), name)
    assert halves(found) == pytest.approx([1.2 * value for value in IN_CYLINDERS[name]], rel=PRECISE)


@pytest.mark.parametrize("name", BODIES)
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
    cube = largest_body(*octant_ball(1.0), "box", proportions=(1.0, 1.0, 1.0))
    assert halves(cube) == pytest.approx([0.5 / ROOT3] * 3, rel=PRECISE)
    # the far corner (2, 1, 1) s on the ball
    bar = largest_body(*octant_ball(1.0), "box", proportions=(2.0, 1.0, 1.0))
    assert halves(bar) == pytest.approx([1.0 / ROOT6, 0.5 / ROOT6, 0.5 / ROOT6], rel=PRECISE)
    # r, r, r/2 of a cylinder: (1 + √2)² r² + r² = 1
    disc = largest_body(*octant_ball(1.0), "cylinder", proportions=(2.0, 2.0, 1.0))
    radius = 1.0 / math.hypot(1.0 + ROOT2, 1.0)
    assert halves(disc) == pytest.approx([radius, radius, 0.5 * radius], rel=PRECISE)


def test_a_larger_margin_leaves_a_smaller_body_and_scale_changes_nothing() -> None:
    small, large = octant_ball(1.0), octant_ball(100.0)
    volumes = []
    for margin in (0.0, 0.1, 0.3, 0.6):
        found = largest_body(*small, "sphere", margin=margin)
        scaled = largest_body(*large, "sphere", margin=margin)
        assert halves(scaled) == pytest.approx([100.0 * value for value in halves(found)], rel=PRECISE)
        assert found is not None
        volumes.append(found.volume)
        assert all(one.value - one.error >= one.asked for one in found.margins.values())
    assert volumes == sorted(volumes, reverse=True)
    assert volumes[0] > 1.1 * volumes[1]


def test_nothing_fits_where_no_pose_has_the_margin() -> None:
    # |det H| of a 3-URU is at most 1/√2
    assert largest_body(*octant_ball(1.0), "sphere", margin=0.75) is None


DESIGNS: dict[str, dict[str, Any]] = {
    "uru": {"db": 0.25, "dp": 0.1, "f": 0.6, "r": (0.5, 0.55, 0.52), "k": (1.0, 1.5, 0.8)},
    "delta": {"w": 0.2, "u": 0.05, "L": 0.5, "l": 1.1},
    "linear_delta": {"R": 0.15, "r": 0.07, "l": 0.3, "rail": 0.4},
}


def design(name: str) -> tuple[Mechanism, Mode]:
    built = tpm.mechanism(name, **DESIGNS[name])
    signs = {"uru": {"octant": "+++", "elbows": "+++"}, "delta": {"elbows": "+++"}}
    return built, built.mode_of(signs.get(name, {"carriages": "+++"}))


def broken(built: Mechanism, mode: Mode, poses: FloatArray, margin: float) -> NDArray[np.bool_]:
    """Poses that are out of reach or have a determinant within ``margin`` of 0, by the public margins."""
    found = built.margins(poses, mode)
    out = found["reach"] < 0.0
    for name in built.kind.determinants:
        out |= ~(np.abs(found[name]) >= margin)
    return np.asarray(out)


@pytest.mark.parametrize("name", DESIGNS)
def test_the_ball_is_the_largest_that_a_grid_finds(name: str) -> None:
    from scipy.ndimage import distance_transform_edt

    (built, mode), margin, count = design(name), 0.1, 81
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


@pytest.mark.parametrize("name", DESIGNS)
@pytest.mark.parametrize("body", BODIES)
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
    for unit, volume in (("box", 1.0), ("cylinder", 1.0), ("ellipsoid", 1.0)):
        spread = np.eye(3) if unit != "cylinder" else np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        found = largest_between(unit, spread, faces, np.array([1.0, 1.0, 3.0, 1.0, 1.0, 1.0]), 10.0)  # type: ignore[arg-type]
        assert found is not None
        assert (spread @ found.sizes).tolist() == pytest.approx([1.0, 1.0, 2.0 * volume], abs=1e-6)
        assert found.centre[2] == pytest.approx(1.0, abs=1e-6)
    # an octahedron |x| + |y| + |z| ≤ 1: the cube of half edge 1/3, the ball of radius 1/√3
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    cube = largest_between("box", np.eye(3), signs, np.ones(8), 10.0)
    ball = largest_between("ellipsoid", np.eye(3), signs, np.ones(8), 10.0)
    assert cube is not None and ball is not None
    assert cube.sizes.tolist() == pytest.approx([1.0 / 3.0] * 3, abs=1e-6)
    assert ball.sizes.tolist() == pytest.approx([1.0 / ROOT3] * 3, abs=1e-6)
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
    from tpm_design.mechanisms import MECHANISMS

    built = tpm.mechanism("puu", **MECHANISMS["puu"].example)
    with pytest.raises(RefusedError, match="not positions"):
        largest_body(built, built.mode_of({}), "sphere")


STUDY = """\
version: 1
name: inscribed
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters: {db: 100, dp: 60, f: {min: 100, max: 500, initial: 250}, r: 250, k: 1}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [70, 70, 70], center: free}
objectives: [{metric: total_link_length, sense: minimize}]
constraints: [{metric: coverage, min: 1}, {metric: conditioning_min, min: 0.2}]
"""


def region_text(output: str) -> str:
    return output[output.index("\nregion:") + 1 :].split("\n\n")[0]


@pytest.mark.parametrize("body", ["cylinder", "ellipsoid"])
def test_the_region_that_is_printed_can_be_pasted(tmp_path: Path, body: str) -> None:
    study = written(tmp_path, STUDY)
    shown = tpm_design("inscribe", study, "--body", body, "--margin", "0.1")
    assert shown.code == 0
    assert "Assumed: f = 250 mm" in shown.output and "Sampled, not proved" in shown.output
    before, after = STUDY.split("region: {type: box, size: [70, 70, 70], center: free}\n")
    pasted = written(tmp_path, f"{before}{region_text(shown.output)}{after}", "pasted.yaml")
    data = json.loads(tpm_design("evaluate", pasted, "--json").output)
    assert data["metrics"]["coverage"]["value"] == 1.0
    told = json.loads(tpm_design("inscribe", study, "--body", body, "--margin", "0.1", "--json").output)
    assert told["verified"] == "sampled" and told["volume"]["unit"] == "mm³"
    assert told["region"]["type"] == body
    assert all(one["value"] - one["error"] >= one["asked"] for one in told["margins"].values())
    assert all(0.0 < one["growth"] < 1e-3 * one["value"] for one in told["sizes"].values())


def test_a_proved_body_is_proved_again_by_other_means(tmp_path: Path) -> None:
    study, target = written(tmp_path, STUDY), tmp_path / "body.json"
    options = ("--body", "sphere", "--margin", "0.1", "--certify", "--output", target, "--workers", "1")
    shown = tpm_design("inscribe", study, *options, "--json")
    assert shown.code == 0
    told = json.loads(shown.output)
    assert told["verified"] == "proved" and 0.0 < told["shrunk"] <= 0.01
    assert told["region"]["radius"] == pytest.approx(
        (1.0 - told["shrunk"]) * told["largest_found"]["radius"], rel=1e-8
    )
    certificate = json.loads(target.read_text(encoding="utf-8"))
    floors = [one["floor"] for one in certificate["statements"] if one["kind"] == "determinant"]
    assert len(floors) == 3 and min(floors) >= 0.1
    assert certificate["region"]["half"][0] == pytest.approx(1e-3 * told["region"]["radius"], rel=1e-12)
    assert check_certificate(target).sound


def test_a_proof_with_too_few_boxes_says_so(tmp_path: Path) -> None:
    study = written(tmp_path, f"{STUDY}certify: {{tolerance: {{f: 0.1}}, boxes: 1}}\n")
    target = tmp_path / "body.json"
    shown = tpm_design("inscribe", study, "--body", "box", "--certify", "--output", target, "--workers", "1")
    assert shown.code == 5
    assert "Not proved" in shown.output
    assert json.loads(target.read_text(encoding="utf-8"))["outcome"] == "undecided"


def test_a_study_with_no_room_ends_with_its_own_code(tmp_path: Path) -> None:
    shown = tpm_design("inscribe", written(tmp_path, STUDY), "--body", "sphere", "--margin", "0.8")
    assert shown.code == 3
    assert "No sphere fits" in shown.errors and "--margin" in shown.errors


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--body", "cone"], "no body 'cone'"),
        (["--body", "box", "--margin", "1"], "no margin"),
        (["--body", "box", "--proportions", "1,x,1"], "no proportions"),
        (["--body", "sphere", "--proportions", "1,1,1"], "as long as it is wide"),
        (["--body", "box", "--output", "body.json"], "--certify"),
        (["--body", "box", "--set", "g=1"], "no quantity 'g'"),
        (["--body", "box", "--set", "f=0"], "f cannot be 0"),
        ([], "--body"),
    ],
)
def test_bad_input_gets_one_message(tmp_path: Path, options: list[str], told: str) -> None:
    shown = tpm_design("inscribe", written(tmp_path, STUDY), *options)
    assert shown.code == 2
    assert told in shown.errors and "Traceback" not in shown.errors


def test_a_mechanism_without_positions_is_refused() -> None:
    study = Path(__file__).parents[1] / "studies" / "07-puu-tilt.yaml"
    shown = tpm_design("inscribe", study, "--body", "sphere")
    assert shown.code == 2
    assert "not positions" in shown.errors


def test_equal_searches_give_equal_bodies() -> None:
    built, mode = design("uru")
    one, other = (largest_body(built, mode, "ellipsoid", margin=0.05) for _ in range(2))
    assert one is not None and other is not None
    assert (one.centre, one.sizes.tolist()) == (other.centre, other.sizes.tolist())
    assert replace(one, sizes=other.sizes).shape == other.shape
