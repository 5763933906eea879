"""The mechanisms that the checker knows, each written anew from its equations."""

from __future__ import annotations

from collections.abc import Mapping

from tpm_design.checker.mechanisms.cylindrical import CRR, CRRR, PRRR
from tpm_design.checker.mechanisms.delta import DELTA
from tpm_design.checker.mechanisms.linear_delta import LINEAR_DELTA
from tpm_design.checker.mechanisms.mechanism import Mechanism
from tpm_design.checker.mechanisms.orthoglide import ORTHOGLIDE
from tpm_design.checker.mechanisms.uru import URU

MECHANISMS: Mapping[str, Mechanism] = {
    mechanism.name: mechanism for mechanism in (URU, CRR, PRRR, CRRR, DELTA, LINEAR_DELTA, ORTHOGLIDE)
}

__all__ = ["MECHANISMS", "Mechanism"]
