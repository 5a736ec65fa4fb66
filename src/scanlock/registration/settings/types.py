"""What the annotation of a setting allows a file to hold, and what its docstring says."""

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
"""What TOML and settings write alike."""

_SCALARS: dict[type, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
}


@dataclass(frozen=True, slots=True)
class Allowed:
    """What one annotation allows.

    Attributes
    ----------
    classes : tuple of type
        Settings, one table each; a table says which by its key ``type`` where there are several.
    scalars : tuple of type
        Among bool, int, float and str.
    words : tuple
        The values of a Literal.
    enums : tuple of type
        Their members go by name.
    tuples : tuple
        For each tuple the annotations of its items, alike, or of one and an ellipsis.
    is_optional : bool
        Whether None will do.
    """

    classes: tuple[type, ...]
    scalars: tuple[type, ...]
    words: tuple[Scalar, ...]
    enums: tuple[type[enum.Enum], ...]
    tuples: tuple[tuple[Any, ...], ...]
    is_optional: bool

    @property
    def choices(self) -> list[str]:
        """The words and members to choose from, as a file has them."""
        members = [member.name for kind in self.enums for member in kind]
        return [json.dumps(word, ensure_ascii=False) for word in (*self.words, *members)]

    def takes(self, value: object) -> bool:
        """Tell whether a value will do just as a file has it; 1 is neither true nor 1.0."""
        return type(value) in self.scalars or any(
            type(value) is type(word) and value == word for word in self.words
        )

    def __str__(self) -> str:
        """Say it in words."""
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
    """Return what an annotation allows.

    A Protocol allows the settings that keep it among those of its own module, so that a file can
    choose between them but cannot name any other class.

    Raises
    ------
    TypeError
        It is of a kind that no file can hold.
    """
    parts = list(_parts(annotation))
    kinds = [part for part in parts if isinstance(part, type)]
    literals = [part for part in parts if typing.get_origin(part) is Literal]
    tuples = [part for part in parts if typing.get_origin(part) is tuple and _is_even(part)]
    classes = [kind for kind in kinds if dataclasses.is_dataclass(kind)]
    scalars = [kind for kind in kinds if kind in _SCALARS]
    enums = [kind for kind in kinds if issubclass(kind, enum.Enum)]
    is_optional = types.NoneType in kinds
    if sum(map(len, (literals, tuples, classes, scalars, enums))) + is_optional < len(parts):
        raise TypeError(f"settings in files cannot be of type {annotation}")
    return Allowed(
        classes=tuple(classes),
        scalars=tuple(scalars),
        words=tuple(word for literal in literals for word in typing.get_args(literal)),
        enums=tuple(enums),
        tuples=tuple(typing.get_args(part) for part in tuples),
        is_optional=is_optional,
    )


@cache
def annotations_of(settings: type) -> dict[str, Any]:
    """Return the annotation of each field of a class of settings."""
    hints = typing.get_type_hints(settings)
    return {field.name: hints[field.name] for field in dataclasses.fields(settings)}


def default_of(settings: type, name: str, base: object) -> Any:
    """Return what a field is when nobody sets it; `dataclasses.MISSING` where it must be set.

    That of `base`, where that is of the same class, else the default of the class.
    """
    if type(base) is settings:
        return getattr(base, name)
    [field] = [one for one in dataclasses.fields(settings) if one.name == name]
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


@cache
def docstrings_of(settings: type) -> dict[str, str]:
    """Return the docstring of each field as plain text; none where the source is not at hand."""
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
                ast.Expr(value=ast.Constant(value=str(words))),
            ):
                found[name] = " ".join(words.replace("`", "").split())
            case _:
                pass
    return found


def _is_even(annotation: Any) -> bool:
    """Tell whether all items of a tuple have the same annotation."""
    return len({item for item in typing.get_args(annotation) if item is not ...}) == 1


def _parts(annotation: Any) -> Iterator[Any]:
    """Yield the alternatives of an annotation, unions and protocols taken apart."""
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        for part in typing.get_args(annotation):
            yield from _parts(part)
    elif isinstance(annotation, type) and getattr(annotation, "_is_protocol", False):
        yield from _keepers(annotation)
    else:
        yield annotation


def _keepers(protocol: type) -> Iterator[type]:
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
