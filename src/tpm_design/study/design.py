"""One design out of a study's design space, for commands that evaluate one."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tpm_design.design_space import first_value, with_ratios, with_ties
from tpm_design.errors import UsageError, did_you_mean
from tpm_design.problem import Design, Problem, Variable
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
    given = {name: _set_value(study, name, text.strip()) for name, text in settings.items()}
    left = [variable for variable in problem.variables if variable.name not in given]
    assumptions = {variable.name: _assumption(study, variable) for variable in left}
    told = tuple(assumptions[name] for name in names if name in assumptions)
    return completed_design(problem, given), told


def completed_design(problem: Problem, given: Design) -> Design:
    """The design (SI) with what is ``given``; the rest as ``choose_design`` assumes it."""
    left = [variable for variable in problem.variables if variable.name not in given]
    values = {variable.name: first_value(variable) for variable in left if variable.ratio_of is None}
    known = {**problem.fixed, **values, **given}
    multiples = {v.name: multiple for v in left if (multiple := first_multiple(v)) is not None}
    return with_ties(problem.ties, with_ratios(problem.variables, multiples, known))


def first_multiple(variable: Variable) -> float | None:
    """As ``first_value`` for ratios, None for other variables."""
    return None if variable.ratio_of is None else float(first_value(variable))


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


def _assumption(study: Study, variable: Variable) -> str:
    value = first_value(variable)
    if isinstance(value, str):
        text = value
    elif variable.ratio_of is not None:
        text = f"{value:.6g} × {variable.ratio_of}"
    else:
        text = study.units.written(value, si_unit(variable.dimension))
    if variable.initial is not None:
        reason = "its initial value"
    else:
        reason = "the first one listed" if variable.values else "the middle of its range"
    return f"{variable.name} = {text} ({reason})"


def _remedy(name: str, names: list[str]) -> str:
    limbs = [other for other in names if other[:-1] == name and other[-1].isdigit()]
    if limbs:
        return f"Set {', '.join(limbs)}: the study gives each limb by itself."
    if name[:-1] in names and name[-1:].isdigit():
        return f"Set {name[:-1]}: the study gives all limbs together."
    return did_you_mean(name, names)
