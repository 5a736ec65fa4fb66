"""Settings round-trip through TOML to the last digit."""

import contextlib
import dataclasses
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanlock.errors import InvalidInput
from scanlock.registration.registry import METHODS
from scanlock.registration.settings.file import settings_from_toml, settings_to_toml
from scanlock.registration.settings.types import allowed, annotations_of

pytestmark = pytest.mark.slow


def _values(annotation):
    """Values of the types that an annotation allows, in range or not."""
    allows = allowed(annotation)
    kinds = [_settings(kind) for kind in allows.classes]
    if allows.literals:
        kinds.append(st.sampled_from(allows.literals))
    for kind in allows.scalars:
        kinds.append(
            {
                bool: st.booleans(),
                int: st.integers(1, 10**6),
                float: st.floats(1e-300, 1e300) | st.floats(0.0, 1.0),
                str: st.text(),
            }[kind]
        )
    kinds += [
        st.lists(_values(items[0]), min_size=1, max_size=3).map(tuple) for items in allows.tuples
    ]
    return st.one_of(kinds + [st.none()] * allows.is_optional)


@st.composite
def _settings(draw, kind, base=None):
    """Settings of a class with some fields changed, within their ranges."""
    annotations = annotations_of(kind)
    settings = base
    if base is None:
        needed = {
            field.name: draw(_values(annotations[field.name]))
            for field in dataclasses.fields(kind)
            if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        }
        try:
            settings = kind(**needed)
        except InvalidInput:
            settings = kind(**dict.fromkeys(needed, 1.0))
    for name in draw(st.lists(st.sampled_from(sorted(annotations)), max_size=2)):
        value = getattr(settings, name)
        if dataclasses.is_dataclass(value) and draw(st.booleans()):
            changed = draw(_settings(type(value), value))
        else:
            changed = draw(_values(annotations[name]))
        try:
            settings = dataclasses.replace(settings, **{name: changed})
        except InvalidInput:
            continue
    return settings


@given(
    st.sampled_from(sorted(METHODS)).flatmap(
        lambda name: _settings(type(METHODS[name]), METHODS[name])
    )
)
def test_settings_round_trip_through_toml(settings):
    text = settings_to_toml(settings)
    again = settings_from_toml(text)
    assert again == settings
    assert settings_to_toml(again) == text
    bare = "\n".join(line for line in text.splitlines() if not line.startswith("#"))
    assert tomllib.loads(bare) == tomllib.loads(text)


_TEXTS = {name: settings_to_toml(method).splitlines() for name, method in METHODS.items()}


@given(
    st.sampled_from(sorted(METHODS)),
    st.integers(0),
    st.sampled_from(
        ["", "= 1", '"x"', "1", "-1.5", "nan", "[]", "[[1]]", "{a = 1}", "true", "none"]
    ),
)
def test_an_edited_line_is_read_or_refused(name, row, value):
    lines = list(_TEXTS[name])
    row %= len(lines)
    lines[row] = lines[row].split("=")[0] + (f"= {value}" if "=" in lines[row] else value)
    with contextlib.suppress(InvalidInput):
        assert settings_to_toml(settings_from_toml("\n".join(lines)))
