"""Affine forms of a program's variables, and norms of them over a body bounded by cones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tpm_design.optimizers.conic import ConeKind, Cones, ConicProgram

FloatArray = NDArray[np.float64]

ALIKE = 1e-12
"""Half axes of an ellipse that differ by no more than this share make a circle."""


@dataclass(frozen=True)
class Form:
    """Σ ``shares``[name] · variable + ``constant`` (m)."""

    shares: Mapping[str, float] = field(default_factory=dict)
    constant: float = 0.0

    def __add__(self, other: Form | float) -> Form:
        if not isinstance(other, Form):
            return Form(self.shares, self.constant + other)
        names = [*self.shares, *(name for name in other.shares if name not in self.shares)]
        shares = {name: self.shares.get(name, 0.0) + other.shares.get(name, 0.0) for name in names}
        return Form(shares, self.constant + other.constant)

    def times(self, factor: float) -> Form:
        """The form multiplied by a number."""
        return Form({name: factor * share for name, share in self.shares.items()}, factor * self.constant)


def combined(forms: Sequence[Form], factors: Sequence[float]) -> Form:
    """Σ factor · form."""
    total = Form()
    for form, factor in zip(forms, factors, strict=True):
        if factor != 0.0:
            total = total + form.times(float(factor))
    return total


@dataclass
class Draft:
    """A conic program as it is written down: variables by name with their ranges (m), constraints on forms.
    ``inward``: by how much (m) every constraint is to be met."""

    inward: float = 0.0
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    _stated: list[tuple[ConeKind, tuple[Form, ...], FloatArray]] = field(default_factory=list)

    def helper(self, highest: float) -> Form:
        """A variable of its own between 0 and ``highest``."""
        name = f"helper {len(self.ranges)}"
        self.ranges[name] = (0.0, highest)
        return Form({name: 1.0})

    def highest(self, form: Form) -> float:
        """Largest value of a form within the ranges, 0 if that is less."""
        ends = (max(share * end for end in self.ranges[name]) for name, share in form.shares.items())
        return max(0.0, form.constant + sum(ends))

    def at_least_zero(self, form: Form) -> None:
        """form ≥ 0."""
        self._stated.append(("non-negative", (form + -self.inward,), np.zeros((1, 1))))

    def norm_at_points(self, across: Sequence[Form], within: Form, points: FloatArray) -> None:
        """‖across + point‖ ≤ within for each of ``points`` (N, len(across))."""
        offsets = np.column_stack([np.zeros(len(points)), points])
        self._stated.append(("second-order", (within + -self.inward, *across), offsets))

    def norm_over_ellipsoid(self, across: Sequence[Form], within: Form, axes: FloatArray) -> None:
        """‖across + axes u‖ ≤ within for every |u| ≤ 1, exactly; ``axes`` (len(across), k).

        Where the image of the ball is a ball of radius β in a subspace, the worst u points away in it:
        second-order cones. Else by the S-lemma, as in L. El Ghaoui, H. Lebret, SIAM J. Matrix Analysis 18(4),
        1997: there is a τ such that [[within − τ, 0, acrossᵀ], [0, τ I, axesᵀ], [across, axes, within I]] is
        positive semidefinite.
        """
        within = within + -self.inward
        rows, count = axes.shape
        basis, sizes, _ = np.linalg.svd(axes)
        rank = int(np.sum(sizes > ALIKE * sizes[0])) if sizes[0] > 0.0 else 0
        if rank == 0 or sizes[rank - 1] >= (1.0 - ALIKE) * sizes[0]:
            turned = [combined(across, column) for column in basis.T]
            longest = float(sizes[0]) if rank else 0.0
            inside, beside = turned[:rank], turned[rank:]
            if not beside:
                self._stated.append(("second-order", (within + -longest, *inside), np.zeros((1, rows + 1))))
                return
            farthest = self.helper(self.highest(within))
            self._stated.append(("second-order", (farthest + -longest, *inside), np.zeros((1, rank + 1))))
            self._stated.append(("second-order", (within, farthest, *beside), np.zeros((1, rows - rank + 2))))
            return
        side = 1 + count + rows
        share = self.helper(self.highest(within))
        table = [[Form() for _ in range(side)] for _ in range(side)]
        table[0][0] = within + share.times(-1.0)
        for k in range(count):
            table[1 + k][1 + k] = share
        for row in range(rows):
            place = 1 + count + row
            table[place][place] = within
            table[place][0] = table[0][place] = across[row]
            for k in range(count):
                table[place][1 + k] = table[1 + k][place] = Form({}, float(axes[row, k]))
        forms = tuple(form for line in table for form in line)
        self._stated.append(("semidefinite", forms, np.zeros((1, side * side))))

    def program(self, cost: Form, unit: float) -> ConicProgram:
        """The program of least ``cost`` in lengths of ``unit`` (m); variables in the order of ``ranges``."""
        names = list(self.ranges)
        lower, upper = (np.array([self.ranges[name][end] / unit for name in names]) for end in (0, 1))

        def row(form: Form) -> FloatArray:
            return np.array([form.shares.get(name, 0.0) for name in names])

        cones = []
        for kind, forms, offsets in self._stated:
            constants = np.array([form.constant for form in forms])
            matrix = np.array([row(form) for form in forms])
            cones.append(Cones(kind, matrix, (constants + offsets) / unit))
        return ConicProgram(row(cost), lower, upper, tuple(cones))
