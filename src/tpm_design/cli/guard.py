"""One clear message for everything that goes wrong, and the exit code that belongs to it."""

from __future__ import annotations

import functools
import os
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec

import typer

from tpm_design.errors import TpmDesignError

INTERNAL, USAGE, NOTHING_FEASIBLE, NOT_PROVED, INTERRUPTED = 1, 2, 3, 5, 130

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
            _drop_output()
            code = 0
        except OSError as error:
            complain(_trouble(error))
            code = USAGE
        except Exception as error:
            complain(_bug_message(error))
            code = INTERNAL
        raise typer.Exit(code)

    return run


def run_to_the_end(app: Callable[[], None]) -> None:
    """Run the program and write out what it printed, so that a failure to do so has one message too."""
    code: int | str | None = 0
    try:
        try:
            app()
        except SystemExit as end:
            code = end.code
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        # the reader of the pipe has seen enough
        _drop_output()
    except OSError as error:
        _drop_output()
        complain(_trouble(error))
        code = USAGE
    sys.exit(code)


def _drop_output() -> None:
    """Nothing more can be printed: what is left in the buffer goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _trouble(error: OSError) -> str:
    what = error.filename or "The output cannot be written"
    return f"{what}: {error.strerror or error}."


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
