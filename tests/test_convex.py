"""The convex relaxation: closed forms, exact bodies, and a lower bound that no design is ever below."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import tpm_design as tpm
from tpm_design.errors import ParameterError, RefusedError
from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.mechanisms.outer_reach import Affine, ReachCone
from tpm_design.mechanisms.uru import planes_are_singular
from tpm_design.optimizers.conic import Cones, ConicProgram, solve
from tpm_design.problem import Design, Problem
from tpm_design.study.study import Study
from tpm_design.synthesis.bodies import body
from tpm_design.synthesis.bound import ReachBound, reach_bound, relaxed_designs
from tpm_design.synthesis.relaxation import refusal
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Points, Shape, Sphere

FloatArray = NDArray[np.float64]

STUDIES = Path(__file__).parents[1] / "studies"
EDGE, DISTANCE = 0.2, 0.02
CLOSE = 1e-6

URU = """\
version: 1
name: reach
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters: {db: {min: 0, max: 400}, dp: 60, f: {min: 50, max: 600}, r: {min: 50, max: 600}, k: 1}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [200, 200, 200], center: free}
objectives: [{metric: total_link_length, sense: minimize}]
constraints: [{metric: coverage, min: 1}, {metric: rotation_singularity_distance, min: 20}]
optimizer: {method: convex}
"""
REACH_ALONE = ("{metric: coverage, min: 1}, {metric: rotation_singularity_distance, min: 20}",
               "{metric: boundary_distance, min: 0}")  # fmt: skip
BEYOND_20 = (
    "center: free",
    "center: {x: {min: 120, max: 900}, y: {min: 120, max: 900}, z: {min: 120, max: 900}}",
)

ORTHOGLIDE = """\
version: 1
name: reach
units: {length: m, angle: deg}
mechanism:
  type: orthoglide
  parameters: {L: {min: 0.01, max: 9}}
  mode: {carriages: "+++"}
region:
  type: box
  size: [0.2, 0.2, 0.2]
  center: {x: {min: -1, max: 1}, y: {min: -1, max: 1}, z: {min: -1, max: 1}}
objectives: [{metric: total_link_length, sense: minimize}]
constraints: [{metric: coverage, min: 1}]
"""


def study_of(folder: Path, text: str, *pairs: tuple[str, str]) -> Study:
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return tpm.load_study(path)


def least(problem: Problem) -> float:
    """The bound on the sum of all links (m)."""
    found = reach_bound(problem)
    assert found is not None
    return found.least


# ------------------------------------------------------------------------------------- closed forms


def uru_of_short_base(share: float) -> float:
    """f + r (m) where one link is of 50 mm and d_b ``share`` of the other: R² = (a + μ + d_p − d_b)² +
    2 (a + μ)² with d_b = share (R − 50 mm)."""
    offset = EDGE + DISTANCE + 0.06 + 0.05 * share
    constant = offset**2 + 2 * (EDGE + DISTANCE) ** 2
    return float(max(np.roots([1.0 - share**2, 2.0 * offset * share, -constant])))


@pytest.mark.parametrize(
    ("pairs", "reach"),
    [
        # δ free: d_p − d_b from −0.34 to 0.06 m holds the best, −(edge/2 + distance)
        ([BEYOND_20], math.sqrt(EDGE**2 / 4 + 2 * (EDGE + DISTANCE) ** 2)),
        ([BEYOND_20, ("{min: 0, max: 400}", "{min: 0, max: 100}")], 0.359444),
        ([BEYOND_20, ("{min: 0, max: 400}", "{min: 0, max: 60}")], math.sqrt(3) * (EDGE + DISTANCE)),
        # the same from the distance to det H = 0, whose locus is the coordinate planes
        ([], 0.326803),
        ([("{min: 0, max: 400}", "{min: 0, max: 100}")], 0.359444),
        ([("{min: 0, max: 400}", "{min: 0, max: 60}")], 0.381051),
        # d_b up to a multiple of what is fixed; of f, where more would help: (f, r) = (R − 50, 50) mm
        ([BEYOND_20, ("{min: 0, max: 400}", "{ratio: dp, min: 0.1, max: 1.6666666666666667}")], 0.359444),
        ([BEYOND_20, ("{min: 0, max: 400}", "{ratio: f, min: 0, max: 2}")], 0.326803),
        ([BEYOND_20, ("{min: 0, max: 400}", "{ratio: f, min: 0, max: 0.1}")], uru_of_short_base(0.1)),
        ([BEYOND_20, ("{min: 0, max: 400}", "{ratio: r, min: 0.01, max: 0.3, scale: log}")],
         uru_of_short_base(0.3)),
        # the octant alone
        ([REACH_ALONE], math.sqrt(EDGE**2 / 4 + 2 * EDGE**2)),
        # no octant: the cube about the middle, d_p = d_b
        ([REACH_ALONE, ('"+++", elbows', "any, elbows"), ("center: free", "center: [0, 0, 0]")],
         math.sqrt(3) * EDGE / 2),
        # every octant, the centre mirrored into it
        ([('{octant: "+++", elbows: "+++"}', "best")], 0.326803),
        # limits of joints may keep poses on the planes out of reach
        ([('elbows: "+++"}', 'elbows: "+++"}\n  limits: {theta3: {min: -170, max: 170}}')],
         math.sqrt(EDGE**2 / 4 + 2 * EDGE**2)),
    ],
)  # fmt: skip
def test_the_smallest_uru_for_a_cube(tmp_path: Path, pairs: list[tuple[str, str]], reach: float) -> None:
    problem = study_of(tmp_path, URU, *pairs).problem
    assert least(problem) / 3 == pytest.approx(reach, rel=2e-6)
    assert least(problem) / 3 <= reach * (1 + CLOSE)


@pytest.mark.parametrize(("longest", "reachable"), [(326.81 / 1.8, True), (326.79 / 1.8, False)])
def test_links_in_a_ratio_are_only_so_long_together(tmp_path: Path, longest: float, reachable: bool) -> None:
    links = f"f: {{min: 50, max: {longest}}}, r: {{ratio: f, min: 0.5, max: 0.8}}"
    problem = study_of(
        tmp_path, URU, BEYOND_20, ("f: {min: 50, max: 600}, r: {min: 50, max: 600}", links)
    ).problem
    bound = reach_bound(problem)
    assert bound is not None
    assert bound.reachable is reachable
    start: Design = {"db": 0.1, "dp": 0.06, "f": 0.1, "r": 0.06, "k": 1.0, "mode": "+++ +++"}
    for design in relaxed_designs(problem, start, 9):
        assert 0.5 - CLOSE <= float(design["r"]) / float(design["f"]) <= 0.8 + CLOSE


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_ratio_is_bounded_as_its_best_value_is(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    """The least over all d_b = q f is that of the best q and f, each fixed in turn."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(0.05, 0.5)
    high = low + rng.uniform(0.05, 1.0)
    folder = tmp_path_factory.mktemp("ratio")
    free = least(
        study_of(
            folder, URU, BEYOND_20, ("{min: 0, max: 400}", f"{{ratio: f, min: {low}, max: {high}}}")
        ).problem
    )
    for _ in range(3):
        length, share = rng.uniform(50.0, 300.0), rng.uniform(low, high)
        fixed = least(
            study_of(
                folder, URU, BEYOND_20,
                ("db: {min: 0, max: 400}", f"db: {length * share}"),
                ("f: {min: 50, max: 600}", f"f: {length}"),
            ).problem
        )  # fmt: skip
        assert fixed >= free * (1 - CLOSE)


def test_the_smallest_isotropic_crr_for_a_cube() -> None:
    problem = tpm.load_study(STUDIES / "03-crr-cube.yaml").problem
    assert least(problem) / 3 == pytest.approx(0.3 / math.sqrt(2), rel=CLOSE)


def test_strokes_count(tmp_path: Path) -> None:
    """A cube of 0.3 m about the origin needs strokes as long; with less nothing reaches it."""
    text = (STUDIES / "03-crr-cube.yaml").read_text(encoding="utf-8")
    for end, reachable in (("150.001", True), ("149.999", False)):
        mode = 'mode: {elbows: "+++"}'
        limits = f"limits: {{stroke: {{min: -{end}, max: {end}}}}}"
        bound = reach_bound(study_of(tmp_path, text, (mode, f"{mode}\n  {limits}")).problem)
        assert bound is not None
        assert bound.reachable is reachable


@pytest.mark.parametrize(
    ("shape", "strut"),
    [
        (Box((0.2, 0.2, 0.2)), 0.1 * math.sqrt(2)),
        # across the rails: the two larger of three half edges
        (Box((0.2, 0.3, 0.4)), math.hypot(0.15, 0.2)),
        (Sphere(0.1), 0.1),
        (Ellipsoid((0.1, 0.15, 0.12)), 0.15),
        (Cylinder(0.1, 0.3), math.hypot(0.1, 0.15)),
        (Points(((0.0, 0.0, 0.0), (0.0, 0.0, 0.2), (0.0, 0.2, 0.0))), 0.1 * math.sqrt(2)),
    ],
)
def test_the_smallest_orthoglide(tmp_path: Path, shape: Shape, strut: float) -> None:
    """A strut square to its rail reaches L: the farthest pose across a rail, the region's middle at best on
    all three rails."""
    problem = replace(study_of(tmp_path, ORTHOGLIDE).problem, region=shape)
    assert least(problem) / 3 == pytest.approx(strut, rel=CLOSE)


def test_an_orthoglide_kept_off_the_planes(tmp_path: Path) -> None:
    """The far corner of the cube across a rail: L = √2 (edge + distance)."""
    problem = study_of(tmp_path, ORTHOGLIDE, ("min: -1,", "min: 0.12,")).problem
    assert least(problem) / 3 == pytest.approx(math.sqrt(2) * (EDGE + DISTANCE), rel=CLOSE)


# ------------------------------------------------------------------------------------- cones and bodies

CONVEX = [kind for kind in MECHANISMS.values() if kind.outer_reach is not None]
TURNED: dict[str, dict[str, Any]] = {
    "crr": {"azimuth": (0.1, 1.4, 0.3), "elevation": (0.2, -0.1, 1.3)},
    "crrr": {"azimuth": (0.1, 1.4, 0.3), "elevation": (0.2, -0.1, 1.3)},
    "prrr": {"slide_azimuth": (0.3, 1.4, 0.2), "slide_elevation": (0.2, -0.3, 1.2)},
    "linear_delta": {"tilt": (0.3, 0.2, 0.4)},
}


def values_of(kind: MechanismKind, random: np.random.Generator) -> dict[str, Any]:
    """A machine somewhat like the example, limbs unequal, axes turned."""
    values: dict[str, Any] = {
        name: tuple(value * random.uniform(0.7, 1.3, 3)) for name, value in kind.example.items()
    }
    return values | TURNED.get(kind.name, {})


def cones_of(kind: MechanismKind, values: dict[str, Any], limits: dict[str, Any]) -> tuple[ReachCone, ...]:
    reach = kind.outer_reach
    assert reach is not None
    return reach.cones({name: _per_limb(kind, values, name) for name in reach.angles}, limits)


def _per_limb(kind: MechanismKind, values: dict[str, Any], name: str) -> tuple[float, ...]:
    parameter = kind.parameter(name)
    assert parameter is not None
    if name in values:
        return tuple(values[name])
    assert parameter.default is not None
    return parameter.default


def worth(kind: MechanismKind, values: dict[str, Any], form: Affine, poses: FloatArray) -> FloatArray:
    """An affine form at poses (N, 3)."""
    lengths = sum(share * _per_limb(kind, values, name)[limb] for (name, limb), share in form.lengths.items())
    found: FloatArray = poses @ np.array(form.pose) + lengths + form.constant
    return found


def spare(kind: MechanismKind, values: dict[str, Any], cone: ReachCone, poses: FloatArray) -> FloatArray:
    """within − ‖across‖ at poses (N, 3)."""
    sides = np.array([worth(kind, values, side, poses) for side in cone.across]).reshape(-1, len(poses))
    found: FloatArray = worth(kind, values, cone.within, poses) - np.linalg.norm(sides, axis=0)
    return found


@pytest.mark.parametrize("kind", CONVEX, ids=lambda kind: kind.name)
def test_what_is_reachable_lies_in_all_cones(kind: MechanismKind) -> None:
    random = np.random.default_rng(3)
    limits_of = {limit.name for limit in kind.limits}
    limits: dict[str, Any] = {"swing": 1.2} if "swing" in limits_of else {}
    if "stroke" in limits_of and kind.name != "orthoglide":
        limits["stroke"] = (-0.25, 0.3)
    reached = 0
    for _ in range(4):
        values = values_of(kind, random)
        machine = kind.build(values, limits)
        poses = random.uniform(-1.0, 1.0, (4000, 3)) * machine.reach_radius()
        spares = np.min([spare(kind, values, c, poses) for c in cones_of(kind, values, limits)], axis=0)
        for signs in ("+", "-"):
            chosen = {f.name: "any" if f.any_allowed else signs * f.length for f in kind.mode_fields}
            inside = machine.margins(poses, machine.mode_of(chosen))["reach"] >= 0.0
            reached += int(inside.sum())
            assert spares[inside].min(initial=0.0) >= -1e-12
    assert reached > 50


@pytest.mark.parametrize("name", ["uru", "crr", "crrr", "prrr", "linear_delta", "orthoglide"])
def test_the_cones_are_the_outer_bounds_of_the_limbs(name: str) -> None:
    """Where a limb is stretched the leg margin changes sign with the least spare of the cones. (The DELTA's
    cones are wider.)"""
    kind = MECHANISMS[name]
    random = np.random.default_rng(4)
    # links alike have no inner bound
    values = values_of(kind, random)
    if "r" in values and "f" in values:
        values["r"] = values["f"]
    machine = kind.build(values, {})
    poses = random.uniform(-1.0, 1.0, (4000, 3)) * machine.reach_radius()
    spares = np.min([spare(kind, values, cone, poses) for cone in cones_of(kind, values, {})], axis=0)
    mode = machine.mode_of({f.name: "any" if f.any_allowed else "+" * f.length for f in kind.mode_fields})
    outside = machine.margins(poses, mode)["reach"] < 0.0
    assert outside[spares < 0.0].all()
    assert (spares > 0.0).any()
    if name not in ("linear_delta", "crr", "crrr", "prrr"):  # ends of rails, folded lines
        assert not outside[spares > 0.0].any()


SHAPES: tuple[Shape, ...] = (
    Box((0.2, 0.1, 0.15)),
    Sphere(0.1),
    Cylinder(0.1, 0.15),
    Ellipsoid((0.1, 0.06, 0.03)),
    Points(((0.0, 0.1, 0.0), (0.1, -0.02, 0.03), (0.05, 0.0, -0.1))),
)


def boundary(shape: Shape, count: int) -> FloatArray:
    """Points that hold the extreme ones of a shape, densely (N, 3)."""
    if isinstance(shape, Box):
        return np.array(list(itertools.product(*((-0.5 * edge, 0.5 * edge) for edge in shape.size))))
    if isinstance(shape, Points):
        return np.array(shape.points)
    if isinstance(shape, Cylinder):
        angle = np.linspace(0.0, 2 * math.pi, count)
        rim = np.column_stack([shape.radius * np.cos(angle), shape.radius * np.sin(angle), 0.0 * angle])
        end = np.array([0.0, 0.0, 0.5 * shape.height])
        return np.vstack([rim + end, rim - end])
    axes = (shape.radius,) * 3 if isinstance(shape, Sphere) else shape.semi_axes  # type: ignore[union-attr]
    directions = np.random.default_rng(0).normal(size=(40 * count, 3))
    found: FloatArray = directions / np.linalg.norm(directions, axis=1)[:, None] * np.array(axes)
    return found


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
@pytest.mark.parametrize("name", ["uru", "prrr", "linear_delta"])
def test_every_body_is_met_exactly(tmp_path: Path, name: str, shape: Shape) -> None:
    """With only the links free the least sum is that of the farthest poses of each limb, here by sampling."""
    kind = MECHANISMS[name]
    values = values_of(kind, np.random.default_rng(5))
    links = [p.name for p in kind.parameters if p.moving_link]
    centre = {"center_x": 0.12, "center_y": 0.15, "center_z": 0.2}
    problem = study_of(tmp_path, URU, ('octant: "+++"', "octant: any"), REACH_ALONE).problem
    fixed = {
        f"{key}{limb + 1}": value
        for key, per_limb in values.items()
        if key not in links
        for limb, value in enumerate(per_limb)
    }
    variables = {variable.name: variable for variable in problem.variables}
    free = [
        replace(variables["f"], name=f"{link}{limb}", lower=1e-3, upper=5.0)
        for link in links
        for limb in (1, 2, 3)
    ]
    modes = {"one": {f.name: "any" if f.any_allowed else "+" * f.length for f in kind.mode_fields}}
    problem = replace(
        problem, kind=kind, fixed={**fixed, **centre, "mode": "one"}, variables=tuple(free), modes=modes,
        region=shape,
    )  # fmt: skip
    poses = boundary(shape, 500) + np.array(list(centre.values()))
    farthest = 0.0
    for cone in cones_of(kind, values, {}):
        without = {**values, **dict.fromkeys(links, (0.0, 0.0, 0.0))}
        farthest += float(-spare(kind, without, cone, poses).min())
    assert least(problem) >= farthest * (1 - CLOSE)
    assert least(problem) == pytest.approx(farthest, rel=2e-4)


def test_a_body_is_as_low_as_its_points() -> None:
    direction = np.array([0.3, -0.5, 0.8])
    for shape in SHAPES:
        found = body(shape)
        assert found is not None
        sampled = float((boundary(shape, 2000) @ direction).min())
        assert found.lowest(direction) == pytest.approx(sampled, rel=1e-3)
        assert found.extent == pytest.approx(float(np.abs(boundary(shape, 2000)).max()), rel=1e-3)


def test_a_bound_that_moves_with_the_pose_is_refused() -> None:
    moving = Affine({}, (1.0, 0.0, 0.0))
    with pytest.raises(ParameterError, match="depends on the pose"):
        ReachCone((moving,), moving)


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.floats(0.0, 0.4), min_size=6, max_size=6),
    st.lists(st.floats(0.02, 0.4), min_size=3, max_size=3),
    st.lists(st.floats(1e-4, 0.5), min_size=3, max_size=3),
    st.floats(0.001, 0.05),
    st.integers(0, 2),
)
def test_a_plane_near_a_reachable_box_is_itself_reachable(
    dimensions: list[float], edges: list[float], corner: list[float], distance: float, axis: int
) -> None:
    """What ``planes_are_singular`` rests on: the middle of the face, moved to the plane, has each ρ_i between
    values that it has in the box."""
    names = itertools.product(("db", "dp"), range(3))
    ranges = {name: (value, value) for name, value in zip(names, dimensions, strict=True)}
    corner = list(corner)
    corner[axis] = min(corner[axis], distance)
    assume(planes_are_singular(ranges, {}, edges, distance))
    at = np.array(corner) + 0.5 * np.array(edges)
    at[axis] = 0.0
    grid = [np.linspace(low, low + edge, 3) for low, edge in zip(corner, edges, strict=True)]
    poses = np.array(list(itertools.product(*grid)))
    for limb in range(3):
        offset = (dimensions[3 + limb] - dimensions[limb]) * np.eye(3)[limb]
        values = np.linalg.norm(poses + offset, axis=1)
        assert values.min() - 1e-12 <= np.linalg.norm(at + offset) <= values.max() + 1e-12


def test_the_planes_of_study_01_are_sure_and_those_of_a_flat_box_are_not() -> None:
    ranges = {(name, limb): (0.0, 0.4) for name in ("db", "dp") for limb in range(3)}
    assert planes_are_singular(ranges, {}, (0.2, 0.2, 0.2), 0.02)
    assert not planes_are_singular(ranges, {}, (0.2, 0.2, 0.01), 0.02)
    assert not planes_are_singular(ranges, {"theta2": (0.0, 1.0)}, (0.2, 0.2, 0.2), 0.02)


# ------------------------------------------------------------------------------------- the solver's bound


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_the_bound_is_below_every_point_and_close(seed: int) -> None:
    """Least c·x over ‖x − m‖ ≤ ρ, as a second-order cone and as a semidefinite one: c·m − ρ‖c‖."""
    random = np.random.default_rng(seed)
    cost, middle, radius = random.normal(size=3), random.uniform(-1, 1, 3), float(random.uniform(0.01, 1.0))
    exact = float(cost @ middle - radius * np.linalg.norm(cost))
    ends = np.full(3, 3.0)
    ball = np.vstack([np.zeros(3), np.eye(3)])
    cone = Cones("second-order", ball, np.concatenate([[radius], -middle])[None, :])
    matrix, offset = np.zeros((16, 3)), np.diag(np.full(4, radius))
    for k in range(3):
        for place in (4 * k + 3, 12 + k):
            matrix[place, k] = 1.0
        offset[k, 3] = offset[3, k] = -middle[k]
    definite = Cones("semidefinite", matrix, offset.reshape(1, 16))
    for cones in (cone, definite):
        found = solve(ConicProgram(cost, -ends, ends, (cones,)))
        assert found.point is not None
        assert found.bound <= exact + 1e-12
        assert found.bound == pytest.approx(exact, abs=1e-6)
        assert float(cost @ found.point) == pytest.approx(exact, abs=1e-6)


def test_a_program_without_a_point_is_told_as_such() -> None:
    ball = np.vstack([np.zeros(2), np.eye(2)])
    apart = Cones("second-order", ball, np.array([[0.9, -1.0, 0.0], [0.9, 1.0, 0.0]]))
    program = ConicProgram(np.ones(2), np.full(2, -5.0), np.full(2, 5.0), (apart,))
    found = solve(program)
    assert found.point is None
    assert math.isinf(found.bound)
    wider = replace(apart, offsets=apart.offsets + np.array([0.2, 0.0, 0.0]))
    assert solve(replace(program, cones=(wider,))).point is not None


# ------------------------------------------------------------------------------------- studies


@pytest.mark.parametrize(
    ("pairs", "words"),
    [
        ([("total_link_length", "robot_size")], "total_link_length"),
        (
            [("coverage, min: 1", "coverage, min: 0.9"), ("_distance, min: 20", "_distance, min: -1")],
            "whole region",
        ),
        ([("sense: minimize", "sense: maximize")], "total_link_length"),
    ],
)
def test_what_has_no_relaxation_says_nothing_and_cannot_be_solved_so(
    tmp_path: Path, pairs: list[tuple[str, str]], words: str
) -> None:
    study = study_of(tmp_path, URU, *pairs)
    assert reach_bound(study.problem) is None
    with pytest.raises(RefusedError, match=words):
        study.optimize()


def test_free_directions_have_no_relaxation(tmp_path: Path) -> None:
    text = (STUDIES / "03-crr-cube.yaml").read_text(encoding="utf-8")
    study = study_of(
        tmp_path,
        text,
        ("    ax1: 0\n", "    ax1: 0\n    azimuth1: {min: 0, max: 10}\n    azimuth2: 90\n    azimuth3: 0\n"),
    )
    assert "azimuth is free" in str(refusal(study.problem))
    assert "puu" in str(refusal(tpm.load_study(STUDIES / "07-puu-tilt.yaml").problem))


def test_discrete_lengths_are_bounded_by_their_ends_and_solved_one_by_one(tmp_path: Path) -> None:
    study = study_of(tmp_path, URU, REACH_ALONE, ("f: {min: 50, max: 600}", "f: {values: [100, 180, 400]}"))
    assert least(study.problem) / 3 == pytest.approx(0.3, rel=CLOSE)
    start: dict[str, float | str] = {"k": 1.0, "mode": "+++ +++", "dp": 0.06}
    designs = relaxed_designs(study.problem, start, 100)
    assert {design["f"] for design in designs} == {0.1, 0.18, 0.4}
    totals = {value: min(value + float(d["r"]) for d in designs if d["f"] == value) for value in (0.1, 0.4)}
    assert totals == pytest.approx({0.1: 0.3, 0.4: 0.45}, rel=1e-6)
    assert len(relaxed_designs(study.problem, start, 2)) == 2


def test_no_feasible_design_is_below_the_bound() -> None:
    for name in ("01-uru-cube", "03-crr-cube", "04-orthoglide-velocity"):
        study = tpm.load_study(STUDIES / f"{name}.yaml")
        problem = replace(study.problem, constraints=study.problem.constraints[:1])
        run = replace(study, problem=problem, certification=None).optimize(budget=300)
        bound = run.result.bound
        assert isinstance(bound, ReachBound)
        feasible = [e.evaluation for e in run.result.entries if e.evaluation.status == "feasible"]
        assert feasible
        assert all(e.metrics["total_link_length"] >= bound.least for e in feasible)


def test_the_relaxation_is_the_optimum_where_its_design_meets_everything(tmp_path: Path) -> None:
    run = study_of(tmp_path, URU, REACH_ALONE).optimize()
    assert run.best is not None
    assert run.best.status == "feasible"
    assert run.best.metrics["total_link_length"] == pytest.approx(0.9, rel=1e-5)
    assert "Optimal" in run.status


def test_a_design_that_is_not_proved_is_not_called_optimal(tmp_path: Path) -> None:
    """At the optimum a limb is stretched: nothing is left for tolerances, nor for a search of larger ones."""
    run = study_of(tmp_path, f"{URU}certify: {{tolerance: {{f: 1}}}}\n", REACH_ALONE).optimize(budget=6)
    assert run.best is not None
    assert run.best.status == "feasible"
    assert run.verdict is not None
    assert run.verdict.outcome != "proved"
    assert "Optimal" not in run.status
    assert "not a design: its own is not proved" in run.status


def test_otherwise_it_is_a_lower_bound_and_names_what_is_missed(tmp_path: Path) -> None:
    run = study_of(tmp_path, URU).optimize()
    assert run.best is not None
    assert run.best.status == "infeasible"
    assert "Optimal" not in run.status
    assert "lower bound" in run.status
    assert "misses coverage" in run.status


def test_a_spent_budget_is_told(tmp_path: Path) -> None:
    """Three designs for each of two gear ratios."""
    ratios = ("k: 1}", "k: {values: [1, 2]}}")
    for budget, ending in ((6, "converged"), (5, "budget spent")):
        run = study_of(tmp_path, URU, REACH_ALONE, ratios).optimize(budget=budget)
        assert len(run.result.entries) == budget
        assert run.result.ending == ending


def test_a_study_that_nothing_reaches_is_told_so(tmp_path: Path) -> None:
    run = study_of(tmp_path, URU, ("max: 600", "max: 140")).optimize()
    assert run.best is None
    assert "No design within the ranges reaches the region" in run.status
