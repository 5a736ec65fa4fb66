"""Work spread over threads: kernels leave the interpreter free, so plain threads are enough.

What is spread is cut the same way whatever the number of threads, and summed in the same order,
so results are the same to the last bit. Threads are kept from one call to the next; a process
that was forked from this one starts its own.
"""

import itertools
import os
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

from scanlock.errors import require_count

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_threads: ContextVar[int] = ContextVar("threads", default=1)
"""How many threads the work of the caller may take; another thread starts with one again."""

_pools: dict[tuple[int, int], ThreadPoolExecutor] = {}
"""Helping threads by process and number."""


@contextmanager
def using_threads(count: int) -> Generator[None]:
    """Let `spread` take up to `count` threads, the caller's included, while this lasts."""
    require_count("threads", count, 1)
    token = _threads.set(int(count))
    try:
        yield
    finally:
        _threads.reset(token)


def spread(function: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
    """Return the results of a function for all items, in order.

    The caller's thread takes part, and nothing is spread again from inside: threads that wait for
    threads could wait forever. The first error is raised once all have ended.
    """
    count = min(_threads.get(), len(items))
    if count < 2:
        return [function(item) for item in items]
    results: dict[int, _Result] = {}
    turn = itertools.count()

    def work() -> None:
        # Taking the next number is one step of the interpreter: no two threads get the same.
        while (row := next(turn)) < len(items):
            results[row] = function(items[row])

    def work_alone() -> None:
        with using_threads(1):
            work()

    helping = [_pool(count - 1).submit(work) for _ in range(count - 1)]
    try:
        work_alone()
    finally:
        errors = [one.exception() for one in helping]
    for error in errors:
        if error is not None:
            raise error
    return [results[row] for row in range(len(items))]


def _pool(helpers: int) -> ThreadPoolExecutor:
    key = os.getpid(), helpers
    if key not in _pools:
        _pools[key] = ThreadPoolExecutor(helpers, thread_name_prefix="scanlock")
    return _pools[key]
