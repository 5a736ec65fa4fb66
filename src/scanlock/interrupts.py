"""Recovery of a `KeyboardInterrupt` that Numba replaced by a `SystemError`."""

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


def _first_cause(error: BaseException) -> BaseException:
    """Return the first error of a chain of causes."""
    while error.__cause__ is not None:
        error = error.__cause__
    return error
