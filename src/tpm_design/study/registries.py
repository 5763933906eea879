"""What a study may name: read from the registries when a study is read, never at import.

The registries hold compiled formulas; importing them late keeps `tpm-design --help` quick.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tpm_design.mechanisms.base import MechanismKind
from tpm_design.metrics.base import Metric
from tpm_design.optimizers.base import Optimizer


@dataclass(frozen=True)
class Registries:
    """Names → what they stand for."""

    mechanisms: Mapping[str, MechanismKind]
    metrics: Mapping[str, Metric]
    optimizers: Mapping[str, Optimizer]


def registries() -> Registries:
    """The mechanisms, metrics and methods of this installation."""
    from tpm_design.mechanisms import MECHANISMS
    from tpm_design.metrics import METRICS
    from tpm_design.optimizers import OPTIMIZERS

    return Registries(MECHANISMS, METRICS, OPTIMIZERS)
