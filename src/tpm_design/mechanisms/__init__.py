"""The mechanisms: one file each; a module here that declares ``KIND`` is one."""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping, Sequence
from importlib import import_module
from types import MappingProxyType

from tpm_design.errors import ParameterError, did_you_mean
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.mechanisms.mechanism import Mechanism


def _declared() -> dict[str, MechanismKind]:
    """The kinds of all modules of this room, by name."""
    modules = (import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__))
    kinds = [module.KIND for module in modules if hasattr(module, "KIND")]
    return {kind.name: kind for kind in sorted(kinds, key=lambda kind: kind.name)}


MECHANISMS: Mapping[str, MechanismKind] = MappingProxyType(_declared())


def mechanism_kind(name: str) -> MechanismKind:
    """The registered kind; raises ParameterError on an unknown name."""
    if name not in MECHANISMS:
        raise ParameterError(f"Unknown mechanism {name!r}.", remedy=did_you_mean(name, MECHANISMS))
    return MECHANISMS[name]


def mechanism(name: str, **parameters: float | Sequence[float]) -> Mechanism:
    """A mechanism from its name and dimensions in SI units: one number for all limbs, ``f=(…)`` where they
    differ, or ``f1``, ``f2``, ``f3``. Raises ParameterError on an unknown, missing or impossible value."""
    return mechanism_kind(name).build(parameters, {})
