"""Parallel map over plain threads; kernels release the global interpreter lock.

The work is split and summed in the same way for any number of threads, so results are bitwise
equal. Threads are reused between calls; a forked process starts its own.
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
"""Number of threads that the current context may use; 1 in a new thread."""

_pools: dict[tuple[int, int], ThreadPoolExecutor] = {}
"""Thread pools by process id and number of workers."""


@contextmanager
def using_threads(count: int) -> Generator[None]:
    """Allow `parallel_map` up to `count` threads, the caller's included, inside a ``with`` block.

    Raises
    ------
    InvalidInput
        `count` is not a whole number of at least 1.
    """
    require_count("threads", count, 1)
    token = _threads.set(int(count))
    try:
        yield
    finally:
        _threads.reset(token)


def parallel_map(function: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
    """Return the results of a function for all items, in order.

    The caller's thread takes part. Nested calls run in one thread, since threads that wait for
    threads of the same pool could deadlock. The first error is raised after all threads have
    ended.

    Parameters
    ----------
    function : callable
        Function of one item; called from several threads at once.
    items : sequence
        Arguments of the calls.
    """
    count = min(_threads.get(), len(items))
    if count < 2:
        return [function(item) for item in items]
    results: dict[int, _Result] = {}
    next_row = itertools.count()

    def work() -> None:
        # The interpreter increments the counter in one step: no two threads get the same row.
        while (row := next(next_row)) < len(items):
            results[row] = function(items[row])

    def work_in_one_thread() -> None:
        with using_threads(1):
            work()

    futures = [_pool(count - 1).submit(work) for _ in range(count - 1)]
    try:
        work_in_one_thread()
    finally:
        errors = [future.exception() for future in futures]
    for error in errors:
        if error is not None:
            raise error
    return [results[row] for row in range(len(items))]


def _pool(workers: int) -> ThreadPoolExecutor:
    key = os.getpid(), workers
    if key not in _pools:
        _pools[key] = ThreadPoolExecutor(workers, thread_name_prefix="scanlock")
    return _pools[key]
