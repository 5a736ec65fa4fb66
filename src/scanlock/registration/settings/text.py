"""TOML text of settings, with the docstring of each attribute as a comment."""

import dataclasses
import enum
import json
import textwrap
from collections.abc import Iterator
from numbers import Integral, Real
from typing import Any

from scanlock.errors import InvalidInput
from scanlock.registration.settings.types import (
    Allowed,
    allowed,
    annotations_of,
    default_of,
    docstrings_of,
)

NONE = "none"
"""TOML value for None, used where leaving a key out would mean another default."""

_COMMENT_WIDTH = 88


def settings_text(settings: object) -> str:
    """Return settings as TOML, defaults included, with docstrings as comments.

    Numbers keep every digit. A setting that is None, and is None by default, is commented out.

    Raises
    ------
    InvalidInput
        A value of a class that its annotation does not allow in a file.
    """
    lines = [f"type = {_quoted(type(settings).__name__)}", *_fields(settings, None, "", True)]
    return "\n".join(lines) + "\n"


def setting_text(settings: object, key: str) -> str:
    """Return the TOML line of one setting, with its docstring as a comment above.

    Parameters
    ----------
    settings : object
        Settings of a method.
    key : str
        Path of the setting, such as ``"search.headings"``.

    Raises
    ------
    AttributeError
        The settings have no such path.
    """
    *path, name = key.split(".")
    for part in path:
        settings = getattr(settings, part)
    kind = type(settings)
    value, allows = getattr(settings, name), allowed(annotations_of(kind)[name])
    lines = _comment(docstrings_of(kind).get(name), allows)
    mark = "# " if value is None else ""
    shown = type(value).__name__ if _is_table(value) else value
    return "\n".join([*lines, f"{mark}{key} = {_plain(shown, _full_name(kind, name))}"]) + "\n"


def _fields(settings: Any, base: object, path: str, with_comments: bool) -> Iterator[str]:
    """Yield the lines of all fields: plain values first, since a table ends at the next header."""
    kind: type = type(settings)
    docstrings = docstrings_of(kind) if with_comments else {}
    tables: list[str] = []
    for name, annotation in annotations_of(kind).items():
        value, allows = getattr(settings, name), allowed(annotation)
        if _is_table(value) or _is_table_list(value):
            tables.append(name)
            continue
        yield from _comment(docstrings.get(name), allows)
        is_default = value is None and default_of(kind, name, base) is None
        yield f"{'# ' if is_default else ''}{name} = {_plain(value, _full_name(kind, name))}"
    for name in tables:
        value, allows = getattr(settings, name), allowed(annotations_of(kind)[name])
        inner = f"{path}.{name}" if path else name
        yield from _comment(docstrings.get(name), allows) or ("",)
        if _is_table(value):
            yield f"[{inner}]"
            yield from _class_line(value, allows, _full_name(kind, name))
            yield from _fields(value, default_of(kind, name, base), inner, with_comments)
            continue
        [each] = {items[0] for items in allows.tuples}
        for index, item in enumerate(value):
            yield from ("",) if index else ()
            yield f"[[{inner}]]"
            yield from _class_line(item, allowed(each), _full_name(kind, name))
            yield from _fields(item, None, inner, with_comments and index == 0)


def _class_line(settings: object, allows: Allowed, field: str) -> Iterator[str]:
    """Yield the line with the class of a table, where several classes are allowed."""
    name = type(settings).__name__
    if type(settings) not in allows.classes:
        raise InvalidInput(f"{field} must be {allows} to be written as TOML, got {name}")
    if len(allows.classes) > 1:
        yield f"type = {_quoted(name)}"


def _comment(text: str | None, allows: Allowed) -> list[str]:
    """Return an empty line and the comment lines of a setting: its docstring and its choices."""
    if text is None:
        return []
    sentences = [text]
    names = [kind.__name__ for kind in allows.classes] or allows.choices
    if allows.is_optional and (allows.scalars or allows.tuples):
        sentences.append(f"Either {allows}.")
    elif allows.is_optional:
        sentences.append(f"One of {', '.join([*names, _quoted(NONE)])}.")
    elif len(names) > 1:
        sentences.append(f"One of {', '.join(names)}.")
    wrap = textwrap.TextWrapper(_COMMENT_WIDTH, initial_indent="# ", subsequent_indent="# ")
    return ["", *(line for sentence in sentences for line in wrap.wrap(sentence))]


def _is_table(value: object) -> bool:
    return dataclasses.is_dataclass(value)


def _is_table_list(value: object) -> bool:
    return isinstance(value, tuple) and any(map(_is_table, value))


def _full_name(kind: type, name: str) -> str:
    return f"{kind.__name__}.{name}"


def _plain(value: Any, field: str) -> str:
    """Return the TOML of a value that is no table."""
    if value is None:
        return _quoted(NONE)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, enum.Enum):
        return _quoted(value.name)
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, Integral):
        return repr(int(value))
    if isinstance(value, Real):
        # TOML spells floats, inf and nan as Python does.
        return repr(float(value))
    if isinstance(value, tuple):
        items: tuple[Any, ...] = value
        return f"[{', '.join(_plain(item, field) for item in items)}]"
    raise InvalidInput(
        f"{field} must be a number, string, list or table to be written as TOML, got "
        f"{type(value).__name__}"
    )


def _quoted(text: str) -> str:
    # JSON escapes every character that TOML requires to be escaped, except DEL.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
