"""What every registered mechanism must do, without naming any."""

from __future__ import annotations

import numpy as np
import pytest

from tpm_design.errors import ParameterError
from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.base import MechanismKind, Parameter
from tpm_design.mechanisms.mechanism import Mechanism, Mode

KINDS = [pytest.param(kind, id=kind.name) for kind in MECHANISMS.values()]


def first_mode(mechanism: Mechanism) -> Mode:
    return mechanism.mode_of({field.name: "+" * field.length for field in mechanism.kind.mode_fields})


def parameter_of(kind: MechanismKind, name: str) -> Parameter:
    found = kind.parameter(name)
    assert found is not None
    return found


def random_poses(mechanism: Mechanism, random: np.random.Generator, count: int) -> np.ndarray:
    """Poses in a box around all that the mechanism reaches."""
    half = np.asarray(mechanism.reach_half_axes())
    return mechanism.poses(random.uniform(-half, half, (count, 3)))


def unit_steps(mechanism: Mechanism) -> np.ndarray:
    """Rows: one coordinate of the pose alone, by the reach radius where it is a length, by 1 rad else."""
    radius = mechanism.reach_radius()
    return np.diag([radius if unit == "m" else 1.0 for unit in mechanism.kind.pose_units])


def sample_poses(mechanism: Mechanism, mode: Mode, count: int) -> np.ndarray:
    """Poses well inside the mode's workspace, seeded."""
    random = np.random.default_rng(5)
    radius = mechanism.reach_radius()
    poses = random_poses(mechanism, random, 20000)
    margins = mechanism.margins(poses, mode)
    inside = margins["reach"] > 0.05 * radius
    for name in mechanism.kind.determinants:
        inside &= np.abs(np.nan_to_num(margins[name])) > 0.05
    poses = poses[inside]
    steps = 0.01 * unit_steps(mechanism)
    for step in np.vstack([steps, -steps]):
        # off the ends of the joints' ranges as well
        poses = poses[~np.isnan(mechanism.ik(poses + step, mode)[:, 0])]
    return poses[:count]


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> MechanismKind:
    found: MechanismKind = request.param
    return found


@pytest.fixture
def machine(kind: MechanismKind) -> Mechanism:
    return kind.build(kind.example, {})


def test_every_field_of_the_documentation_is_filled(kind: MechanismKind) -> None:
    assert kind.title
    assert kind.source
    assert kind.parameters
    needed = {parameter.name for parameter in kind.parameters if parameter.default is None}
    assert needed <= set(kind.example) <= {parameter.name for parameter in kind.parameters}
    for thing in (*kind.parameters, *kind.mode_fields, *kind.limits):
        assert thing.description
    for singularity in kind.singularities:
        assert singularity.condition
        assert singularity.equation
    assert set(kind.determinants) <= {singularity.name for singularity in kind.singularities}


@pytest.mark.parametrize("drive_index", [0, 1])
def test_jacobian_is_the_derivative_of_the_inverse_map(machine: Mechanism, drive_index: int) -> None:
    if drive_index >= len(machine.kind.drives):
        pytest.skip("one drive only")
    drive = machine.kind.drives[drive_index]
    mode = first_mode(machine)
    poses = sample_poses(machine, mode, 40)
    assert len(poses) == 40
    jacobians = machine.jacobian(poses, mode, drive=drive)
    errors = []
    for step in (1e-3, 5e-4):
        slopes = np.stack(
            [
                (machine.ik(poses + h, mode, drive=drive) - machine.ik(poses - h, mode, drive=drive))
                / (2.0 * h.sum())
                for h in step * unit_steps(machine)
            ],
            axis=-1,
        )
        residual = jacobians @ slopes - np.eye(3)
        errors.append(np.abs(residual).max(axis=(1, 2)))
    small = errors[0] < 1e-8
    assert np.median(errors[0]) < 1e-2
    assert np.all(small | (errors[1] < 0.3 * errors[0]))


def test_margins_keep_their_promises(machine: Mechanism) -> None:
    mode = first_mode(machine)
    random = np.random.default_rng(6)
    half = np.asarray(machine.reach_half_axes())
    coordinates = random.uniform(-1.3 * half, 1.3 * half, (5000, 3))
    poses = machine.poses(coordinates)
    margins = machine.margins(poses, mode)
    inside = margins["reach"] >= 0.0
    assert 0 < inside.sum() < len(poses)
    assert np.array_equal(inside, ~np.isnan(machine.ik(poses, mode)).any(axis=1))
    for name in ("serial", *machine.kind.determinants):
        assert np.isnan(margins[name][~inside]).all()
        assert (np.abs(margins[name][inside]) <= 1.0 + 1e-12).all()
    assert (np.linalg.norm(coordinates[inside] / half, axis=1) <= 1.0).all()
    lengths = [unit == "m" for unit in machine.kind.pose_units]
    assert (np.linalg.norm(poses[inside][:, lengths], axis=1) <= machine.reach_radius()).all()
    back = machine.coordinates(poses)
    assert np.allclose(back, coordinates, rtol=1e-12, atol=1e-12)


def test_scale_changes_lengths_and_nothing_else(kind: MechanismKind, machine: Mechanism) -> None:
    scaled = kind.build(
        {
            name: value * (3.0 if parameter_of(kind, name).dimension == "length" else 1.0)
            for name, value in kind.example.items()
        },
        {},
    )
    mode = first_mode(machine)
    poses = sample_poses(machine, mode, 50)
    larger = np.array([3.0 if unit == "m" else 1.0 for unit in kind.pose_units])
    small, large = machine.margins(poses, mode), scaled.margins(larger * poses, mode)
    assert np.allclose(large["reach"], 3.0 * small["reach"], rtol=1e-12)
    for name in ("serial", *kind.determinants):
        assert np.allclose(large[name], small[name], atol=1e-12)
    rates = (larger / (3.0 if kind.actuator_unit == "m" else 1.0))[:, None]
    found, expected = scaled.jacobian(larger * poses, mode), rates * machine.jacobian(poses, mode)
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_limbs_may_change_places(kind: MechanismKind) -> None:
    """Dimensions handed on to the next limb are the same machine turned."""
    if kind.limb_rotation is None:
        pytest.skip("its limbs are not placed alike")
    random = np.random.default_rng(8)
    turn = np.array(kind.limb_rotation)
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    lengths = [p.name for p in kind.parameters if p.per_limb and p.domain == "positive"]
    values = {name: tuple(kind.example[name] * random.uniform(0.9, 1.1, 3)) for name in lengths}
    machine = kind.build({**kind.example, **values}, {})
    turned = kind.build({**kind.example, **{name: (v[2], v[0], v[1]) for name, v in values.items()}}, {})
    mode = first_mode(machine)
    poses = sample_poses(machine, mode, 30)
    here, there = machine.margins(poses, mode), turned.margins(poses @ turn.T, mode)
    for name, margins in here.items():
        assert np.allclose(there[name], margins, atol=1e-12), name
    drive = kind.transmission_drive or kind.drives[0]
    q = machine.ik(poses, mode, drive=drive)
    assert np.allclose(turned.ik(poses @ turn.T, mode, drive=drive), np.roll(q, 1, axis=1), atol=1e-12)


def test_inverse_then_forward_comes_back(machine: Mechanism) -> None:
    mode = first_mode(machine)
    poses = sample_poses(machine, mode, 5)
    for drive in machine.kind.drives:
        for pose, q in zip(poses, machine.ik(poses, mode, drive=drive), strict=True):
            found = machine.fk(q, mode, drive=drive)
            assert np.abs(found - pose).max(axis=1).min() < 1e-10


def test_impossible_parameters_are_refused_in_words(kind: MechanismKind) -> None:
    for parameter in kind.parameters:
        if parameter.default is not None:
            continue
        missing = {name: value for name, value in kind.example.items() if name != parameter.name}
        with pytest.raises(ParameterError, match=parameter.name):
            kind.build(missing, {})
        with pytest.raises(ParameterError, match=parameter.name):
            kind.build({**kind.example, parameter.name: float("nan")}, {})
    with pytest.raises(ParameterError, match="no parameter"):
        kind.build({**kind.example, "nonsense": 1.0}, {})


def test_unreachable_poses_have_no_coordinates(machine: Mechanism) -> None:
    mode = first_mode(machine)
    steps = np.vstack([np.eye(3), -np.eye(3), np.ones((1, 3))])
    far = machine.poses(10.0 * steps * np.asarray(machine.reach_half_axes()))
    assert np.isnan(machine.ik(far, mode)).all()
    assert np.isnan(machine.jacobian(far, mode)).all()
    assert (machine.margins(far, mode)["reach"] < 0.0).all()


def test_bad_poses_are_refused_in_words(machine: Mechanism) -> None:
    mode = first_mode(machine)
    for poses in ([[1.0, 2.0]], [[float("inf"), 0.0, 0.0]], [["a", "b", "c"]]):
        with pytest.raises(ParameterError):
            machine.ik(poses, mode)
    with pytest.raises(ParameterError, match="drive"):
        machine.ik([[0.1, 0.1, 0.1]], mode, drive="wind")
