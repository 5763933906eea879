"""Quadratic programs of a few variables whose constraints may be missed at a price."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tpm_design.optimizers.base import FloatArray


@dataclass(frozen=True)
class Program:
    """Steps s in [``lower``, ``upper``] (n,), ≤ 0 ≤, of small g·s + ½ s·B s with c + J s ≥ 0: ``curvature`` B
    (n, n) positive definite, ``gradient`` g (n,), ``constraints`` c (m,), ``jacobian`` J (m, n)."""

    curvature: FloatArray
    gradient: FloatArray
    constraints: FloatArray
    jacobian: FloatArray
    lower: FloatArray
    upper: FloatArray

    def with_constraints(self, constraints: FloatArray) -> Program:
        """The same with another c."""
        return replace(self, constraints=constraints)

    def around(self, point: FloatArray, radius: float) -> Program:
        """The same for steps of at most ``radius`` from a point (n,) of the unit cube, within it."""
        return replace(self, lower=np.maximum(-radius, -point), upper=np.minimum(radius, 1.0 - point))


@dataclass(frozen=True)
class Step:
    """``step`` (n,), the ``shortfall`` it leaves, ``multipliers`` (m,) of the constraints and ``descent``
    = g·s + ½ s·B s."""

    step: FloatArray
    shortfall: float
    multipliers: FloatArray
    descent: float


def elastic_step(program: Program, penalty: float) -> Step:
    """The step of least g·s + ½ s·B s + penalty · t + ½ t² with c + J s + t ≥ 0 and t ≥ 0.

    As the point nearest to the origin that satisfies inequalities, by non-negative least squares: C. L.
    Lawson and R. J. Hanson, Solving least squares problems, 1974, chapter 23.
    """
    from scipy.optimize import nnls

    size, count = len(program.gradient), len(program.constraints)
    # With B = L Lᵀ, z = Lᵀ s + L⁻¹ g and w = t + penalty the sum is ½ |(z, w)|² and a constant.
    inverse = np.linalg.inv(np.linalg.cholesky(program.curvature))
    origin = -inverse.T @ (inverse @ program.gradient)
    rows = np.zeros((count + 2 * size + 1, size + 1))
    rows[:count, :size] = program.jacobian @ inverse.T
    rows[:count, size] = 1.0
    rows[count : count + size, :size] = inverse.T
    rows[count + size : -1, :size] = -inverse.T
    rows[-1, size] = 1.0
    bounds = np.concatenate(
        [
            penalty - program.constraints - program.jacobian @ origin,
            program.lower - origin,
            origin - program.upper,
            [penalty],
        ]
    )
    lengths = np.linalg.norm(rows, axis=1)
    scale = max(1.0, float(np.abs(bounds / lengths).max()))
    matrix = np.vstack([rows.T / lengths, bounds / lengths / scale])
    target = np.zeros(size + 2)
    target[-1] = 1.0
    dual, _ = nnls(matrix, target, maxiter=30 * matrix.shape[1])
    residual = matrix @ dual - target
    unit = scale / max(-float(residual[-1]), np.finfo(float).tiny)
    step = np.clip(origin + inverse.T @ residual[:size] * unit, program.lower, program.upper)
    return Step(
        step,
        max(0.0, float(-(program.constraints + program.jacobian @ step).min(initial=0.0))),
        dual[:count] * unit / lengths[:count],
        float(program.gradient @ step + 0.5 * step @ program.curvature @ step),
    )
