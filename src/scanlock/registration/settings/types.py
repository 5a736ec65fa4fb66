"""Allowed values of a setting, from its annotation, and the docstrings of its fields."""

import ast
import dataclasses
import enum
import inspect
import json
import sys
import textwrap
import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any, Literal

Scalar = bool | int | float | str
"""Types that TOML and settings have in common."""

_SCALARS: dict[type, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a string",
}


@dataclass(frozen=True, slots=True)
class Allowed:
    """Values that one annotation allows.

    Attributes
    ----------
    classes : tuple of type
        Settings classes, written as tables. Where there are several, the key ``type`` of a table
        names its class.
    scalars : tuple of type
        Those of bool, int, float and str.
    literals : tuple
        Values of a Literal.
    enums : tuple of type
        Enumerations, whose members are written by name.
    tuples : tuple
        For each tuple, the annotations of its items: all the same, or one and an ellipsis.
    is_optional : bool
        Whether None is allowed.
    """

    classes: tuple[type, ...]
    scalars: tuple[type, ...]
    literals: tuple[Scalar, ...]
    enums: tuple[type[enum.Enum], ...]
    tuples: tuple[tuple[Any, ...], ...]
    is_optional: bool

    @property
    def choices(self) -> list[str]:
        """Literals and enumeration members, as written in a file."""
        members = [member.name for kind in self.enums for member in kind]
        return [json.dumps(value, ensure_ascii=False) for value in (*self.literals, *members)]

    def accepts(self, value: object) -> bool:
        """Return whether a TOML value is allowed without conversion; 1 is neither true nor 1.0."""
        return type(value) in self.scalars or any(
            type(value) is type(literal) and value == literal for literal in self.literals
        )

    def __str__(self) -> str:
        """Describe the allowed values for error messages."""
        parts = [_SCALARS[kind] for kind in self.scalars]
        if self.choices:
            parts.append(f"one of {', '.join(self.choices)}")
        if self.classes:
            parts.append(f"a table of {' or '.join(kind.__name__ for kind in self.classes)}")
        for items in self.tuples:
            count = "" if ... in items else f" of {len(items)}"
            parts.append(f"a list{count}, each {allowed(items[0])}")
        return " or ".join([*parts, '"none"'] if self.is_optional else parts)


@cache
def allowed(annotation: Any) -> Allowed:
    """Return the values that an annotation allows.

    A Protocol allows the settings classes of its own module that implement it, so that a file
    can choose between them but cannot name any other class.

    Raises
    ------
    TypeError
        A type that TOML cannot hold.
    """
    parts = list(_parts(annotation))
    kinds = [part for part in parts if isinstance(part, type)]
    literals = [part for part in parts if typing.get_origin(part) is Literal]
    tuples = [part for part in parts if typing.get_origin(part) is tuple and _is_homogeneous(part)]
    classes = [kind for kind in kinds if dataclasses.is_dataclass(kind)]
    scalars = [kind for kind in kinds if kind in _SCALARS]
    enums = [kind for kind in kinds if issubclass(kind, enum.Enum)]
    is_optional = types.NoneType in kinds
    if sum(map(len, (literals, tuples, classes, scalars, enums))) + is_optional < len(parts):
        raise TypeError(f"settings in files cannot be of type {annotation}")
    return Allowed(
        classes=tuple(classes),
        scalars=tuple(scalars),
        literals=tuple(value for literal in literals for value in typing.get_args(literal)),
        enums=tuple(enums),
        tuples=tuple(typing.get_args(part) for part in tuples),
        is_optional=is_optional,
    )


@cache
def annotations_of(settings: type) -> dict[str, Any]:
    """Return the annotation of each field of a settings class."""
    hints = typing.get_type_hints(settings)
    return {field.name: hints[field.name] for field in dataclasses.fields(settings)}


def default_of(settings: type, name: str, base: object) -> Any:
    """Return the default of a field; `dataclasses.MISSING` where it has none.

    The default is the value in `base` if that is of the same class, else that of the class.
    """
    if type(base) is settings:
        return getattr(base, name)
    [field] = [one for one in dataclasses.fields(settings) if one.name == name]
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


@cache
def docstrings_of(settings: type) -> dict[str, str]:
    """Return the docstring of each field as plain text; none where no source is available."""
    try:
        source = textwrap.dedent(inspect.getsource(settings))
    except OSError:
        return {}
    [definition] = ast.parse(source).body
    found: dict[str, str] = {}
    body = definition.body if isinstance(definition, ast.ClassDef) else []
    for field, text in pairwise(body):
        match field, text:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(docstring))),
            ):
                found[name] = " ".join(docstring.replace("`", "").split())
            case _:
                pass
    return found


def _is_homogeneous(annotation: Any) -> bool:
    """Return whether all items of a tuple have the same annotation."""
    return len({item for item in typing.get_args(annotation) if item is not ...}) == 1


def _parts(annotation: Any) -> Iterator[Any]:
    """Yield the alternatives of an annotation, with unions and protocols expanded."""
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        for part in typing.get_args(annotation):
            yield from _parts(part)
    elif isinstance(annotation, type) and getattr(annotation, "_is_protocol", False):
        yield from _implementations(annotation)
    else:
        yield annotation


def _implementations(protocol: type) -> Iterator[type]:
    """Yield the dataclasses of a protocol's module that have all of its public members."""
    members = {name for name in vars(protocol) if not name.startswith("_")}
    module = sys.modules[protocol.__module__]
    for value in vars(module).values():
        if (
            isinstance(value, type)
            and dataclasses.is_dataclass(value)
            and value.__module__ == module.__name__
            and members <= set(dir(value))
        ):
            yield value
