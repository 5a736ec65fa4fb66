"""Options of the registration method: a name or a settings file, and changes of single settings."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from scanlock.cli.option_types import DofName, MethodName
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


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True, slots=True)
class MethodOptions:
    """Options of a command that registers with one method."""

    method: Annotated[
        MethodName | None, Parameter(help="Registration method; auto by default.")
    ] = None
    """Name of the method."""

    settings: Annotated[
        Path | None,
        Parameter(help="A method with your own settings: TOML as printed by scanlock settings."),
    ] = None
    """Settings file, in place of a name."""

    changes: Changes = ()
    """Settings to change."""

    dof: Annotated[
        DofName,
        Parameter(
            help="Degrees of freedom to estimate: all, or fewer for levelled scanners (xyz+yaw) "
            "and planar motion (xy+yaw). The others keep the initial pose."
        ),
    ] = "xyz+rpy"
    """Degrees of freedom."""

    def chosen(self) -> "str | Method[Any]":
        """Return the method of the name or the settings file, else the default.

        Raises
        ------
        InvalidInput
            Both a name and a file are given, or a change is not valid.
        """
        from scanlock.registration.registry import DEFAULT_METHOD, named_method
        from scanlock.registration.settings.changes import changed_settings
        from scanlock.registration.settings.file import read_settings

        if self.settings is not None and self.method is not None:
            raise InvalidInput(
                "give either --method or --settings: the settings file names its method"
            )
        if self.settings is None:
            key, method = named_method(self.method or DEFAULT_METHOD)
            return changed_settings(method, self.changes, CHANGES) if self.changes else key
        return changed_settings(read_settings(self.settings), self.changes, CHANGES)
