"""What scanlock raises, and the checks that settings share.

Bad input raises one of these, naming the argument, its value and the remedy. Bad luck (no
overlap, no convergence) never raises: it is a status in the result.
"""

import math
import operator


class ScanlockError(Exception):
    """Any error that scanlock raises on purpose."""


class InvalidInput(ScanlockError, ValueError):
    """An argument has the wrong shape, type or range."""


class FormatError(ScanlockError, ValueError):
    """A file is not what its name or header says; names the byte or line."""


class MissingExtra(ScanlockError, ImportError):
    """An optional dependency is not installed; says how to install it."""


def require_positive(name: str, value: float, unit: str = "") -> None:
    """Raise `InvalidInput` unless `value` is finite and above zero."""
    if not (_is_finite(value) and value > 0):
        raise InvalidInput(f"{name} must be positive, got {_with_unit(value, unit)}")


def require_at_least(name: str, value: float, least: float, unit: str = "") -> None:
    """Raise `InvalidInput` unless `value` is finite and not below `least`."""
    if not (_is_finite(value) and value >= least):
        raise InvalidInput(
            f"{name} must be at least {_with_unit(least, unit)}, got {_with_unit(value, unit)}"
        )


def require_count(name: str, value: int, least: int = 1) -> None:
    """Raise `InvalidInput` unless `value` is a whole number not below `least`."""
    try:
        whole = operator.index(value) >= least
    except TypeError:
        whole = False
    if not whole:
        raise InvalidInput(f"{name} must be a whole number of at least {least}, got {value!r}")


def require_fraction(name: str, value: float) -> None:
    """Raise `InvalidInput` unless `value` lies in [0, 1]."""
    if not (_is_finite(value) and 0 <= value <= 1):
        raise InvalidInput(f"{name} must lie between 0 and 1, got {_with_unit(value)}")


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except TypeError:
        # Settings files and notebooks bring strings and None, whatever the annotation says.
        return False


def _with_unit(value: float, unit: str = "") -> str:
    return f"{value} {unit}" if unit else f"{value}"
