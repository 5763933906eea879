"""Mechanisms from a user's own Python file.

The file is what a mechanism's file in this folder is: formulas, and a ``MechanismKind`` called ``KIND``. It
becomes a module whose name ends with the hash of its content, so that kernels kept on disk belong to one
content and to nothing else (``arithmetic/kernel_cache.py``). Loading a file runs it: callers ask first.
"""

from __future__ import annotations

import hashlib
import re
import sys
import traceback
from collections.abc import Callable, Collection, Mapping
from itertools import pairwise
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any, NoReturn

from tpm_design.arithmetic.compilation import follow_plug_ins
from tpm_design.arithmetic.kernel_cache import PLUG_IN
from tpm_design.errors import PlugInError, TpmDesignError
from tpm_design.mechanisms.base import Limit, MechanismKind, ModeField, Parameter, Singularity
from tpm_design.mechanisms.mechanism import Mechanism

NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
MEMBERS: Mapping[str, type] = {
    "parameters": Parameter,
    "pose": str,
    "drives": str,
    "mode_fields": ModeField,
    "limits": Limit,
    "determinants": str,
    "singularities": Singularity,
    "pose_units": str,
}
"""Fields of a ``MechanismKind`` that are tuples, and what is in them."""
COMPILING = "Failed in nopython mode pipeline"
PATTERN = "The project's CONTRIBUTING.md says how a mechanism is written."


def load_kind(source: bytes, path: Path, taken: Collection[str]) -> MechanismKind:
    """Runs ``source``, the content of the file ``path``, and gives its ``KIND``; ``taken``: names it may not
    have. The same content is run once.

    Raises PlugInError, with the file and where there is one the line: on an error of syntax, on whatever the
    file raises, where there is no usable ``KIND``, and where its example cannot be built.
    """
    name = PLUG_IN + hashlib.sha256(source).hexdigest()[:24]
    if name in sys.modules:
        return _kind_of(sys.modules[name], path, taken)
    try:
        return _kind_of(_run(source, path, name), path, taken)
    except BaseException:
        sys.modules.pop(name, None)
        follow_plug_ins()
        raise


def _kind_of(module: ModuleType, path: Path, taken: Collection[str]) -> MechanismKind:
    kind = getattr(module, "KIND", None)
    if kind is None:
        _refuse(path, "the file defines no KIND", f"Write `KIND = MechanismKind(…)`. {PATTERN}")
    if not isinstance(kind, MechanismKind):
        _refuse(path, f"KIND is {_a(kind)}, not a MechanismKind", PATTERN)
    _check_fields(kind, path, taken)
    _check_example(kind, path)
    return kind


def _run(source: bytes, path: Path, name: str) -> ModuleType:
    """The module that ``source`` defines, registered: classes of a module are found by its name."""
    file = str(path.absolute())
    try:
        code = compile(source, file, "exec", dont_inherit=True)
    except SyntaxError as error:
        place = str(path) if error.lineno is None else f"{path}:{error.lineno}"
        raise PlugInError(
            f"this is not valid Python: {error.msg}", where=place, remedy="Mend the file."
        ) from None
    except ValueError as error:
        _refuse(path, f"this is not valid Python: {error}", "Mend the file.")
    module = ModuleType(name)
    module.__file__ = file
    sys.modules[name] = module
    follow_plug_ins()
    _told(lambda: exec(code, module.__dict__), path, "the file cannot be loaded")
    return module


def _told(action: Callable[[], Any], path: Path, what: str) -> Any:
    """The outcome of running a part of the file, with whatever it raises in one message."""
    try:
        return action()
    except (Exception, SystemExit) as error:
        reason = error.what if isinstance(error, TpmDesignError) else described(error)
        lines = [line for frame, line in traceback.walk_tb(error.__traceback__) if _is_plug_in(frame)]
        place = f"{path}:{lines[-1]}" if lines else str(path)
        raise PlugInError(f"{what}: {reason}", where=place, remedy="Mend the file.") from error


def _check_fields(kind: MechanismKind, path: Path, taken: Collection[str]) -> None:
    if not isinstance(kind.name, str) or not NAME.fullmatch(kind.name):
        _refuse(
            path,
            f"KIND.name is {kind.name!r}",
            "Use up to 40 lower-case letters, digits and '_', a letter first.",
        )
    if kind.name in taken:
        _refuse(
            path,
            f"KIND.name is {kind.name!r}, and there is a mechanism of this name",
            "Choose a name of its own.",
        )
    for field, member in MEMBERS.items():
        value = getattr(kind, field)
        if not isinstance(value, tuple) or not all(isinstance(item, member) for item in value):
            _refuse(path, f"KIND.{field} must be a tuple of {member.__name__}, not {_a(value)}", PATTERN)
    for field in ("title", "source"):
        if not isinstance(getattr(kind, field), str):
            _refuse(path, f"KIND.{field} must be a text, not {_a(getattr(kind, field))}", PATTERN)
    if not isinstance(kind.example, Mapping):
        _refuse(path, f"KIND.example must be a mapping, not {_a(kind.example)}", PATTERN)
    for field in ("build", "farthest_reach"):
        if not callable(getattr(kind, field)):
            _refuse(path, f"KIND.{field} must be a function, not {_a(getattr(kind, field))}", PATTERN)


def _check_example(kind: MechanismKind, path: Path) -> None:
    machine = _told(lambda: kind.build(kind.example, {}), path, "KIND.example cannot be built")
    if not isinstance(machine, Mechanism):
        _refuse(path, f"KIND.build gives {_a(machine)}, not a Mechanism", PATTERN)


def fault_of_plug_in(error: BaseException) -> str | None:
    """Where the plug-in is to blame for an error: its file, and the line if there is one. None where it was
    raised neither by a plug-in nor by Numba as it compiled one."""
    files = [str(module.__file__) for name, module in sys.modules.items() if name.startswith(PLUG_IN)]
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        if _is_plug_in(frame):
            return f"{frame.f_code.co_filename}:{line}"
    if not files or not type(error).__module__.startswith("numba."):
        return None
    for shown, number in reversed(re.findall(r'File "([^"\n]+)", line (\d+)', str(error))):
        for file in files:
            if Path(shown).name == Path(file).name:
                return f"{file}:{number}"
    return files[-1]


def described(error: BaseException) -> str:
    """An error in a line: of Numba's account, which tells every formula on the way, the innermost reason."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    inner = [line for before, line in pairwise(lines) if COMPILING in before and COMPILING not in line]
    reason = inner[-1] if inner else lines[0] if lines else "no reason given"
    lacking = re.match(r"No implementation of function Function\(<function (\w+) at ", reason)
    if lacking:
        return f"there is no {lacking[1]} for such arguments"
    return f"{type(error).__name__}: {reason[:300]}"


def _is_plug_in(frame: FrameType) -> bool:
    return str(frame.f_globals.get("__name__")).startswith(PLUG_IN)


def _refuse(path: Path, what: str, remedy: str) -> NoReturn:
    raise PlugInError(what, where=str(path), remedy=remedy) from None


def _a(value: Any) -> str:
    return f"a {type(value).__name__}"
