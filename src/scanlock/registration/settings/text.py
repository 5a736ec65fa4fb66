"""Settings as TOML text: as much of TOML as settings need, with a comment for each of them."""

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
"""What stands for None, which TOML does not have, where leaving a key out would not do."""

_WIDTH = 88


def settings_text(settings: object) -> str:
    """Return settings as TOML, every default included, with the docstrings as comments.

    Numbers keep every digit. A setting that is None by default, and is None, is a comment.

    Raises
    ------
    InvalidInput
        A value of a class that a file cannot name.
    """
    lines = [f"type = {_quoted(type(settings).__name__)}", *_fields(settings, None, "", True)]
    return "\n".join(lines) + "\n"


def _fields(settings: Any, base: object, path: str, explained: bool) -> Iterator[str]:
    """Yield the lines of all fields: plain ones first, for a table ends where another begins."""
    kind: type = type(settings)
    remarks = docstrings_of(kind) if explained else {}
    tables: list[str] = []
    for name, annotation in annotations_of(kind).items():
        value, allows = getattr(settings, name), allowed(annotation)
        if _is_table(value) or _is_table_list(value):
            tables.append(name)
            continue
        yield from _remark(remarks.get(name), allows)
        is_default = value is None and default_of(kind, name, base) is None
        yield f"{'# ' if is_default else ''}{name} = {_plain(value, _place(kind, name))}"
    for name in tables:
        value, allows = getattr(settings, name), allowed(annotations_of(kind)[name])
        inner = f"{path}.{name}" if path else name
        yield from _remark(remarks.get(name), allows) or ("",)
        if _is_table(value):
            yield f"[{inner}]"
            yield from _tag(value, allows, _place(kind, name))
            yield from _fields(value, default_of(kind, name, base), inner, explained)
            continue
        [each] = {items[0] for items in allows.tuples}
        for index, item in enumerate(value):
            yield from ("",) if index else ()
            yield f"[[{inner}]]"
            yield from _tag(item, allowed(each), _place(kind, name))
            yield from _fields(item, None, inner, explained and index == 0)


def _tag(settings: object, allows: Allowed, place: str) -> Iterator[str]:
    """Yield the line that says which class a table is of, where that is not clear."""
    name = type(settings).__name__
    if type(settings) not in allows.classes:
        raise InvalidInput(f"{place} must be {allows} to be written, got settings of type {name}")
    if len(allows.classes) > 1:
        yield f"type = {_quoted(name)}"


def _remark(text: str | None, allows: Allowed) -> list[str]:
    """Return what a setting is for as lines of comments, an empty one before them."""
    if text is None:
        return []
    sentences = [text]
    if len(allows.classes) > 1:
        sentences.append(f"One of {', '.join(kind.__name__ for kind in allows.classes)}.")
    elif allows.choices:
        sentences.append(f"One of {', '.join(allows.choices)}.")
    wrap = textwrap.TextWrapper(_WIDTH, initial_indent="# ", subsequent_indent="# ")
    return ["", *(line for sentence in sentences for line in wrap.wrap(sentence))]


def _is_table(value: object) -> bool:
    return dataclasses.is_dataclass(value)


def _is_table_list(value: object) -> bool:
    return isinstance(value, tuple) and any(map(_is_table, value))


def _place(kind: type, name: str) -> str:
    return f"{kind.__name__}.{name}"


def _plain(value: Any, place: str) -> str:
    """Return a value that fits on one line."""
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
        return f"[{', '.join(_plain(item, place) for item in items)}]"
    raise InvalidInput(f"{place} must be plain to be written, got {type(value).__name__}")


def _quoted(text: str) -> str:
    # JSON escapes all that TOML wants escaped but one character.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
