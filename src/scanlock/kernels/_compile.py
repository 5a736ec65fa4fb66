"""The three ways a kernel is compiled.

Compilation is lazy, so importing a kernel compiles nothing. `nogil` lets a thread pool drive
serial kernels. Blanket fast-math is never on: it makes `isinf` and `isnan` answer False.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])

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


def _compiled(function: _Function, fastmath: bool | set[str], inline: str = "never") -> _Function:
    options: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": fastmath,
        "inline": inline,
    }
    try:
        compiled = numba.njit(cache=True, **options)(function)
    except RuntimeError:
        # No writable place for the cache (read-only install and home): compile every time.
        compiled = numba.njit(**options)(function)
    # A dispatcher is called like the function it compiles, which is all that callers know of it.
    return cast(_Function, compiled)
