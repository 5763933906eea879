"""Bounds over boxes of poses and machines hold for every mechanism, without naming any."""

from __future__ import annotations

import numpy as np
import pytest
from every_equation_kernel import bounds_over, values_at
from test_every_mechanism import KINDS, first_mode, sample_poses

from tpm_design.mechanisms.base import MechanismKind

ROUNDING = 1e-9
STEP = 1e-6
SHARE = 1e-3


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> MechanismKind:
    found: MechanismKind = request.param
    return found


def tolerances(kind: MechanismKind) -> dict[str, float]:
    """A thousandth of every length and ratio of the example; a thousandth of its reach where that is 0."""
    reach = kind.build(kind.example, {}).reach_radius()
    return {
        name: SHARE * (abs(value) or reach)
        for name, value in kind.example.items()
        if (parameter := kind.parameter(name)) is not None and parameter.dimension != "angle"
    }


def test_bounds_hold_all_over_a_box_of_poses_and_machines(kind: MechanismKind) -> None:
    random = np.random.default_rng(7)
    machine = kind.build(kind.example, {})
    mode = first_mode(machine)
    reach = machine.reach_radius()
    within = tolerances(kind) if kind.translational else {}
    enclosed = machine.enclosed_geometry(within)
    told = 0
    for pose in sample_poses(machine, mode, 30):
        half = reach * 10.0 ** random.uniform(-5.0, -1.5, 3)
        box = np.column_stack([pose - half, pose + half])
        bounds, slopes = bounds_over(enclosed, mode.signs, box)
        for _ in range(20):
            offsets = random.uniform(-1.0, 1.0, 3)
            if random.random() < 0.3:
                offsets = np.sign(offsets)
            other = kind.build(
                {
                    name: value
                    if name not in within
                    else tuple(value + random.uniform(-1.0, 1.0, kind.limb_count) * within[name])
                    for name, value in kind.example.items()
                },
                {},
            )
            place = pose + 0.999 * offsets * half
            values = values_at(other.geometry, mode.signs, place)
            known = np.isfinite(values)
            scale = ROUNDING * (1.0 + np.abs(values))
            assert (values >= bounds[:, 0] - scale)[known].all()
            assert (values <= bounds[:, 1] + scale)[known].all()
            told += int(np.isfinite(bounds).all(axis=1).sum())
            for k in range(3):
                step = np.zeros(3)
                step[k] = STEP * reach
                if not np.abs(offsets[k]) < 0.9 or half[k] < 20.0 * step[k]:
                    continue
                after = values_at(other.geometry, mode.signs, place + step)
                # a quotient of differences is a derivative somewhere between
                slope = (after - values) / step[k]
                loose = ROUNDING * (1.0 + np.abs(values)) / step[k]
                fine = np.isfinite(slope)
                assert (slope >= slopes[:, k, 0] - loose)[fine].all()
                assert (slope <= slopes[:, k, 1] + loose)[fine].all()
    assert told > 1000
