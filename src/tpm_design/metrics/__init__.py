"""The metrics: one file per family, registered here."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from tpm_design.errors import UsageError, did_you_mean
from tpm_design.metrics import clearance, conditioning, motion, size, tilt, volume
from tpm_design.metrics.base import Metric

METRICS: Mapping[str, Metric] = MappingProxyType(
    {
        metric.name: metric
        for family in (volume, conditioning, clearance, motion, size, tilt)
        for metric in family.METRICS
    }
)


def metric(name: str) -> Metric:
    """The registered metric; raises UsageError on an unknown name."""
    if name not in METRICS:
        raise UsageError(f"Unknown metric {name!r}.", remedy=did_you_mean(name, METRICS))
    return METRICS[name]
