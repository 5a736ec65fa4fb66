"""Settings of methods as TOML that people can read, change and keep.

A file holds data only: the classes it may name are those of `METHODS` and of the annotations of
their fields. Keys left out keep their defaults, so a file need not say more than it changes::

    method = "sgc-ndt-d2d"            # or type = "SgcNdt", the class
    [landmarks]
    deviation_floor = 0.05            # [m]
    [schedule.solver]
    type = "LevenbergMarquardt"       # where there are several to choose from
"""

import dataclasses
import difflib
import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Any

from scanlock.errors import InvalidInput
from scanlock.io.atomic import atomic_file
from scanlock.io.errors import read_bytes
from scanlock.registration.methods.protocol import Method
from scanlock.registration.registry import METHODS
from scanlock.registration.settings.text import NONE, settings_text
from scanlock.registration.settings.types import Allowed, allowed, annotations_of, default_of

_CLASS, _METHOD = "type", "method"
"""Keys that say what a table is of: a class, or at the top a method by its name."""


def settings_to_toml(method: Method[Any]) -> str:
    """Return all settings of a method as TOML, with what each is for as a comment.

    Numbers keep every digit. A setting that is None by default, and is None, is a comment.

    Raises
    ------
    InvalidInput
        Settings of a class that `settings_from_toml` would not know.
    """
    known = {type(one) for one in METHODS.values()}
    if type(method) not in known:
        names = " or ".join(sorted(kind.__name__ for kind in known))
        raise InvalidInput(f"only {names} can be written, got {type(method).__name__}")
    return settings_text(method)


def write_settings(path: str | os.PathLike[str], method: Method[Any]) -> None:
    """Write all settings of a method as `settings_to_toml` has them."""
    text = settings_to_toml(method)
    with atomic_file(path) as handle:
        handle.write(text.encode())


def read_settings(path: str | os.PathLike[str]) -> Method[Any]:
    """Return the method that a file describes.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        It is a folder, or empty.
    InvalidInput
        As for `settings_from_toml`.
    """
    path = Path(path)
    try:
        text = read_bytes(path, "settings").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidInput(f"{path}: not TOML: byte {error.start} is no text in UTF-8") from error
    return settings_from_toml(text, str(path))


def settings_from_toml(text: str, source: str = "settings") -> Method[Any]:
    """Return the method that a text in TOML describes.

    Parameters
    ----------
    text : str
    source : str
        What to call the text in errors.

    Raises
    ------
    InvalidInput
        No TOML, an unknown key, a value of the wrong type or out of range: says which, and what
        is allowed.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidInput(f"{source}: not TOML: {error}") from error
    place = _Place(source)
    if _METHOD not in content:
        kinds = {type(method) for method in METHODS.values()}
        return _settings(content, _class(content, kinds, None, place), None, place)
    name = content.pop(_METHOD)
    if not isinstance(name, str) or name not in METHODS:
        raise place.inside(_METHOD).fault(_choice(name, METHODS))
    if _CLASS in content:
        raise place.inside(_CLASS).fault(f"repeats what {_METHOD} says; leave one of them out")
    return _settings(content, type(METHODS[name]), METHODS[name], place)


@dataclass(frozen=True, slots=True)
class _Place:
    """Where in which file a value stands."""

    source: str
    path: str = ""

    def inside(self, key: str) -> "_Place":
        return _Place(self.source, f"{self.path}.{key}" if self.path else key)

    def item(self, index: int) -> "_Place":
        return _Place(self.source, f"{self.path}[{index}]")

    def fault(self, text: str) -> InvalidInput:
        return InvalidInput(f"{self.source}: {self.path} {text}")

    def fault_inside(self, text: str) -> InvalidInput:
        return InvalidInput(": ".join(part for part in (self.source, self.path, text) if part))


def _settings(content: dict[str, Any], kind: type, base: object, place: _Place) -> Any:
    """Return settings of one class; what is left out stays as in `base`, or by default."""
    annotations = annotations_of(kind)
    values: dict[str, Any] = {}
    for key, given in content.items():
        if key == _CLASS:
            continue
        here = place.inside(key)
        if key not in annotations:
            raise here.fault(
                f"is no setting of {kind.__name__}, which has {', '.join(annotations)}"
                + _nearest(key, annotations)
            )
        default = default_of(kind, key, base)
        values[key] = _value(given, allowed(annotations[key]), default, here)
    for key, annotation in annotations.items():
        if key not in values and default_of(kind, key, base) is MISSING:
            raise place.fault_inside(f"{kind.__name__} needs {key}, {allowed(annotation)}")
    try:
        if type(base) is kind:
            return dataclasses.replace(base, **values)  # pyright: ignore[reportArgumentType, reportUnknownVariableType]
        return kind(**values)
    except InvalidInput as error:
        raise place.fault_inside(str(error)) from error


def _value(given: Any, allows: Allowed, base: object, place: _Place) -> Any:
    """Return the value of a field that a file gives."""
    if isinstance(given, dict) and allows.classes:
        content: dict[str, Any] = given
        kind = _class(content, set(allows.classes), base, place)
        return _settings(content, kind, base, place)
    if isinstance(given, list):
        items: list[Any] = given
        for kinds in allows.tuples:
            if ... in kinds or len(kinds) == len(items):
                return tuple(
                    _value(item, allowed(kinds[0]), None, place.item(index))
                    for index, item in enumerate(items)
                )
    if isinstance(given, str):
        if given == NONE and allows.is_optional:
            return None
        for members in (kind.__members__ for kind in allows.enums):
            if given in members:
                return members[given]
    if allows.takes(given):
        return given
    if type(given) is int and float in allows.scalars:
        return float(given)
    raise place.fault(f"must be {allows}, got {given!r}")


def _class(content: dict[str, Any], kinds: set[type], base: object, place: _Place) -> type:
    """Return the class that a table names; where it names none, the only or the default one."""
    names = {kind.__name__: kind for kind in sorted(kinds, key=lambda kind: kind.__name__)}
    if _CLASS in content:
        name = content[_CLASS]
        if not isinstance(name, str) or name not in names:
            raise place.inside(_CLASS).fault(_choice(name, names))
        return names[name]
    if type(base) in kinds:
        return type(base)
    if len(kinds) > 1:
        raise place.inside(_CLASS).fault(f"must be given: one of {', '.join(names)}")
    return next(iter(kinds))


def _choice(given: object, choices: Mapping[str, Any]) -> str:
    """Return what is wrong with a name that is not among others."""
    return f"must be one of {', '.join(choices)}, got {given!r}{_nearest(str(given), choices)}"


def _nearest(word: str, choices: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, choices, n=1)
    return f"; did you mean {near[0]}?" if near else ""
