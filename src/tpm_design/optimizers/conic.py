"""Linear costs over second-order and semidefinite cones, with a lower bound that does not trust the solver.

The bound is weak duality, worked out again from the solver's multipliers y: with each y_k moved into its
cone, c·x ≥ (c − Σ A_kᵀ y_k)·x − Σ b_k·y_k wherever all A_k x + b_k lie in theirs, and the first term is least
at an end of each variable's range. So it holds however early or badly the solver stopped, and is merely low
then.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tpm_design.errors import RefusedError

FloatArray = NDArray[np.float64]
ConeKind = Literal["non-negative", "second-order", "semidefinite"]

ROUNDING = 1e-13
"""Share of the sum of all magnitudes in the bound by which it is lowered for rounding."""


@dataclass(frozen=True)
class Cones:
    """K cones of one kind: ``matrix`` (m, n) x + ``offsets`` (K, m) lie in them, each row of ``offsets`` in
    one.

    "non-negative": all m values ≥ 0; "second-order": the first ≥ the norm of the others; "semidefinite": the
    rows of a symmetric matrix one after the other.
    """

    kind: ConeKind
    matrix: FloatArray
    offsets: FloatArray


@dataclass(frozen=True)
class ConicProgram:
    """Least ``cost`` · x for x (n,) between ``lower`` and ``upper``, all finite, in all ``cones``."""

    cost: FloatArray
    lower: FloatArray
    upper: FloatArray
    cones: tuple[Cones, ...]


@dataclass(frozen=True)
class ConicSolution:
    """``point`` (n,), None where no point is in all cones; ``bound``: no such point costs less, infinite
    where there is none."""

    point: FloatArray | None
    bound: float


def solve(program: ConicProgram) -> ConicSolution:
    """The least cost. Raises RefusedError where the solver fails."""
    status, point, multipliers = _solved(program)
    if point is not None:
        return ConicSolution(np.clip(point, program.lower, program.upper), _bound(program, multipliers))
    status, point, multipliers = _solved(_widened(program))
    if point is not None and _bound(_widened(program), multipliers) > 0.0:
        return ConicSolution(None, np.inf)
    raise RefusedError(
        f"The convex program could not be solved: {status}.",
        remedy="Choose ranges of similar size, or a method that searches.",
    )


def _solved(program: ConicProgram) -> tuple[str, FloatArray | None, list[FloatArray]]:
    """The solver's last word, its point, and a multiplier (K, m) for all cones."""
    import cvxpy as cp

    x = cp.Variable(program.cost.size)
    within = [x >= program.lower, x <= program.upper]
    stated = [_constraints(cp, cones, x) for cones in program.cones]
    problem: Any = cp.Problem(
        cp.Minimize(program.cost @ x), [*within, *(one for some in stated for one in some)]
    )
    try:
        with warnings.catch_warnings():
            # an inaccurate end only lowers the bound
            warnings.simplefilter("ignore")
            problem.solve(solver=cp.CLARABEL)
    except (cp.error.SolverError, ArithmeticError, ValueError) as error:
        return str(error).splitlines()[0] if str(error) else "the solver failed", None, []
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE) or x.value is None:
        return f"the solver ended with the word {problem.status!r}", None, []
    multipliers = [_multiplier(cones, some) for cones, some in zip(program.cones, stated, strict=True)]
    return problem.status, np.asarray(x.value, dtype=np.float64), multipliers


def _constraints(cp: Any, cones: Cones, x: Any) -> list[Any]:
    along, offsets = cones.matrix @ x, cones.offsets
    count, rows = offsets.shape
    if cones.kind == "non-negative":
        return [along + offset >= 0.0 for offset in offsets]
    if cones.kind == "second-order":
        ones = np.ones((1, count))
        others = cp.reshape(along[1:], (rows - 1, 1), order="C") @ ones + offsets[:, 1:].T
        return [cp.SOC(along[0] + offsets[:, 0], others, axis=0)]
    side = round(rows**0.5)
    return [cp.reshape(along + offset, (side, side), order="C") >> 0.0 for offset in offsets]


def _multiplier(cones: Cones, stated: list[Any]) -> FloatArray:
    """The multipliers (K, m), moved into the cones, which are their own duals."""
    count, rows = cones.offsets.shape
    if cones.kind == "non-negative":
        values = [np.maximum(0.0, np.ravel(one.dual_value)) for one in stated]
        return np.array(values).reshape(count, rows)
    if cones.kind == "second-order":
        first, others = stated[0].dual_value
        others = np.asarray(others, dtype=np.float64).reshape(rows - 1, count).T
        # larger by more than the norm's own rounding
        norm = np.linalg.norm(others, axis=1) * (1.0 + 1e-14)
        return np.column_stack([np.maximum(np.ravel(first), norm), others])
    found = []
    for one in stated:
        matrix = np.asarray(one.dual_value, dtype=np.float64)
        matrix = 0.5 * (matrix + matrix.T)
        least, size = np.linalg.eigvalsh(matrix)[0], np.abs(matrix).sum()
        found.append((matrix + max(0.0, 1e-14 * size - least) * np.eye(len(matrix))).ravel())
    return np.array(found).reshape(count, rows)


def _bound(program: ConicProgram, multipliers: list[FloatArray]) -> float:
    residual, magnitude = program.cost.copy(), np.abs(program.cost)
    constant = size = 0.0
    for cones, y in zip(program.cones, multipliers, strict=True):
        total = y.sum(axis=0)
        residual = residual - cones.matrix.T @ total
        magnitude = magnitude + np.abs(cones.matrix).T @ np.abs(y).sum(axis=0)
        constant += float(np.sum(cones.offsets * y))
        size += float(np.sum(np.abs(cones.offsets * y)))
    ends = np.where(residual > 0.0, program.lower, program.upper)
    farthest = np.maximum(np.abs(program.lower), np.abs(program.upper))
    rounding = ROUNDING * (size + float(magnitude @ farthest))
    return float(residual @ ends) - constant - rounding


def _widened(program: ConicProgram) -> ConicProgram:
    """How far all cones must be widened at least to hold one point: more than 0 where none is in all."""
    size = program.cost.size
    farthest = np.maximum(np.abs(program.lower), np.abs(program.upper))
    most = 1.0
    cones = []
    for one in program.cones:
        rows = one.matrix.shape[0]
        inward = np.zeros(rows)
        if one.kind == "non-negative":
            inward[:] = 1.0
        elif one.kind == "second-order":
            inward[0] = 1.0
        else:
            inward[:: round(rows**0.5) + 1] = 1.0
        cones.append(replace(one, matrix=np.column_stack([one.matrix, inward])))
        most += float(np.abs(one.matrix).sum(axis=0) @ farthest + np.abs(one.offsets).sum(axis=1).max())
    return ConicProgram(
        np.append(np.zeros(size), 1.0),
        np.append(program.lower, 0.0),
        np.append(program.upper, most),
        tuple(cones),
    )
