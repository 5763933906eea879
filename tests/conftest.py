"""What every test may count on."""

from __future__ import annotations

import signal

from hypothesis import settings

# the same examples in every run, however loaded the machine is
settings.register_profile("seeded", derandomize=True, deadline=None)
settings.load_profile("seeded")

# a shell starts background jobs with interrupts ignored, and programs started from there inherit that
signal.signal(signal.SIGINT, signal.default_int_handler)
