"""Interrupts: recovered where Numba replaced them, and ignored by child processes."""

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def plain_interrupts() -> Generator[None]:
    """Raise the `KeyboardInterrupt` that caused a `SystemError`; for ``with`` and as a decorator.

    Numba continues when an interrupt arrives while a kernel returns its result. Python then
    raises a `SystemError` about a function that both returned and raised.
    """
    try:
        yield
    except SystemError as error:
        interrupt = _first_cause(error)
        if not isinstance(interrupt, KeyboardInterrupt):
            raise
        raise interrupt from None


@contextmanager
def children_ignore_interrupts() -> Generator[None]:
    """Let processes started in the ``with`` block ignore Ctrl-C; their parent ends them.

    A terminal sends the signal to all of them, and each would print a traceback.
    """
    is_main = threading.current_thread() is threading.main_thread()
    handler = signal.getsignal(signal.SIGINT) if is_main else None
    if not callable(handler):
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def _first_cause(error: BaseException) -> BaseException:
    """Return the first error of a chain of causes."""
    while error.__cause__ is not None:
        error = error.__cause__
    return error
