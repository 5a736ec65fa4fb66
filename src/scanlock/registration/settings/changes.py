"""Changes of single settings, as text: ``search.headings=120``."""

import tomllib
from collections.abc import Sequence
from typing import Any

from scanlock.errors import InvalidInput
from scanlock.registration.methods.protocol import Method
from scanlock.registration.settings.file import settings_from_table


def changed_settings(
    method: Method[Any], changes: Sequence[str], source: str = "changes"
) -> Method[Any]:
    """Return a copy of a method with some of its settings changed.

    Parameters
    ----------
    method : Method
    changes : sequence of str
        ``key=value``: the path of a setting in the TOML of `settings_to_toml`, and its value.
        A text needs no quotes. The name of a class stands for its default settings.
    source : str
        Name of the changes in error messages.

    Returns
    -------
    Method
        Keys that are not changed keep their values.

    Raises
    ------
    InvalidInput
        A change without ``=``, an unknown key, a key given twice, or a value of the wrong type or
        out of range.
    """
    content: dict[str, Any] = {}
    for change in changes:
        key, separator, text = change.partition("=")
        path = [part.strip() for part in key.split(".")]
        if not separator or not all(path):
            raise InvalidInput(
                f"{source} must be KEY=VALUE, such as voxel_size=0.3, got {change!r}"
            )
        _insert(content, path, _value_of(text.strip()), source)
    return settings_from_table(content, method, source)


def _insert(content: dict[str, Any], path: list[str], value: Any, source: str) -> None:
    """Insert a value into nested tables."""
    *tables, name = path
    for part in tables:
        inner = content.setdefault(part, {})
        if not isinstance(inner, dict):
            # The name of a class, followed by settings of that class.
            inner = content[part] = {"type": inner}
        content = inner
    if name in content:
        raise InvalidInput(f"{source}: {'.'.join(path)} must be given once, got it twice")
    content[name] = value


def _value_of(text: str) -> Any:
    """Return the value of a TOML literal; any other text is a string."""
    try:
        content = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return content["value"] if len(content) == 1 else text
