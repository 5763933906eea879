"""Dimensional synthesis of translational parallel manipulators.

The public names; everything is imported when it is first used, so that the command line starts at once.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tpm_design.mechanisms import mechanism as mechanism
    from tpm_design.study import Study as Study
    from tpm_design.study import load_study as load_study
    from tpm_design.synthesis.inscribed import InscribedBody as InscribedBody
    from tpm_design.synthesis.inscribed import largest_body as largest_body
    from tpm_design.workspace.certified_volume import CertifiedVolume as CertifiedVolume
    from tpm_design.workspace.certified_volume import certified_volume as certified_volume
    from tpm_design.workspace.volume import Volume as Volume
    from tpm_design.workspace.volume import workspace_volume as workspace_volume

_HOMES = {
    "mechanism": "tpm_design.mechanisms",
    "workspace_volume": "tpm_design.workspace.volume",
    "Volume": "tpm_design.workspace.volume",
    "certified_volume": "tpm_design.workspace.certified_volume",
    "CertifiedVolume": "tpm_design.workspace.certified_volume",
    "largest_body": "tpm_design.synthesis.inscribed",
    "InscribedBody": "tpm_design.synthesis.inscribed",
    "load_study": "tpm_design.study",
    "Study": "tpm_design.study",
}

__all__ = [
    "CertifiedVolume",
    "InscribedBody",
    "Study",
    "Volume",
    "__version__",
    "certified_volume",
    "largest_body",
    "load_study",
    "mechanism",
    "workspace_volume",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("tpm-design")
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'tpm_design' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
