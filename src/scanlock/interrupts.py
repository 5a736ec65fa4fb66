"""What becomes of an interrupt that meets a kernel: the `KeyboardInterrupt` it was."""

from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def plain_interrupts() -> Generator[None]:
    """Raise the `KeyboardInterrupt` itself where Numba has made a `SystemError` of it.

    Numba goes on when an interrupt meets it handing over the result of a kernel, and Python
    complains of a function that both returned and raised. For ``with``, or before a function.
    """
    try:
        yield
    except SystemError as error:
        interrupt = _first_cause(error)
        if not isinstance(interrupt, KeyboardInterrupt):
            raise
        raise interrupt from None


def _first_cause(error: BaseException) -> BaseException:
    """Return what was raised first of errors that caused one another."""
    while error.__cause__ is not None:
        error = error.__cause__
    return error
