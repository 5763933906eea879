"""One design out of a study's design space, for commands that evaluate one."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tpm_design.errors import UsageError, did_you_mean
from tpm_design.problem import Design, Variable, with_ties
from tpm_design.study.document import number
from tpm_design.study.study import Study
from tpm_design.study.sweep import design_names, design_value
from tpm_design.units import si_unit


def choose_design(study: Study, settings: Mapping[str, str]) -> tuple[Design, tuple[str, ...]]:
    """A design (SI), and a line for each free quantity that nobody chose.

    ``settings``: values in the study's units by name, as ``--set name=value`` gives them; they may change
    fixed quantities too and are held to the quantity's domain, not to its range. The rest: ``initial``, else
    the middle of the range, else the first value listed. Raises UsageError.
    """
    problem = study.problem
    names = design_names(problem)
    for name in settings:
        if name not in names:
            if name in problem.ties:
                raise tied_error(problem.ties, name)
            raise UsageError(f"this study has no quantity {name!r}", remedy=_remedy(name, names))
    variables = {variable.name: variable for variable in problem.variables}
    design: dict[str, float | str] = {}
    assumptions: list[str] = []
    for name in names:
        if name in settings:
            design[name] = _set_value(study, name, settings[name].strip())
        elif name in variables:
            value, reason = _assumed(variables[name])
            design[name] = value
            unit = si_unit(variables[name].dimension)
            text = value if isinstance(value, str) else study.units.written(value, unit)
            assumptions.append(f"{name} = {text} ({reason})")
        else:
            design[name] = problem.fixed[name]
    return with_ties(problem.ties, design), tuple(assumptions)


def tied_error(ties: Mapping[str, str], name: str) -> UsageError:
    """Why a tied parameter cannot be set by itself."""
    return UsageError(
        f"{name} equals {ties[name]} in this study", remedy=f"Set {ties[name]}: {name} follows."
    )


def _set_value(study: Study, name: str, text: str) -> float | str:
    value: float | str = text
    if name != "mode":
        parsed = number(text)
        if parsed is None or not math.isfinite(parsed) or abs(parsed) > 1e15:
            raise UsageError(
                f"{name} must be a number, not {text!r}",
                where="--set",
                remedy=f"Write {name}=… in the study's units, without the unit.",
            )
        value = float(parsed)
    try:
        return design_value(name, value, study.problem, study.units)
    except ValueError as error:
        raise UsageError(f"{name} {error}", where="--set", remedy="Choose another value.") from None


def _assumed(variable: Variable) -> tuple[float | str, str]:
    if variable.initial is not None:
        return variable.initial, "its initial value"
    if variable.values:
        return variable.values[0], "the first one listed"
    return 0.5 * (variable.lower + variable.upper), "the middle of its range"


def _remedy(name: str, names: list[str]) -> str:
    limbs = [other for other in names if other[:-1] == name and other[-1].isdigit()]
    if limbs:
        return f"Set {', '.join(limbs)}: the study gives each limb by itself."
    if name[:-1] in names and name[-1:].isdigit():
        return f"Set {name[:-1]}: the study gives all limbs together."
    return did_you_mean(name, names)
