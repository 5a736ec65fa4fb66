"""Decorators that compile kernels, and the log message of the first compilation.

Compilation is lazy: importing a kernel compiles nothing. `nogil` lets a thread pool run serial
kernels in parallel. Blanket fast-math is never on, because it makes `isinf` and `isnan` answer
False.
"""

import logging
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

from scanlock.kernels._cache import kernel_cache
from scanlock.kernels._helper_compiler import HelperCompiler

_Function = TypeVar("_Function", bound=Callable[..., Any])

_LOGGER = logging.getLogger("scanlock")

# The subset of fast-math that keeps infinities and NaN meaningful: sums may be reordered
# and fused, which is what vectorising a reduction needs.
_REORDERED_SUMS = {"reassoc", "contract", "nsz", "arcp"}

_HELPER: dict[str, Any] = {
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": HelperCompiler,
}


class CompileNotice:
    """Log message of the first compilation in a process, at level INFO.

    Attributes
    ----------
    is_given : bool
        Whether the message has been logged.
    ahead : callable or None
        Function to call once before the first compilation, which compiles kernels in parallel and
        keeps them on disk.
    """

    def __init__(self) -> None:
        self.is_given = False
        self.ahead: Callable[[], None] | None = None

    def give(self, cache_path: str | None) -> bool:
        """Log that a kernel is compiled, unless this was logged before.

        Parameters
        ----------
        cache_path : str or None
            Folder of the machine code of the kernel; None if no folder is writable.

        Returns
        -------
        bool
            Whether `ahead` was called, so that the kernel may be on disk now.
        """
        self._log(cache_path)
        ahead, self.ahead = self.ahead, None
        if ahead is None or cache_path is None:
            return False
        ahead()
        return True

    def _log(self, cache_path: str | None) -> None:
        if self.is_given:
            return
        self.is_given = True
        if cache_path is None:
            where = "and no cache folder is writable: set NUMBA_CACHE_DIR to one that is"
        else:
            where = "which takes one to two minutes once, and keeping them on disk"
        _LOGGER.info("compiling kernels for the first use, %s", where)


NOTICE = CompileNotice()


def kernel(function: _Function) -> _Function:
    """Compile a serial loop on its first call and keep the machine code on disk."""
    return _compiled(function, fastmath=False)


def sum_kernel(function: _Function) -> _Function:
    """Compile a serial reduction whose order of summation may change to use vector units.

    The order is fixed once compiled, so results repeat bit for bit on one machine.
    """
    return _compiled(function, fastmath=_REORDERED_SUMS)


def helper(function: _Function) -> _Function:
    """Compile a function that only kernels call, as part of each kernel."""
    return cast(_Function, numba.njit(**_HELPER)(function))


def sum_helper(function: _Function) -> _Function:
    """Compile a helper whose order of summation may change to use vector units."""
    return cast(_Function, numba.njit(**_HELPER, fastmath=_REORDERED_SUMS)(function))


def inlined(function: _Function) -> _Function:
    """Compile a helper into the body of each kernel that calls it; sums may be reordered.

    Without this the compiler may leave a call with twenty arguments in an inner loop, which
    costs more than the called code. LLVM copies the helper, which takes a third of the time that
    Numba takes to copy it (``inline="always"``) and to find the types of each copy.
    """
    options: dict[str, Any] = {**_HELPER, "fastmath": _REORDERED_SUMS, "forceinline": True}
    return cast(_Function, numba.njit(**options)(function))


def _compiled(function: _Function, fastmath: bool | set[str]) -> _Function:
    options: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": fastmath,
        "no_cfunc_wrapper": True,  # kernels are called from Python only, not from C
    }
    compiled: Any = numba.njit(**options)(function)
    if compiled is function:
        return function  # NUMBA_DISABLE_JIT
    compiled._cache = kernel_cache(function, NOTICE.give)
    # A dispatcher is called like the function it compiles, which is all that callers know of it.
    return cast(_Function, compiled)
