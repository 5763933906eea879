"""The two points at given distances of three others: closed-form forward position."""

from __future__ import annotations

from collections.abc import Sequence

from tpm_design.arithmetic import Interval, root, sqr
from tpm_design.errors import ParameterError
from tpm_design.mechanisms.assembly import Assembly

Point = Sequence[Interval]


def _dot(u: Point, v: Point) -> Interval:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _cross(u: Point, v: Point) -> tuple[Interval, Interval, Interval]:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def _square(u: Point) -> Interval:
    return sqr(u[0]) + sqr(u[1]) + sqr(u[2])


def sphere_intersection(centres: Sequence[Point], radii: Sequence[Interval]) -> tuple[Assembly, ...]:
    """Both points (m), or none, each in a box that is proved to hold it alone.

    p = c_1 + α d + β e ± γ d × e with d, e the other centres from the first: |p − c_i| = r_i gives two linear
    equations for α and β, then γ. Raises ParameterError where the centres are in line or both points are so
    near to each other that they cannot be told apart.
    """
    first, second, third = centres
    d = [b - a for a, b in zip(first, second, strict=True)]
    e = [b - a for a, b in zip(first, third, strict=True)]
    across = _cross(d, e)
    dd, de, ee, area = _square(d), _dot(d, e), _square(e), _square(across)
    if area.lo <= 0.0:
        raise _not_apart("The driven points are in line")
    squares = [sqr(radius) for radius in radii]
    along_d, along_e = 0.5 * (squares[0] - squares[1] + dd), 0.5 * (squares[0] - squares[2] + ee)
    alpha = (along_d * ee - along_e * de) / area
    beta = (along_e * dd - along_d * de) / area
    middle = [alpha * u + beta * v for u, v in zip(d, e, strict=True)]
    height_squared = (squares[0] - _square(middle)) / area
    if height_squared.hi < 0.0:
        return ()
    if height_squared.lo <= 0.0:
        raise _not_apart("Two meet there")
    height = root(height_squared)
    return tuple(
        _assembly([c + m + side * height * n for c, m, n in zip(first, middle, across, strict=True)])
        for side in (1.0, -1.0)
    )


def _assembly(point: Point) -> Assembly:
    x, y, z = (0.5 * (side.lo + side.hi) for side in point)
    return Assembly((x, y, z), tuple((side.lo, side.hi) for side in point), unique=True)


def _not_apart(why: str) -> ParameterError:
    return ParameterError(
        f"The assemblies for these actuator coordinates do not stand apart. {why}.",
        remedy="Give actuator coordinates beside the singularity.",
    )
