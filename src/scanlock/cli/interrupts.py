"""Interrupts: Ctrl-C, SIGTERM and SIGHUP as exceptions, so that files stay complete.

Python raises an exception for the first only; the others would end the process at once, leave
temporary files behind and lose the results so far.
"""

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

from scanlock.interrupts import plain_interrupts

# Windows lacks the second.
_REQUESTS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Interrupted(KeyboardInterrupt):
    """The process received a signal to end.

    Attributes
    ----------
    number : int
        The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def exit_code(interrupt: KeyboardInterrupt) -> int:
    """Return 128 plus the number of the signal, as in shells."""
    return 128 + (interrupt.number if isinstance(interrupt, Interrupted) else signal.SIGINT)


@contextmanager
def interrupts_raised() -> Generator[None]:
    """Raise `KeyboardInterrupt` or `Interrupted` on a signal during the ``with`` block.

    Signals that are ignored (nohup) or handled by others are left alone.
    """
    taken = [number for number in _REQUESTS if _handler(number) == signal.SIG_DFL]
    for number in taken:
        signal.signal(number, _interrupt)
    try:
        with plain_interrupts():
            yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def interrupt_delayed() -> Generator[None]:
    """Delay an interrupt to the end of the ``with`` block; a second one is raised at once."""
    waiting: list[int] = []
    handlers = {number: _handler(number) for number in (signal.SIGINT, *_REQUESTS)}

    def delay(number: int, frame: FrameType | None) -> None:
        handler = handlers[number]
        if waiting and callable(handler):
            handler(number, frame)
        waiting.append(number)

    replaced = {number: handler for number, handler in handlers.items() if callable(handler)}
    try:
        for number in replaced:
            signal.signal(number, delay)
        yield
    finally:
        for number, handler in replaced.items():
            signal.signal(number, handler)
    if waiting:
        signal.raise_signal(waiting[0])


def _handler(number: int) -> object:
    """Return the handler of a signal; None outside the main thread."""
    is_main = threading.current_thread() is threading.main_thread()
    return signal.getsignal(number) if is_main else None


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise Interrupted(number)
