"""Proofs are refused where the arithmetic is not the one they take for granted."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator

import pytest

from tpm_design.arithmetic.rounding import check_rounding
from tpm_design.errors import RefusedError
from tpm_design.mechanisms import mechanism

# of fenv.h on x86-64 and AArch64: to nearest; downwards, upwards and towards zero are other values there
TO_NEAREST = 0
OTHERS = (0x400, 0x800, 0xC00, 0x400000, 0x800000, 0xC00000)


@pytest.fixture
def rounding() -> Iterator[ctypes.CDLL]:
    library = ctypes.CDLL(None)
    yield library
    library.fesetround(TO_NEAREST)


def test_rounding_to_nearest_is_fine() -> None:
    check_rounding()


def test_other_rounding_is_refused(rounding: ctypes.CDLL) -> None:
    """Checked under each mode this processor has; the test itself computes nothing there."""
    machine = mechanism("uru", db=0.1, dp=0.1, f=1.0, r=1.0, k=1.0)
    mode = machine.mode_of({"octant": "+++", "elbows": "+++"})
    q = machine.ik([[0.5, 0.6, 0.4]], mode)[0]
    refused = []
    for value in OTHERS:
        if rounding.fesetround(value) != 0:
            continue
        try:
            machine.fk(q)
        except RefusedError as error:
            refused.append(error)
        finally:
            rounding.fesetround(TO_NEAREST)
    assert len(refused) == 3
    assert "not rounded to nearest" in refused[0].what
