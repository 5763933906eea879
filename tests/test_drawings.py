"""Line drawings: what they say is measured where they say it, and every word of them can be read."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tpm_design.errors import UsageError
from tpm_design.mechanisms import MECHANISMS, mechanism
from tpm_design.mechanisms.base import Drawing, MechanismKind
from tpm_design.report import write_drawing
from tpm_design.report.drawing import mechanism_figure
from tpm_design.report.example import example_figure
from tpm_design.report.good_pose import first_mode, good_pose
from tpm_design.report.marks import Angle, Length, marks
from tpm_design.report.skeleton import Skeleton, skeleton
from tpm_design.report.symbols import mathematics
from tpm_design.report.viewpoint import best_viewpoint
from tpm_design.units import Units

KINDS = [pytest.param(kind, id=kind.name) for kind in MECHANISMS.values()]


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> MechanismKind:
    found: MechanismKind = request.param
    return found


@pytest.fixture
def body(kind: MechanismKind) -> Skeleton:
    return body_of(kind)


def body_of(kind: MechanismKind) -> Skeleton:
    machine = kind.build(kind.example, {})
    mode = first_mode(machine)
    pose = kind.drawing.pose or good_pose(machine, mode)
    assert pose is not None
    found = skeleton(machine, mode, pose)
    assert found is not None
    return found


def test_what_a_mechanism_declares_for_its_drawing_is_there(kind: MechanismKind, body: Skeleton) -> None:
    drawing = kind.drawing
    assert len(drawing.joints) in {0, body.limbs.shape[1]}
    assert {drawing.driven, *drawing.parallelogram} - {""} <= set(drawing.joints)
    if drawing.driven:
        assert bool(drawing.slides_from) == (kind.actuator_unit == "m")
    for words in drawing.marks.values():
        for word in words:
            assert body.point(word, 0) is not None or body.direction(word, 0) is not None, word
    named = {name for name in drawing.marks if kind.parameter(name)}
    if named:
        assert {p.name for p in kind.parameters if p.dimension == "length" and p.default is None} <= named


def test_marks_measure_what_they_name(kind: MechanismKind, body: Skeleton) -> None:
    """On every limb: a parameter's line is as long as the parameter, its angle as wide."""
    for limb in range(len(body.limbs)):
        for mark in marks(body, limb):
            parameter = kind.parameter(mark.name)
            if parameter is None:
                continue
            values = body.mechanism.parameters[parameter.name]
            value = abs(values[limb if len(values) > 1 else 0])
            if isinstance(mark, Length):
                assert np.linalg.norm(mark.end - mark.start) == pytest.approx(value, rel=1e-9)
            elif isinstance(mark, Angle):
                first, last = mark.arc[0] - mark.vertex, mark.arc[-1] - mark.vertex
                opening = math.acos(first @ last / (np.linalg.norm(first) * np.linalg.norm(last)))
                assert opening == pytest.approx(value, rel=1e-9)


def test_rails_are_where_the_coordinates_say(kind: MechanismKind, body: Skeleton) -> None:
    if not kind.drawing.slides_from:
        pytest.skip("nothing slides")
    machine = body.mechanism
    pose = kind.drawing.pose or good_pose(machine, first_mode(machine))
    assert pose is not None
    coordinates = machine.ik([pose], first_mode(machine))[0]
    place = kind.drawing.joints.index(kind.drawing.driven)
    declared = kind.drawing.joints.index(kind.drawing.slides_from) if (
        kind.drawing.slides_from in kind.drawing.joints
    ) else None  # fmt: skip
    for limb, rail in enumerate(body.rails):
        reached = rail.start + coordinates[limb] * rail.direction
        assert np.allclose(reached, body.limbs[limb, place], atol=1e-9)
        if declared is not None:
            assert np.allclose(rail.start, body.limbs[limb, declared], atol=1e-9)


def test_joint_coordinates_are_marked_in_their_angle() -> None:
    """θ_i2 of the 3-URU at its joints, θ_i of the DELTA."""
    for name, drive, limbs in (("uru", "joint", (0,)), ("delta", "motor", (0, 1, 2))):
        found = body_of(MECHANISMS[name])
        machine, drawing = found.mechanism, found.drawing
        assert drawing.pose is not None
        angles = machine.ik([drawing.pose], first_mode(machine), drive=drive)[0]
        for limb in limbs:
            (mark,) = (m for m in marks(found, limb) if isinstance(m, Angle) and m.name.startswith("θ"))
            first, last = mark.arc[0] - mark.vertex, mark.arc[-1] - mark.vertex
            opening = math.acos(first @ last / (np.linalg.norm(first) * np.linalg.norm(last)))
            assert opening == pytest.approx(abs(angles[limb]), rel=1e-9)


def test_the_projection_is_orthographic_with_z_upward(body: Skeleton) -> None:
    view = best_viewpoint(body, marks(body))
    rows = np.vstack([view.page, view.toward])
    assert np.allclose(rows @ rows.T, np.eye(3), atol=1e-12)
    across, up = view.seen(np.array([0.0, 0.0, 1.0]))
    assert across == 0.0
    assert up > 0.5


@pytest.mark.parametrize("units", [None, Units("mm", "deg")], ids=["symbols", "dimensions"])
def test_words_stand_apart_and_on_the_page(kind: MechanismKind, units: Units | None) -> None:
    found = body_of(kind)
    machine = found.mechanism
    pose = kind.drawing.pose or good_pose(machine, first_mode(machine))
    assert pose is not None
    figure = mechanism_figure(machine, first_mode(machine), pose, units)
    assert figure is not None
    (axes,) = figure.axes
    page = figure.bbox
    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts}
    assert len(boxes) == len(axes.texts)
    for box in boxes.values():
        assert page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1
    for (one, first), (other, second) in itertools.combinations(boxes.items(), 2):
        width = min(first.x1, second.x1) - max(first.x0, second.x0)
        height = min(first.y1, second.y1) - max(first.y0, second.y0)
        assert width <= 0.0 or height <= 0.0, (one, other)


def test_every_joint_and_every_length_is_labelled(kind: MechanismKind) -> None:
    words = {text.get_text() for text in example_figure(kind).axes[0].texts}
    assert {"$O$", "$x$", "$y$", "$z$"} <= words
    found = body_of(kind)
    for letter in kind.drawing.joints:
        ends = ["i"] if found.shared(letter) else ["1", "2", "3"]
        assert {f"${letter}_{{{end}}}$" for end in ends} <= words
    for mark in marks(found):
        parameter = kind.parameter(mark.name)
        assert mathematics(parameter.symbol if parameter else mark.name, 1) in words


def test_a_mechanism_that_declares_no_drawing_is_drawn_without_names() -> None:
    bare = replace(MECHANISMS["orthoglide"], drawing=Drawing())
    machine = replace(mechanism("orthoglide", L=0.3, d=0.05), kind=bare)
    figure = mechanism_figure(machine, first_mode(machine), (0.02, -0.01, -0.03))
    assert figure is not None
    assert {text.get_text() for text in figure.axes[0].texts} == {"$x$", "$y$", "$z$", "$O$", "$P$"}


def test_limbs_whose_joints_meet_have_one_name_for_them() -> None:
    machine = mechanism("orthoglide", L=0.3)
    figure = mechanism_figure(machine, first_mode(machine), (0.02, -0.01, -0.03))
    assert figure is not None
    words = [text.get_text() for text in figure.axes[0].texts]
    assert "$B_{i}$" in words
    assert "$B_{1}$" not in words


def test_nothing_is_drawn_at_a_pose_out_of_reach() -> None:
    machine = mechanism("orthoglide", L=0.3)
    assert mechanism_figure(machine, first_mode(machine), (0.0, 0.4, 0.0)) is None


@pytest.mark.parametrize(
    ("symbol", "written"),
    [("f_i", "$f_{2}$"), ("θ_i2", r"$\theta_{22}$"), ("d_b", "$d_{b}$"), ("R", "$R$"),
     ("rail_i", r"$\mathrm{rail}_{2}$"), ("φ_di", r"$\phi_{d2}$"), ("a$b", r"a\$b"), ("Ж_i", "Ж_i")],
)  # fmt: skip
def test_symbols_are_set_as_mathematics_where_they_are(symbol: str, written: str) -> None:
    assert mathematics(symbol, 2) == written


def test_a_pose_that_the_example_cannot_reach_is_told(tmp_path: Path) -> None:
    kind = MECHANISMS["orthoglide"]
    lost = replace(kind, drawing=replace(kind.drawing, pose=(0.0, 9.0, 0.0)))
    with pytest.raises(UsageError, match="no pose at which the example of orthoglide can be drawn"):
        write_drawing(lost, tmp_path / "a.svg")
