"""Interrupts: Ctrl-C, a request to end, a terminal that closes; all must leave files whole.

Python turns only the first into an exception; the others would end the process on the spot, with
temporary files left behind and the work of hours not written.
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
    """The process was asked to end.

    Attributes
    ----------
    number : int
        The signal that asked.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def exit_code(interrupt: KeyboardInterrupt) -> int:
    """Return 128 and the number of the signal, as shells have it."""
    return 128 + (interrupt.number if isinstance(interrupt, Interrupted) else signal.SIGINT)


@contextmanager
def interrupts_raised() -> Generator[None]:
    """Raise `KeyboardInterrupt`, or `Interrupted`, when the process is to end in the block.

    A request that is ignored, as nohup has it, or that others handle already stays so.
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
def undisturbed() -> Generator[None]:
    """Put an interrupt off until the ``with`` block is done; a second one breaks it at once.

    For what belongs together, and for what is written last: whoever loses patience gets out.
    """
    waiting: list[int] = []
    handlers = {number: _handler(number) for number in (signal.SIGINT, *_REQUESTS)}

    def put_off(number: int, frame: FrameType | None) -> None:
        handler = handlers[number]
        if waiting and callable(handler):
            handler(number, frame)
        waiting.append(number)

    replaced = {number: handler for number, handler in handlers.items() if callable(handler)}
    try:
        for number in replaced:
            signal.signal(number, put_off)
        yield
    finally:
        for number, handler in replaced.items():
            signal.signal(number, handler)
    if waiting:
        signal.raise_signal(waiting[0])


@contextmanager
def out_of_reach() -> Generator[None]:
    """Let processes that are started in the ``with`` block ignore Ctrl-C; their parent ends them.

    A terminal sends it to them all, and each would print a traceback.
    """
    handler = _handler(signal.SIGINT)
    if not callable(handler):
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def _handler(number: int) -> object:
    """Return what a signal does; None outside the main thread, which alone may change it."""
    is_main = threading.current_thread() is threading.main_thread()
    return signal.getsignal(number) if is_main else None


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise Interrupted(number)
