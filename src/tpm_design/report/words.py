"""What a study asks, in words with its own units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tpm_design.mechanisms.base import MechanismKind
from tpm_design.problem import Goal, Problem, Variable
from tpm_design.runs.tables import parameter_unit
from tpm_design.units import Units, si_unit
from tpm_design.workspace.regions import Box, Cylinder, Ellipsoid, Points, Shape, Sphere, Tilt

MOST_LISTED = 8


def asked(goal: Goal, units: Units, unit: str) -> str:
    """``≥ 20 mm``, ``minimise``, ``recorded``."""
    if goal.sense is not None:
        return "minimise" if goal.sense == "minimize" else "maximise"
    bounds = []
    if goal.minimum is not None:
        bounds.append(f"≥ {units.written(goal.minimum, unit)}")
    if goal.maximum is not None:
        bounds.append(f"≤ {units.written(goal.maximum, unit)}")
    return " and ".join(bounds) or "recorded"


def gap_percent(gap: float) -> str:
    """A share above a bound, in percent; never told to be less than a thousandth."""
    return f"{max(100.0 * gap, 0.001):.3g}"


def gap_text(goal: str, least: str, gap: float | None) -> str:
    """What a lower bound on the objective says of the best design; ``gap``: by which share it is above, None
    without a feasible one."""
    if gap is None:
        return f"No design that reaches the region has a {goal} below {least}, whatever else is asked of it."
    return (
        f"Optimality gap: at most {gap_percent(gap)} % above the shortest links that reach the region at all "
        f"({goal} of at least {least})."
    )


def options_text(goal: Goal, units: Units) -> str:
    """The metric's options in force: ``norm 2, drive motor``; empty where it has none."""
    parts = []
    for option in goal.metric.options:
        value = goal.options.get(option.name, option.default)
        if value is None:
            continue
        if option.kind == "point":
            parts.append(f"{option.name} {lengths_text(value, units)}")
        elif option.kind == "length":
            parts.append(f"{option.name} {units.written(value, 'm')}")
        elif option.kind == "number":
            parts.append(f"{option.name} {value:g}")
        else:
            parts.append(f"{option.name} {value}")
    return ", ".join(parts)


def lengths_text(values: Sequence[float], units: Units) -> str:
    """Lengths (m) of a point or of half axes: ``(200, 100, 50) mm``."""
    numbers = ", ".join(f"{units.from_si(value, 'm'):.6g}" for value in values)
    return f"({numbers}) {units.name('m')}"


def pose_text(kind: MechanismKind, pose: Sequence[float], units: Units) -> str:
    """A pose as users write it: ``(200, 100, 50) mm``, ``(alpha, beta, d) = (90 deg, 54 deg, 94 mm)``."""
    if kind.translational:
        return lengths_text(pose, units)
    values = ", ".join(units.written(value, unit) for value, unit in zip(pose, kind.pose_units, strict=True))
    return f"({', '.join(kind.pose)}) = ({values})"


def pose_unit_names(kind: MechanismKind, units: Units) -> str:
    """``mm``, or ``deg, deg, mm`` where they differ."""
    names = [units.name(unit) for unit in kind.pose_units]
    return names[0] if len(set(names)) == 1 else ", ".join(names)


def shape_text(shape: Shape, units: Units) -> str:
    """The useful region."""
    if isinstance(shape, Box):
        edges = " × ".join(f"{units.from_si(edge, 'm'):.6g}" for edge in shape.size)
        return f"a box of {edges} {units.name('m')}"
    if isinstance(shape, Cylinder):
        radius, height = units.written(shape.radius, "m"), units.written(shape.height, "m")
        return f"a cylinder along z of radius {radius} and height {height}"
    if isinstance(shape, Sphere):
        return f"a ball of radius {units.written(shape.radius, 'm')}"
    if isinstance(shape, Ellipsoid):
        return f"an ellipsoid of half axes {lengths_text(shape.semi_axes, units)}"
    if isinstance(shape, Tilt):
        tilt, height = units.written(shape.tilt, "rad"), units.written(shape.height, "m")
        return f"every tilt up to {tilt}, whichever way, over distances of {height}"
    assert isinstance(shape, Points)
    return f"{len(shape.points)} single poses"


def centre_text(problem: Problem, units: Units) -> str:
    """Where the region's centre is."""
    free = [v.name for v in problem.variables if v.name.startswith("center_")]
    if not free:
        centre = [float(problem.fixed[name]) for name in problem.kind.centre_names]
        if len(centre) == 1:
            name = problem.kind.centre_names[0].removeprefix("center_")
            return f"its centre at {name} = {units.written(centre[0], 'm')}"
        return f"its centre at {lengths_text(centre, units)}"
    axes = ", ".join(name.removeprefix("center_") for name in free)
    return (
        "its centre free" if len(free) == len(problem.kind.centre_names) else f"its centre free along {axes}"
    )


def range_text(problem: Problem, name: str, units: Units) -> str:
    """Where a quantity was searched."""
    if name in problem.ties:
        return f"equals {problem.ties[name]}"
    variable = next((variable for variable in problem.variables if variable.name == name), None)
    if variable is None:
        return "fixed"
    if variable.ratio_of is not None:
        return f"{variable.lower:.6g} … {variable.upper:.6g} × {variable.ratio_of}{_scale_text(variable)}"
    unit = si_unit(variable.dimension)
    name = "" if unit == "-" else f" {units.name(unit)}"
    if len(variable.values) > MOST_LISTED:
        return f"one of {len(variable.values)}"
    if variable.values:
        listed = ", ".join(
            value if isinstance(value, str) else f"{units.from_si(value, unit):.6g}"
            for value in variable.values
        )
        return f"one of {listed}{name}"
    low, high = units.from_si(variable.lower, unit), units.from_si(variable.upper, unit)
    side = ", on the octant's side" if variable.mirrored else ""
    return f"{low:.6g} … {high:.6g}{name}{side}{_scale_text(variable)}"


def _scale_text(variable: Variable) -> str:
    return ", log scale" if variable.scale == "log" else ""


def tolerances_text(kind: MechanismKind, tolerance: Mapping[str, float], units: Units) -> str:
    """Tolerances (SI) in the study's units: ``f ± 0.1 mm, r ± 0.1 mm``; empty where there are none."""
    return ", ".join(
        f"{name} ± {units.written(bound, parameter_unit(kind, name), 4)}"
        for name, bound in tolerance.items()
        if bound > 0.0
    )


def machines_text(kind: MechanismKind, tolerance: Mapping[str, float], units: Units) -> str:
    """For which machines something is proved."""
    tolerances = tolerances_text(kind, tolerance, units)
    if not tolerances:
        return "for the exact dimensions"
    return f"for every machine within {tolerances} (each limb by itself, axis directions exact)"
