"""What was proved of a design, held against what was proved of the baseline's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from tpm_design.baselines.deviations import NOTHING, Deviations, Exceedance
from tpm_design.runs.folder import SUMMARY


def with_verdicts(found: Deviations, baseline: Mapping[str, Any], run: Mapping[str, Any]) -> Deviations:
    """``found``, and the verdict on each requirement as one more text: a proof that is lost, or won,
    deviates. ``baseline``, ``run``: the contents of run.json."""
    before, now = _outcomes(baseline), _outcomes(run)
    columns = {label: f"verdict on {label}" for label in dict.fromkeys((*before, *now))}
    pairs = {label: (before.get(label, NOTHING), now.get(label, NOTHING)) for label in columns}
    changed = [label for label, (old, new) in pairs.items() if old != new]
    return replace(
        found,
        columns=(*found.columns, *columns.values()),
        cells=found.cells + len(columns),
        identical=found.identical + len(columns) - len(changed),
        exceedances=(
            *found.exceedances,
            *(Exceedance(SUMMARY, columns[label], *pairs[label]) for label in changed),
        ),
    )


def _outcomes(summary: Mapping[str, Any]) -> dict[str, str]:
    """Requirement → ``proved``, ``refuted`` or ``undecided``; empty for a run that proved nothing."""
    certificate = summary.get("certificate")
    requirements = certificate.get("requirements") if isinstance(certificate, Mapping) else None
    if not isinstance(requirements, Mapping):
        return {}
    return {
        str(label): str(one.get("outcome")) for label, one in requirements.items() if isinstance(one, Mapping)
    }
