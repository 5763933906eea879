"""Where compiled kernels are kept between runs.

Numba recompiles a cached function when its own file changes, not when a formula it calls in another file
does. So the cache folder is named by a hash of every source file of the rooms that hold compiled code: any
change there gives a fresh folder. Numba reads its cache folder from the environment once, when it is
imported; this module must therefore be imported before Numba and imports nothing of it.

A plug-in is a mechanism in a user's own file, loaded as a module whose name ends with the hash of the file.
Once a kernel was compiled for it, the kernel's index in the cache names a class of that module, and cannot be
read by a program that has not loaded it. So kernels that were compiled beside plug-ins have a folder of their
own, named by the rooms and by all plug-ins that are loaded.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from hashlib import blake2b
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from platformdirs import user_cache_dir

ROOMS = ("arithmetic", "mechanisms", "workspace")
PACKAGE = Path(__file__).resolve().parents[1]
DAYS_KEPT = 30
PREFIX = "kernels-"
PLUG_IN = "tpm_design_plug_in_"
"""How the names of modules that are plug-ins begin; the rest is a hash of their content."""


_IMPORTED: dict[str, str] = {}


def note_plug_in(module: str) -> bool:
    """Note a module outside this package whose classes kernels may be compiled for, such as a plug-in that is
    imported as any other module is; whether that is news."""
    if module.startswith((PLUG_IN, "tpm_design.")) or module in _IMPORTED:
        return False
    file = getattr(sys.modules.get(module), "__file__", None)
    content = Path(file).read_bytes() if file is not None and Path(file).is_file() else b""
    _IMPORTED[module] = f"{module} {blake2b(content, digest_size=12).hexdigest()}"
    return True


def loaded_plug_ins() -> tuple[str, ...]:
    """Names of the plug-ins that this program has loaded, each with a hash of its content."""
    loaded = [name for name in sys.modules if name.startswith(PLUG_IN)]
    return tuple(sorted([*loaded, *_IMPORTED.values()]))


def source_hash(package: Path, plug_ins: Sequence[str] = ()) -> str:
    """Hash of the names and bytes of every ``*.py`` file in the ``ROOMS`` of ``package``, of the names of
    ``plug_ins``, and of Numba's version."""
    digest = blake2b(digest_size=10)
    with suppress(PackageNotFoundError):
        digest.update(version("numba").encode())
    digest.update(sys.implementation.cache_tag.encode() if sys.implementation.cache_tag else b"")
    for source in sorted(file for room in ROOMS for file in (package / room).rglob("*.py")):
        text = source.read_bytes()
        digest.update(f"\0{source.relative_to(package).as_posix()}\0{len(text)}\0".encode())
        digest.update(text)
    for name in plug_ins:
        digest.update(f"\0{name}".encode())
    return digest.hexdigest()


def usable(folder: Path) -> bool:
    """Whether ``folder`` exists, after an attempt to create it, and can be written; marks it as used now."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def remove_unused(parent: Path, now: float) -> None:
    """Remove the kernel folders in ``parent`` that nobody has used for ``DAYS_KEPT`` days."""
    with suppress(OSError):
        for folder in parent.glob(f"{PREFIX}*"):
            if now - folder.stat().st_mtime > DAYS_KEPT * 86400:
                shutil.rmtree(folder, ignore_errors=True)


def use_kernel_cache(package: Path = PACKAGE) -> Path:
    """Point Numba at the cache folder that belongs to the present source and the plug-ins that are loaded;
    returns the folder."""
    name = PREFIX + source_hash(package, loaded_plug_ins())
    parent = Path(user_cache_dir("tpm-design", appauthor=False))
    folder = parent / name
    if usable(folder):
        remove_unused(parent, time.time())
    else:
        folder = Path(tempfile.gettempdir()) / f"tpm-design-{name}"
        usable(folder)
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if (config := sys.modules.get("numba.core.config")) is not None:
        config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    return folder


FOLDER = use_kernel_cache()
