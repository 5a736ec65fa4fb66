"""Decorators that compile kernels, and the cache of their machine code.

Compilation is lazy, so importing a kernel compiles nothing. `nogil` lets a thread pool drive
serial kernels. Blanket fast-math is never on: it makes `isinf` and `isnan` answer False.

Compiling takes seconds, once: the logger ``scanlock`` reports it, at level INFO.
"""

import contextlib
import logging
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core import event as numba_event

from scanlock.kernels._cache import KernelCache

_Function = TypeVar("_Function", bound=Callable[..., Any])

_LOGGER = logging.getLogger("scanlock")

# The subset of fast-math that keeps infinities and NaN meaningful: sums may be reordered
# and fused, which is what vectorising a reduction needs.
_REORDERED_SUMS = {"reassoc", "contract", "nsz", "arcp"}


def kernel(function: _Function) -> _Function:
    """Compile a serial loop on its first call and keep the machine code on disk."""
    return _compiled(function, fastmath=False)


def sum_kernel(function: _Function) -> _Function:
    """Compile a serial reduction whose order of summation may change to use vector units.

    The order is fixed once compiled, so results still repeat bit for bit on one machine.
    """
    return _compiled(function, fastmath=_REORDERED_SUMS)


def sum_part(function: _Function) -> _Function:
    """Compile a piece of a reduction into every kernel of its file that calls it.

    The compiler may else leave a call with twenty arguments in an inner loop, which costs more
    than what it calls.
    """
    return _compiled(function, fastmath=_REORDERED_SUMS, inline="always")


_functions: set[Callable[..., Any]] = set()
"""All that are compiled here: Numba tells of the compilations of others too."""


def _compiled(function: _Function, fastmath: bool | set[str], inline: str = "never") -> _Function:
    options: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": fastmath,
        "inline": inline,
    }
    compiled: Any = numba.njit(**options)(function)
    if compiled is function:
        return function  # NUMBA_DISABLE_JIT
    # Without a writable place for the cache (read-only install and home), compile every time.
    with contextlib.suppress(RuntimeError):
        compiled._cache = KernelCache(function)
    _functions.add(function)
    # A dispatcher is called like the function it compiles, which is all that callers know of it.
    return cast(_Function, compiled)


class CompileNotice(numba_event.Listener):
    """Logs that a kernel is compiled rather than found on disk, once a process.

    Attributes
    ----------
    is_given : bool
        Whether it has been.
    """

    def __init__(self) -> None:
        self.is_given = False

    def on_start(self, event: Any) -> None:
        """Take note of a compilation that begins, if it is one of ours."""
        dispatcher = event.data["dispatcher"]
        if self.is_given or dispatcher.py_func not in _functions:
            return
        self.is_given = True
        if dispatcher.stats.cache_path is None:
            where = "and no folder to keep them in is writable: set NUMBA_CACHE_DIR to one that is"
        else:
            where = "for half a minute at most, and keeping them on disk"
        _LOGGER.info("compiling kernels for the first use, %s", where)

    def on_end(self, event: Any) -> None:
        """Do nothing."""


NOTICE = CompileNotice()
numba_event.register("numba:compile", NOTICE)
