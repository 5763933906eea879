"""The mechanisms: one file each, registered here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from tpm_design.errors import ParameterError, did_you_mean
from tpm_design.mechanisms import uru
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.mechanisms.mechanism import Mechanism

MECHANISMS: Mapping[str, MechanismKind] = MappingProxyType({kind.name: kind for kind in (uru.KIND,)})


def mechanism_kind(name: str) -> MechanismKind:
    """The registered kind; raises ParameterError on an unknown name."""
    if name not in MECHANISMS:
        raise ParameterError(f"Unknown mechanism {name!r}.", remedy=did_you_mean(name, MECHANISMS))
    return MECHANISMS[name]


def mechanism(name: str, **parameters: float | Sequence[float]) -> Mechanism:
    """A mechanism from its name and dimensions in SI units: one number for all limbs, ``f=(…)`` where they
    differ, or ``f1``, ``f2``, ``f3``. Raises ParameterError on an unknown, missing or impossible value."""
    return mechanism_kind(name).build(parameters, {})
