"""What every test may count on."""

from __future__ import annotations

import signal

import pytest
from hypothesis import settings

from tpm_design.mechanisms import MECHANISMS
from tpm_design.mechanisms.base import MechanismKind

# the same examples in every run, however loaded the machine is
settings.register_profile("seeded", derandomize=True, deadline=None)
settings.load_profile("seeded")

# a shell starts background jobs with interrupts ignored, and programs started from there inherit that
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests of one mechanism go to one worker, which compiles its kernels."""
    for item in items:
        name = mechanism_of(item)
        if name is not None and item.get_closest_marker("xdist_group") is None:
            item.add_marker(pytest.mark.xdist_group(name))


def mechanism_of(item: pytest.Item) -> str | None:
    """Which mechanism a test has as its parameter, if any."""
    if not isinstance(item, pytest.Function) or not hasattr(item, "callspec"):
        return None
    for value in item.callspec.params.values():
        if isinstance(value, MechanismKind):
            return value.name
        if isinstance(value, str) and value in MECHANISMS:
            return value
    return None
