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

INTERNAL, USAGE, NOTHING_FEASIBLE, OUTSIDE_TOLERANCE, NOT_PROVED, POINTS_FAILED, INTERRUPTED = (
    1,
    2,
    3,
    4,
    5,
    6,
    130,
)

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
            plug_in = _plug_in_to_blame(error)
            complain(_bug_message(error) if plug_in is None else _plug_in_message(error, plug_in))
            code = INTERNAL if plug_in is None else USAGE
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


def _plug_in_to_blame(error: Exception) -> str | None:
    """Place in a mechanism's own file that an error comes from; None where there is no such file."""
    # where no such file was loaded, neither was this module
    if "tpm_design.mechanisms.plug_in" not in sys.modules:
        return None
    from tpm_design.mechanisms.plug_in import fault_of_plug_in

    return fault_of_plug_in(error)


def _plug_in_message(error: Exception, place: str) -> str:
    from tpm_design.mechanisms.plug_in import described

    return (
        f"{place}: the mechanism's formulas fail: {described(error)}\n"
        f"  Mend the file. The whole story is in {_log(error)}."
    )


def _bug_message(error: Exception) -> str:
    return (
        f"This is a bug: {type(error).__name__}: {error}\n"
        f"  Please report it to the maintainers of tpm-design with the file {_log(error)} and your study."
    )


def _log(error: Exception) -> Path:
    """A new file with the traceback."""
    with tempfile.NamedTemporaryFile(
        "w", prefix="tpm-design-", suffix=".log", delete=False, encoding="utf-8"
    ) as log:
        traceback.print_exception(error, file=log)
    return Path(log.name)
