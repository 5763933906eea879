"""The options that compiled code of this package states, and how operators are registered with Numba.

A function without options of its own inherits those of whichever caller happens to be compiled first. With
``fastmath`` that would void every interval bound, so everything registered here states all three options.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tpm_design.arithmetic import kernel_cache  # before Numba

# isort: split
from numba import njit, types
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher
from numba.extending import overload

Function = Callable[..., Any]

# every fast-math licence but nnan and ninf, which make isnan always false
FAST_MATH = {"contract", "reassoc", "nsz", "arcp", "afn"}


class _CompiledInCallers(Compiler):
    """What only compiled functions call needs no machine code of its own, which takes a third of the time."""

    def __init__(
        self, typing: Any, target: Any, library: Any, arguments: Any, returned: Any, flags: Any, names: Any
    ) -> None:
        flags = flags.copy()
        flags.no_compile = True
        super().__init__(typing, target, library, arguments, returned, flags, names)

    def compile_extra(self, function: Any) -> Any:
        compiled = super().compile_extra(function)
        # callers look a function up by its entry: a builtin of its own that nobody calls
        entry: list[None] = []
        self.state.targetctx.insert_user_function(entry.clear, compiled.fndesc, [compiled.library])
        return compiled._replace(entry_point=entry.clear)


_NO_ENTRY: Any = {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": _CompiledInCallers,
}

FAST: Any = {"fastmath": FAST_MATH, "error_model": "numpy", "forceinline": True, **_NO_ENTRY}
STRICT: Any = {"fastmath": False, "error_model": "numpy", "forceinline": False, **_NO_ENTRY}
# x − |x|·2⁻⁵² may be one instruction: the product is exact
PRIMITIVE: Any = {"fastmath": {"contract"}, "error_model": "numpy", "forceinline": True, **_NO_ENTRY}


class _InnerFunction(CPUDispatcher):
    def __call__(self, *arguments: Any, **named: Any) -> Any:
        # it has no entry from Python: calling it as other dispatchers are called would crash
        raise TypeError(f"{self.py_func.__name__} serves compiled code only")


_KERNELS: list[Any] = []


def kernel(function: Function) -> Any:
    """Compile a function that Python calls, and keep it on disk."""
    return _kept(njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)(function))


def short_kernel(function: Function) -> Any:
    """As ``kernel``, for what takes some microseconds: it keeps the interpreter's lock, which another thread
    would else take meanwhile, and keep for longer."""
    return _kept(njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)(function))


def fast_kernel(function: Function) -> Any:
    """As ``kernel``, for a loop of floats that may be reordered and vectorised."""
    return _kept(njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST_MATH)(function))


def _kept(compiled: Any) -> Any:
    _KERNELS.append(compiled)
    return compiled


def follow_plug_ins() -> None:
    """Look for kernels, and keep them, in the folder that belongs to the plug-ins that are loaded now."""
    kernel_cache.use_kernel_cache()
    for compiled in _KERNELS:
        # a dispatcher chooses its folder when it is told to use one
        compiled.enable_caching()


def inner(function: Function) -> Any:
    """Compile a function that only compiled functions call: without an entry from Python, which takes as
    long to compile as a small function. It is kept on disk inside the kernels that call it."""
    return _without_entry(function, inline=False)


def inlined(function: Function) -> Any:
    """As ``inner``, for a short function of branch-free arithmetic: a loop that calls it can vectorise."""
    return _without_entry(function, inline=True)


def _without_entry(function: Function, *, inline: bool) -> Any:
    compiled = njit(nogil=True, error_model="numpy", forceinline=inline, **_NO_ENTRY)(function)
    compiled.__class__ = _InnerFunction
    return compiled


def keep_apart(module: str) -> None:
    """Keep kernels that are compiled from now on away from programs that do not know the classes of
    ``module``, which is not of this package."""
    if kernel_cache.note_plug_in(module):
        follow_plug_ins()


def is_number(kind: Any) -> bool:
    """Whether a Numba type is a plain real number."""
    return isinstance(kind, types.Float | types.Integer)


def register_operator(
    operation: Function,
    owned: Callable[[Any], bool],
    plain: Callable[[Any], bool],
    both: Function,
    left: Function,
    right: Function,
) -> None:
    """Overload a binary operator of parameters ``a, b`` for the types that ``owned`` recognises.

    ``both`` serves two owned operands; ``left`` and ``right`` those where the other one is ``plain``.
    """

    def choose(a: Any, b: Any) -> Function | None:
        if owned(a) and owned(b):
            return both
        if owned(a) and plain(b):
            return left
        if plain(a) and owned(b):
            return right
        return None

    overload(operation, jit_options=STRICT, strict=False)(choose)


def register_unary(operation: Function, owned: Callable[[Any], bool], implementation: Function) -> None:
    """Overload a unary operator of parameter ``a`` for the types that ``owned`` recognises."""

    def choose(a: Any) -> Function | None:
        return implementation if owned(a) else None

    overload(operation, jit_options=STRICT, strict=False)(choose)
