"""A multibody model put into a configuration, and the motions that its constraints leave it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from builders import LIMBS
from mjcf import FloatArray, MultibodyModel

STARTS = 100
STEPS = 50


@dataclass(frozen=True)
class Motions:
    """All motions that the constraints allow, one per column: velocities of the actuators (3, m), linear and
    angular velocity of the platform along the base's axes (6, m)."""

    actuators: FloatArray
    platform: FloatArray


class Assembled:
    """A compiled model, put into one configuration after another."""

    def __init__(self, multibody: MultibodyModel) -> None:
        self._model = mujoco.MjModel.from_xml_string(multibody.xml)
        self._data = mujoco.MjData(self._model)
        self._drives = multibody.drives
        mujoco.mj_fwdPosition(self._model, self._data)
        self._limb_of_row = np.array([_limb(self._model.equality(n).name) for n in self._data.efc_id])
        joints = [self._model.joint(int(n)) for n in self._model.dof_jntid]
        self._limb_of_freedom = np.array([_limb(joint.name) for joint in joints])
        bodies = [self._model.body(n).name for n in range(self._model.nbody)]
        sites = [self._model.site(n).name for n in range(self._model.nsite)]
        self._limb_of_point = np.array([_limb(name) for name in (*bodies, *sites)])

    def place(self, position: FloatArray, quaternion: FloatArray) -> None:
        """The platform at this position (3,) and orientation (4,), w first."""
        self._data.joint("platform").qpos[:] = np.concatenate([position, quaternion])

    def close(
        self, drive: str, actuators: FloatArray, centres: FloatArray, random: np.random.Generator
    ) -> None:
        """Finds the passive joints, limb by limb, with the platform held: Newton steps on MuJoCo's own
        residuals from random starts, until the limb closes with its actuator at the coordinate given (3,) and
        has joints at ``centres`` (3, n, 3). Raises AssertionError where no start leads there."""
        for limb, (target, expected) in enumerate(zip(actuators, centres, strict=True)):
            found = []
            for _ in range(STARTS):
                closed = self._closed_from(drive, limb, float(target), random)
                found.append((closed, self._distance_to_joints(limb, expected)))
                if max(found[-1]) < 1e-10:
                    break
            else:
                raise AssertionError(f"limb {limb}: least residual, distance of joints: {min(found)}")

    def residual(self) -> float:
        """The greatest violation of a constraint (m, rad)."""
        mujoco.mj_fwdPosition(self._model, self._data)
        return float(np.abs(self._data.efc_pos).max())

    def actuators(self, drive: str) -> FloatArray:
        """Coordinates (3,) of the actuators."""
        return np.array([self._coordinate(drive, limb) for limb in LIMBS])

    def motions(self, drive: str) -> Motions:
        """From the null space of the constraint Jacobian."""
        mujoco.mj_fwdPosition(self._model, self._data)
        _, singular, right = np.linalg.svd(self._jacobian())
        free = right[int((singular > 1e-8 * singular[0]).sum()) :].T
        start = self._model.joint("platform").dofadr[0]
        # MuJoCo has the angular velocity of a free body along the body's axes
        orientation = self._data.body("platform").xmat.reshape(3, 3)
        platform = np.vstack([free[start : start + 3], orientation @ free[start + 3 : start + 6]])
        return Motions(np.vstack([self._readout(drive, limb) for limb in LIMBS]) @ free, platform)

    def stiffness(self, locked: str | None) -> FloatArray:
        """Singular values of the constraints, with the actuators of a drive locked or none, largest first."""
        mujoco.mj_fwdPosition(self._model, self._data)
        rows = [] if locked is None else [self._readout(locked, limb) for limb in LIMBS]
        values: FloatArray = np.linalg.svd(np.vstack([self._jacobian(), *rows]))[1]
        return values

    def _closed_from(self, drive: str, limb: int, target: float, random: np.random.Generator) -> float:
        """What is left of the limb's residual and its actuator's after Newton steps from a random start."""
        rows, columns = self._limb_of_row == limb, self._limb_of_freedom == limb
        readout = self._readout(drive, limb)

        def violation() -> tuple[FloatArray, FloatArray]:
            mujoco.mj_fwdPosition(self._model, self._data)
            residual = np.append(self._data.efc_pos[rows], self._coordinate(drive, limb) - target)
            return residual, np.vstack([self._jacobian()[rows], readout])[:, columns]

        def move(step: FloatArray) -> None:
            velocity = np.zeros(self._model.nv)
            velocity[columns] = step
            mujoco.mj_integratePos(self._model, self._data.qpos, velocity, 1.0)

        move(random.uniform(-np.pi, np.pi, int(columns.sum())))
        return _newton(violation, move)

    def _jacobian(self) -> FloatArray:
        dense: FloatArray = self._data.efc_J.reshape(self._data.nefc, self._model.nv)
        return dense

    def _coordinate(self, drive: str, limb: int) -> float:
        parts = self._drives[drive][limb]
        return float(sum(part * self._data.joint(name).qpos[0] for name, part in parts.items()))

    def _readout(self, drive: str, limb: int) -> FloatArray:
        row = np.zeros(self._model.nv)
        for name, part in self._drives[drive][limb].items():
            row[self._model.joint(name).dofadr[0]] = part
        return row

    def _distance_to_joints(self, limb: int, centres: FloatArray) -> float:
        """The greatest distance (m) from one of ``centres`` (n, 3) to the nearest joint of the limb."""
        joints = np.vstack([self._data.xpos, self._data.site_xpos])[self._limb_of_point == limb]
        return float(np.linalg.norm(centres[:, None] - joints, axis=2).min(axis=1).max())


def _limb(name: str) -> int:
    """From the prefix of a name; −1: of no limb."""
    prefix = name.partition(".")[0]
    return int(prefix) if prefix.isdigit() else -1


def _newton(
    violation: Callable[[], tuple[FloatArray, FloatArray]], move: Callable[[FloatArray], None]
) -> float:
    """Least-norm Newton steps of at most one radian; the residual that is left."""
    residual, jacobian = violation()
    for _ in range(STEPS):
        if np.abs(residual).max() < 1e-13:
            break
        step = np.asarray(-np.linalg.lstsq(jacobian, residual, rcond=1e-10)[0], dtype=np.float64)
        move(step / max(1.0, float(np.abs(step).max())))
        residual, jacobian = violation()
    return float(np.abs(residual).max())
