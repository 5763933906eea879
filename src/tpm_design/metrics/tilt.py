"""How far the platform tilts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tpm_design.mechanisms.base import MechanismKind
from tpm_design.metrics.base import Measurement, Metric, Option
from tpm_design.metrics.context import Context
from tpm_design.workspace.all_round_tilt import all_round_tilt

DISTANCE = Option("distance", "length", "distance d of the platform from the base", required=True)


def _upright(kind: MechanismKind, limits: Mapping[str, Any]) -> str | None:
    return f"the platform of {kind.name} does not tilt" if kind.translational else None


def _all_round_tilt(context: Context, options: Mapping[str, Any]) -> Measurement:
    found = all_round_tilt(context.mechanism, context.mode, options["distance"])
    # out of reach the shortfall guides a search back
    depth = min(0.0, found.upright / context.mechanism.reach_radius())
    return Measurement(
        found.tilt, found.error, depth=depth, notes={"limit": found.limit}, pieces=found.sectors
    )


METRICS = (
    Metric(
        "all_round_tilt", "rad", "maximize", 1.0,
        "largest tilt for which the platform, upright or tilted by less in any direction, stays within reach "
        "and joint limits and on one side of all singularities", "search along rays, bisected",
        _all_round_tilt, (DISTANCE,), needs_region=False, notes=("limit",), refusal=_upright,
        cost="locus",
    ),
)  # fmt: skip
