"""Sets that are joined in pairs: each is known by one of its members (union–find)."""

from __future__ import annotations

from tpm_design.arithmetic import inner


@inner
def find(parent, item):  # type: ignore[no-untyped-def]
    """The member by which the set of ``item`` is known."""
    while parent[item] != item:
        parent[item] = parent[parent[item]]
        item = parent[item]
    return item


@inner
def join(parent, a, b):  # type: ignore[no-untyped-def]
    """Make one set of those of ``a`` and ``b``, known by the lowest number whatever the order of joining."""
    first, second = find(parent, a), find(parent, b)
    if first < second:
        parent[second] = first
    else:
        parent[first] = second
