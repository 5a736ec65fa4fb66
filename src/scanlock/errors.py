"""Exceptions of scanlock, and checks of settings.

Invalid input raises an exception that names the argument, its value and the remedy. A failed
registration (no overlap, no convergence) never raises: it is a status in the result.
"""

import math
import operator


class ScanlockError(Exception):
    """Base class of all exceptions of scanlock."""


class InvalidInput(ScanlockError, ValueError):
    """An argument has the wrong shape, type or range."""


class FormatError(ScanlockError, ValueError):
    """A file contradicts its name or header; the message names the byte or line."""


class MissingExtra(ScanlockError, ImportError):
    """An optional dependency is missing; the message says how to install it."""


def missing_extra(need: str, extra: str) -> MissingExtra:
    """Return the error for an optional dependency that is not installed.

    Parameters
    ----------
    need : str
        The need, such as ``"LAS needs laspy"``.
    extra : str
        Name of the extra of scanlock that installs it.
    """
    return MissingExtra(
        f'{need}: pip install "scanlock[{extra}]", or pip install ".[{extra}]" in a clone'
    )


def require_positive(name: str, value: float, unit: str = "") -> None:
    """Raise `InvalidInput` unless `value` is finite and above zero."""
    if not (_is_finite(value) and value > 0):
        raise InvalidInput(f"{name} must be positive, got {_with_unit(value, unit)}")


def require_at_least(name: str, value: float, minimum: float, unit: str = "") -> None:
    """Raise `InvalidInput` unless `value` is finite and not below `minimum`."""
    if not (_is_finite(value) and value >= minimum):
        raise InvalidInput(
            f"{name} must be at least {_with_unit(minimum, unit)}, got {_with_unit(value, unit)}"
        )


def require_count(name: str, value: int, minimum: int = 1) -> None:
    """Raise `InvalidInput` unless `value` is a whole number not below `minimum`."""
    try:
        is_valid = operator.index(value) >= minimum
    except TypeError:
        is_valid = False
    if not is_valid:
        raise InvalidInput(f"{name} must be a whole number of at least {minimum}, got {value!r}")


def require_fraction(name: str, value: float) -> None:
    """Raise `InvalidInput` unless `value` is in [0, 1]."""
    if not (_is_finite(value) and 0 <= value <= 1):
        raise InvalidInput(f"{name} must lie between 0 and 1, got {_with_unit(value)}")


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except TypeError:
        # Settings files and notebooks may pass strings and None despite the annotation.
        return False


def _with_unit(value: float, unit: str = "") -> str:
    return f"{value} {unit}" if unit else f"{value}"
