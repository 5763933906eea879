"""One clear message for everything that goes wrong, and the exit code that belongs to it."""

from __future__ import annotations

import functools
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec

import typer

from tpm_design.errors import TpmDesignError

INTERNAL, USAGE, NOTHING_FEASIBLE, INTERRUPTED = 1, 2, 3, 130

Arguments = ParamSpec("Arguments")


def guarded(command: Callable[Arguments, int | None]) -> Callable[Arguments, None]:
    """A command that returns its exit code (None: 0) and never shows a traceback."""

    @functools.wraps(command)
    def run(*args: Arguments.args, **options: Arguments.kwargs) -> None:
        try:
            code = command(*args, **options) or 0
        except TpmDesignError as error:
            complain(error.message)
            code = error.exit_code
        except KeyboardInterrupt:
            complain("Interrupted.")
            code = INTERRUPTED
        except BrokenPipeError:
            # the reader of a pipe has seen enough; nothing more can be printed
            sys.stdout = None  # type: ignore[assignment]
            code = 0
        except Exception as error:
            complain(_bug_message(error))
            code = INTERNAL
        raise typer.Exit(code)

    return run


def complain(message: str) -> None:
    """One message on standard error."""
    print(f"tpm-design: {message}", file=sys.stderr)


def _bug_message(error: Exception) -> str:
    with tempfile.NamedTemporaryFile(
        "w", prefix="tpm-design-", suffix=".log", delete=False, encoding="utf-8"
    ) as log:
        traceback.print_exception(error, file=log)
    return (
        f"This is a bug: {type(error).__name__}: {error}\n"
        f"  Please report it to the maintainers of tpm-design with the file {Path(log.name)} and your study."
    )
