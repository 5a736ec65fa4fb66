"""Method settings as TOML files: read, write and check them.

A file holds data only: it can name the classes of `METHODS` and of the annotations of their
fields, and no other code. Keys that are left out keep their defaults::

    method = "sgc-ndt-d2d"            # or type = "SgcNdt", the class
    [extractor]
    min_deviation = 0.05              # [m]
    [schedule.solver]
    type = "LevenbergMarquardt"       # needed where several classes are allowed

The name of a class stands for a table with its defaults: ``schedule.solver = "Bfgs"``.
"""

import dataclasses
import difflib
import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Any, TypeVar

from scanlock.errors import InvalidInput
from scanlock.io.atomic import atomic_file
from scanlock.io.errors import read_bytes
from scanlock.registration.methods.protocol import Method
from scanlock.registration.registry import METHODS
from scanlock.registration.settings.text import NONE, settings_text
from scanlock.registration.settings.types import Allowed, allowed, annotations_of, default_of

_Settings = TypeVar("_Settings")

_CLASS, _METHOD = "type", "method"
"""Keys for the class of a table and, at the top level, for the name of a method."""


def settings_to_toml(method: Method[Any]) -> str:
    """Return all settings of a method as TOML text, each with its documentation as a comment.

    Numbers keep every digit. A setting that is None, and is None by default, is commented out.

    Parameters
    ----------
    method : Method
        Settings of one of the classes in `METHODS`.

    Returns
    -------
    str

    Raises
    ------
    InvalidInput
        A method or a nested setting of a class that `settings_from_toml` cannot read.
    """
    known = {type(one) for one in METHODS.values()}
    if type(method) not in known:
        names = " or ".join(sorted(kind.__name__ for kind in known))
        raise InvalidInput(
            f"method must be of class {names} to be written as TOML, got {type(method).__name__}"
        )
    return settings_text(method)


def write_settings(path: str | os.PathLike[str], method: Method[Any]) -> None:
    """Write all settings of a method to a TOML file; see `settings_to_toml`.

    Parameters
    ----------
    path : path-like
        The file; an existing one is replaced once the new one is complete.
    method : Method

    Raises
    ------
    InvalidInput
        As for `settings_to_toml`.
    FileNotFoundError
        The folder does not exist.
    """
    text = settings_to_toml(method)
    with atomic_file(path) as handle:
        handle.write(text.encode())


def read_settings(path: str | os.PathLike[str]) -> Method[Any]:
    """Read the settings of a method from a TOML file.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Method
        The method with these settings; keys that are left out have their defaults.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        The path is a folder, or the file is empty.
    InvalidInput
        As for `settings_from_toml`.
    """
    return settings_from_toml(_text_of(Path(path)), str(path))


def read_settings_like(path: str | os.PathLike[str], default: _Settings) -> _Settings:
    """Read settings of another class than a method from a TOML file.

    Parameters
    ----------
    path : path-like
    default : object
        Settings of that class, whose values keys that are left out keep.

    Returns
    -------
    object
        Settings of the class of `default`.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        The path is a folder, or the file is empty.
    InvalidInput
        As for `settings_from_toml`.
    """
    root = _Location(str(path))
    content = _content(_text_of(Path(path)), root.source)
    return _settings(content, _class(content, {type(default)}, default, root), default, root)


def _text_of(path: Path) -> str:
    try:
        return read_bytes(path, "settings").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidInput(
            f"{path}: not TOML: byte {error.start} is not valid UTF-8; save the file as UTF-8"
        ) from error


def _content(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidInput(f"{source}: not TOML: {error}") from error


def settings_from_toml(text: str, source: str = "settings") -> Method[Any]:
    """Return the method whose settings a TOML text gives.

    Parameters
    ----------
    text : str
        TOML with a top-level ``method`` or ``type``.
    source : str
        Name of the text in error messages.

    Returns
    -------
    Method
        The method with these settings; keys that are left out have their defaults.

    Raises
    ------
    InvalidInput
        Invalid TOML, an unknown key, or a value of the wrong type or out of range; the message
        gives the key and the allowed values.
    """
    content = _content(text, source)
    root = _Location(source)
    if _METHOD not in content:
        kinds = {type(method) for method in METHODS.values()}
        return _settings(content, _class(content, kinds, None, root), None, root)
    name = content.pop(_METHOD)
    if not isinstance(name, str) or name not in METHODS:
        raise root.child(_METHOD).error(_not_among(name, METHODS))
    if _CLASS in content:
        raise root.child(_CLASS).error(f"cannot be combined with {_METHOD}; remove one of the two")
    return _settings(content, type(METHODS[name]), METHODS[name], root)


def settings_from_table(
    content: dict[str, Any], method: Method[Any], source: str = "settings"
) -> Method[Any]:
    """Return a method with the settings of a TOML table; missing keys keep its own values.

    Raises
    ------
    InvalidInput
        As for `settings_from_toml`.
    """
    return _settings(content, type(method), method, _Location(source))


@dataclass(frozen=True, slots=True)
class _Location:
    """Location of a value: the name of the file and the path of keys inside it."""

    source: str
    path: str = ""

    def child(self, key: str) -> "_Location":
        return _Location(self.source, f"{self.path}.{key}" if self.path else key)

    def item(self, index: int) -> "_Location":
        return _Location(self.source, f"{self.path}[{index}]")

    def error(self, text: str) -> InvalidInput:
        """Return an error whose subject is this value: ``file: key text``."""
        return InvalidInput(f"{self.source}: {self.path} {text}")

    def error_within(self, text: str) -> InvalidInput:
        """Return an error about something in this table: ``file: key: text``."""
        return InvalidInput(": ".join(part for part in (self.source, self.path, text) if part))


def _settings(content: dict[str, Any], kind: type, base: object, location: _Location) -> Any:
    """Return settings of one class; missing keys keep the values of `base` or the defaults."""
    annotations = annotations_of(kind)
    values: dict[str, Any] = {}
    for key, given in content.items():
        if key == _CLASS:
            continue
        here = location.child(key)
        if key not in annotations:
            raise here.error(
                f"is not a setting of {kind.__name__}, which has {', '.join(annotations)}"
                + _suggestion(key, annotations)
            )
        default = default_of(kind, key, base)
        values[key] = _value(given, allowed(annotations[key]), default, here)
    for key, annotation in annotations.items():
        if key not in values and default_of(kind, key, base) is MISSING:
            raise location.error_within(f"{kind.__name__} needs {key}, {allowed(annotation)}")
    try:
        if type(base) is kind:
            return dataclasses.replace(base, **values)  # pyright: ignore[reportArgumentType, reportUnknownVariableType]
        return kind(**values)
    except InvalidInput as error:
        raise location.error_within(str(error)) from error


def _value(given: Any, allows: Allowed, base: object, location: _Location) -> Any:
    """Return the value of a field from its TOML value."""
    if isinstance(given, dict) and allows.classes:
        content: dict[str, Any] = given
        kind = _class(content, set(allows.classes), base, location)
        return _settings(content, kind, base, location)
    if isinstance(given, list):
        items: list[Any] = given
        for kinds in allows.tuples:
            if ... in kinds or len(kinds) == len(items):
                return tuple(
                    _value(item, allowed(kinds[0]), None, location.item(index))
                    for index, item in enumerate(items)
                )
    if isinstance(given, str):
        if given == NONE and allows.is_optional:
            return None
        if given in {kind.__name__ for kind in allows.classes}:
            return _value({_CLASS: given}, allows, base, location)
        for members in (kind.__members__ for kind in allows.enums):
            if given in members:
                return members[given]
    if allows.accepts(given):
        return given
    if type(given) is int and float in allows.scalars:
        return float(given)
    raise location.error(f"must be {allows}, got {given!r}")


def _class(content: dict[str, Any], kinds: set[type], base: object, location: _Location) -> type:
    """Return the class that a table names, else the class of `base`, else the only one allowed."""
    names = {kind.__name__: kind for kind in sorted(kinds, key=lambda kind: kind.__name__)}
    if _CLASS in content:
        name = content[_CLASS]
        if not isinstance(name, str) or name not in names:
            raise location.child(_CLASS).error(_not_among(name, names))
        return names[name]
    if type(base) in kinds:
        return type(base)
    if len(kinds) > 1:
        raise location.child(_CLASS).error(f"must be given: one of {', '.join(names)}")
    return next(iter(kinds))


def _not_among(given: object, choices: Mapping[str, Any]) -> str:
    """Return the error text for a name that is not among the choices."""
    return f"must be one of {', '.join(choices)}, got {given!r}{_suggestion(str(given), choices)}"


def _suggestion(word: str, choices: Iterable[str]) -> str:
    """Return "; did you mean ...?" with the most similar choice, or nothing."""
    near = difflib.get_close_matches(word, choices, n=1)
    return f"; did you mean {near[0]}?" if near else ""
