"""Compiled code lives only in the rooms whose source names the kernel cache."""

from __future__ import annotations

import re

from tpm_design.arithmetic.kernel_cache import PACKAGE, ROOMS

IMPORTS_NUMBA = re.compile(r"^\s*(from|import) numba\b", re.MULTILINE)


def test_numba_is_imported_only_where_a_change_gives_a_fresh_cache() -> None:
    users = {
        path.relative_to(PACKAGE).parts[0]
        for path in PACKAGE.rglob("*.py")
        if IMPORTS_NUMBA.search(path.read_text(encoding="utf-8"))
    }
    assert users <= set(ROOMS)
