"""The commented study that ``tpm-design init`` writes."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from tpm_design.errors import UsageError
from tpm_design.mechanisms.base import MechanismKind, Parameter
from tpm_design.study.faults import shown
from tpm_design.study.model import NAME, NAME_REMEDY
from tpm_design.study.plain import flow_yaml
from tpm_design.study.registries import registries
from tpm_design.units import Units, si_unit

_UNITS = Units("mm", "deg")
_LIMITS = {"range": "{min: …, max: …}", "number": "…", "switch": "true or false"}


def template(name: str, kind: MechanismKind) -> str:
    """A study of the mechanism that runs as it is, built from what the mechanism declares.

    Lengths with a positive domain are free around the mechanism's example, everything else is fixed at it.
    Raises UsageError on a name that a study cannot have.
    """
    if not re.fullmatch(NAME, name):
        raise UsageError(f"a study cannot have the name {shown(name)}", remedy=NAME_REMEDY)
    free = [p for p in kind.parameters if p.domain == "positive" and p.dimension == "length"]
    given = [parameter for parameter in kind.parameters if parameter.name in kind.example]
    lines = [_parameter(parameter, kind, parameter in free) for parameter in given]
    signs = ", ".join(f'{field.name}: "{"+" * field.length}"' for field in kind.mode_fields)
    mode = f"\n  mode: {{{signs}}}     # or `best`: every inequivalent working mode is tried" if signs else ""
    limits = "\n".join(
        f"  #   {limit.name}: {_LIMITS[limit.kind]}    {limit.description}" for limit in kind.limits
    )
    limits = f"\n  # limits there are:\n{limits}" if limits else ""
    reach = kind.farthest_reach({parameter: (value, value) for parameter, value in kind.example.items()})
    region = _region(kind, _round(_UNITS.from_si(reach, "m") / 6))
    return f"""\
# A study for tpm-design. `tpm-design validate` checks it, `tpm-design optimize` runs it.
version: 1
name: {flow_yaml(name)}
units: {{length: mm, angle: deg}}    # of every number in this file; mm, cm, m, in; deg, rad
mechanism:
  type: {kind.name}    # {kind.title}
  # number: fixed; {{min, max, initial}}: free, initial may be left out; {{values: [1, 2]}}: one of these;
  # {{equals: f}}: always the value of f; {{ratio: f, min: 0.5, max: 2}}: free as a multiple of f;
  # scale: log in a range: small values searched as finely as large ones
  parameters:
{chr(10).join(lines)}{mode}{limits}
  limits: {{}}
{region}
objectives:
{_objective(kind)}
constraints:
{chr(10).join(_constraints(kind))}
optimizer: {{method: multistart, budget: 400, seed: 1}}    # budget: designs evaluated
accuracy: {{volume: 1e-3}}    # relative error of volumes and averages
"""


def _region(kind: MechanismKind, edge: float) -> str:
    if not kind.translational:
        return f"""\
# The poses the robot must serve: every tilt up to one, whichever way, over a height of distances d.
# center: {{d: …}} places it; free: the search does.
region: {{type: tilt, tilt: 20, height: {edge:g}, center: free}}"""
    return f"""\
# The poses the robot must serve: box {{size}}, cylinder {{radius, height}}, sphere {{radius}},
# ellipsoid {{semi_axes}} or points {{file: poses.csv}}. center: [x, y, z] places it; free: the search does.
region: {{type: box, size: [{edge:g}, {edge:g}, {edge:g}], center: free}}"""


def _round(value: float) -> float:
    """To one significant digit."""
    return float(f"{value:.0e}") if value > 0 and math.isfinite(value) else value


def _parameter(parameter: Parameter, kind: MechanismKind, free: bool) -> str:
    unit = si_unit(parameter.dimension)
    value = _UNITS.from_si(kind.example[parameter.name], unit)
    text = (
        f"{{min: {_round(value / 5):g}, max: {_round(value * 2):g}, initial: {value:g}}}"
        if free
        else f"{value:g}"
    )
    in_unit = "" if parameter.dimension == "ratio" else f", {_UNITS.name(unit)}"
    return f"    {parameter.name}: {text}    # {parameter.description}{in_unit}"


def _first(names: Sequence[str], kind: MechanismKind) -> list[str]:
    metrics = registries().metrics
    return [name for name in names if name in metrics and not metrics[name].refusal(kind, {})]


def _objective(kind: MechanismKind) -> str:
    return f"  - {{metric: {_first(('total_link_length', 'robot_size'), kind)[0]}, sense: minimize}}"


def _constraints(kind: MechanismKind) -> list[str]:
    rows = {
        "coverage": "{metric: coverage, min: 1}    # the whole region, without crossing a singularity",
        "conditioning_min": "{metric: conditioning_min, min: 0.2}    # 1/κ everywhere in the region",
    }
    return [f"  - {rows[name]}" for name in _first(tuple(rows), kind)]
