"""What every test may count on."""

from __future__ import annotations

import signal

# a shell starts background jobs with interrupts ignored, and programs started from there inherit that
signal.signal(signal.SIGINT, signal.default_int_handler)
