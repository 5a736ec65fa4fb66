"""The settings of methods as TOML, every default written out, and back again.

A settings dataclass is a table with the name of its class under ``type``; settings inside settings
are tables inside tables. Only classes that `METHODS` can be made of are ever built from a file.
"""

import dataclasses
import enum
import functools
import json
import math
import os
import sys
import tomllib
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from scanlock.errors import InvalidInput
from scanlock.io.atomic import atomic_file
from scanlock.io.faults import read_bytes
from scanlock.registration.methods import METHODS, Method

_TYPE = "type"
_NONE = "none"
"""Stands for no value, where the default is another one."""


def settings_to_toml(method: Method[Any]) -> str:
    """Return all settings of a method as TOML; numbers keep every digit."""
    lines = list(_table(method, ""))
    return "\n".join(lines).strip("\n") + "\n"


def settings_from_toml(text: str, source: str = "settings") -> Method[Any]:
    """Return the method that a text of TOML describes; what is left out has its default.

    Parameters
    ----------
    text : str
        As `settings_to_toml` writes it; at least ``type = "SgcNdt"``.
    source : str
        What to call the text in errors.

    Raises
    ------
    InvalidInput
        No TOML, an unknown class or key, a value of the wrong kind or out of range; says which
        key, and what would do.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidInput(f"{source}: not TOML: {error}") from error
    roots = {type(method).__name__: type(method) for method in METHODS.values()}
    return _built(content, tuple(roots.values()), source, "")


def write_settings(path: str | os.PathLike[str], method: Method[Any]) -> None:
    """Write all settings of a method as TOML."""
    with atomic_file(path) as handle:
        handle.write(settings_to_toml(method).encode())


def read_settings(path: str | os.PathLike[str]) -> Method[Any]:
    """Return the method that a file of TOML describes.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    InvalidInput
        As `settings_from_toml`.
    """
    path = Path(path)
    try:
        text = read_bytes(path, "settings").decode()
    except UnicodeDecodeError as error:
        raise InvalidInput(f"{path}: not TOML: it is no text in UTF-8") from error
    return settings_from_toml(text, str(path))


def _table(settings: Any, name: str) -> Iterator[str]:
    """Yield the lines of a table: its own values first, as TOML asks, then tables inside."""
    if name:
        yield from ("", f"[{name}]")
    yield f"{_TYPE} = {json.dumps(type(settings).__name__)}"
    inside: list[tuple[str, Any]] = []
    for field in _fields(type(settings)):
        value = getattr(settings, field.name)
        if dataclasses.is_dataclass(value):
            inside.append((field.name, value))
        elif value is not None:
            yield f"{field.name} = {_text(value)}"
        elif _default(field) is not None:
            yield f"{field.name} = {json.dumps(_NONE)}"
    for key, value in inside:
        yield from _table(value, f"{name}.{key}" if name else key)


def _text(value: Any) -> str:
    if dataclasses.is_dataclass(value):
        parts = [f"{_TYPE} = {json.dumps(type(value).__name__)}"]
        for field in _fields(type(value)):
            entry = getattr(value, field.name)
            if entry is not None:
                parts.append(f"{field.name} = {_text(entry)}")
            elif _default(field) is not None:
                parts.append(f"{field.name} = {json.dumps(_NONE)}")
        return "{ " + ", ".join(parts) + " }"
    if isinstance(value, enum.Enum):
        return _text(value.value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        # TOML has inf and nan as Python spells them, and asks for a point or an exponent.
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, tuple):
        entries = [_text(entry) for entry in typing.cast("tuple[Any, ...]", value)]
        if any(entry.startswith("{") for entry in entries):
            return "[\n" + "".join(f"  {entry},\n" for entry in entries) + "]"
        return "[" + ", ".join(entries) + "]"
    raise InvalidInput(f"settings of type {type(value).__name__} cannot be written as TOML")


def _built(content: Any, classes: tuple[type, ...], source: str, key: str) -> Any:
    where = f"{source}: {key}" if key else source
    if not isinstance(content, Mapping):
        raise InvalidInput(f"{where} must be a table, got {content!r}")
    table = dict(typing.cast("Mapping[str, Any]", content))
    named = {cls.__name__: cls for cls in classes}
    name = table.pop(_TYPE, next(iter(named)) if len(named) == 1 else None)
    if not isinstance(name, str) or name not in named:
        raise InvalidInput(f"{where}: type must be one of {', '.join(named)}, got {name!r}")
    cls = named[name]
    hints = _hints(cls)
    known = [field.name for field in _fields(cls)]
    values: dict[str, Any] = {}
    for entry, value in table.items():
        path = f"{key}.{entry}" if key else entry
        if entry not in known:
            raise InvalidInput(
                f"{source}: {path} is no setting of {name}; it has {', '.join(known)}"
            )
        values[entry] = _value(value, hints[entry], source, path)
    missing = [field.name for field in _fields(cls) if _is_required(field)]
    missing = [entry for entry in missing if entry not in values]
    if missing:
        raise InvalidInput(f"{where}: {name} needs a value for {', '.join(missing)}")
    try:
        return cls(**values)
    except InvalidInput as error:
        raise InvalidInput(f"{where}: {error}") from error


def _value(value: Any, hint: Any, source: str, key: str) -> Any:
    options = _options(hint)
    tables = tuple(option for option in options if dataclasses.is_dataclass(option))
    if tables and isinstance(value, Mapping):
        return _built(typing.cast("Any", value), typing.cast("Any", tables), source, key)
    for option in options:
        if option is type(None) and value == _NONE:
            return None
        found = _plain(value, option, source, key)
        if found is not None:
            return found[0]
    wanted = ", ".join(_spelled(option) for option in options)
    raise InvalidInput(f"{source}: {key} must be {wanted}, got {value!r}")


def _plain(value: Any, option: Any, source: str, key: str) -> tuple[Any] | None:
    """Return the value as an option has it, in a tuple, or None where it does not fit."""
    origin = typing.get_origin(option)
    if origin is typing.Literal:
        return (value,) if value in typing.get_args(option) else None
    if origin is tuple and isinstance(value, list):
        entries = typing.cast("list[Any]", value)
        kinds = typing.get_args(option)
        repeated = len(kinds) == 2 and kinds[1] is Ellipsis
        if not repeated and len(kinds) != len(entries):
            return None
        return (
            tuple(
                _value(entry, kinds[0] if repeated else kinds[k], source, f"{key}[{k}]")
                for k, entry in enumerate(entries)
            ),
        )
    if isinstance(option, type) and issubclass(option, enum.Enum):
        return next(((member,) for member in option if member.value == value), None)
    if isinstance(value, bool):
        return (value,) if option is bool else None
    if option is float and isinstance(value, (int, float)) and not math.isnan(value):
        return (float(value),)
    return (value,) if option in (int, str) and isinstance(value, option) else None


def _options(hint: Any) -> tuple[Any, ...]:
    """Return the members of a union, the settings that keep a protocol, or the one type."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return tuple(option for member in typing.get_args(hint) for option in _options(member))
    if getattr(hint, "_is_protocol", False):
        # Settings live beside the protocol that they keep.
        asked = [name for name in vars(hint) if not name.startswith("_")]
        beside = vars(sys.modules[hint.__module__]).values()
        return tuple(
            one
            for one in beside
            if isinstance(one, type)
            and dataclasses.is_dataclass(one)
            and all(hasattr(one, name) for name in asked)
        )
    return (hint,)


def _spelled(option: Any) -> str:
    if typing.get_origin(option) is typing.Literal:
        return " or ".join(repr(choice) for choice in typing.get_args(option))
    if typing.get_origin(option) is tuple:
        return "a list"
    if option is type(None):
        return repr(_NONE)
    names = {float: "a number", int: "a whole number", bool: "true or false", str: "text"}
    return names.get(option, f"a table of type {getattr(option, '__name__', option)}")


def _fields(cls: Any) -> list[dataclasses.Field[Any]]:
    return [field for field in dataclasses.fields(cls) if field.init]


def _is_required(field: "dataclasses.Field[Any]") -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _default(field: "dataclasses.Field[Any]") -> Any:
    return None if field.default is dataclasses.MISSING else field.default


@functools.cache
def _hints(cls: type) -> Mapping[str, Any]:
    return typing.get_type_hints(cls)
