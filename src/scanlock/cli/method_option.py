"""The method option of a command: a name, or a settings file."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scanlock.cli.option_types import MethodName
from scanlock.errors import InvalidInput

if TYPE_CHECKING:
    from scanlock.registration.methods.protocol import Method


def chosen_method(name: MethodName | None, settings: Path | None) -> "str | Method[Any]":
    """Return the method of a name or a settings file, else the default.

    Raises
    ------
    InvalidInput
        Both are given.
    """
    from scanlock.registration.registry import DEFAULT_METHOD, named_method
    from scanlock.registration.settings.file import read_settings

    if settings is None:
        return named_method(name or DEFAULT_METHOD)[0]
    if name is not None:
        raise InvalidInput("give either --method or --settings: the settings file names its method")
    return read_settings(settings)
