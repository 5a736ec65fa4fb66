"""The method options of a command: a name or a settings file, and changes of single settings."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from scanlock.cli.option_types import MethodName
from scanlock.errors import InvalidInput

if TYPE_CHECKING:
    from scanlock.registration.methods.protocol import Method

CHANGES = "--set"
"""Name of the option for single settings."""

Changes = Annotated[
    tuple[str, ...],
    Parameter(
        name=CHANGES,
        negative="",
        show_default=False,
        help="Change one setting: KEY=VALUE, such as voxel_size=0.3; can be repeated. The keys are "
        "those of scanlock settings METHOD --all.",
    ),
]
"""Changed settings of the method, each ``key=value``."""


def chosen_method(
    name: MethodName | None, settings: Path | None, changes: Sequence[str] = ()
) -> "str | Method[Any]":
    """Return the method of a name or a settings file, else the default.

    Parameters
    ----------
    name : str, optional
    settings : Path, optional
    changes : sequence of str
        Settings to change, each ``key=value``.

    Raises
    ------
    InvalidInput
        Both a name and a file are given, or a change is not valid.
    """
    from scanlock.registration.registry import DEFAULT_METHOD, named_method
    from scanlock.registration.settings.changes import changed_settings
    from scanlock.registration.settings.file import read_settings

    if settings is not None and name is not None:
        raise InvalidInput("give either --method or --settings: the settings file names its method")
    if settings is None:
        key, method = named_method(name or DEFAULT_METHOD)
        return changed_settings(method, changes, CHANGES) if changes else key
    return changed_settings(read_settings(settings), changes, CHANGES)
