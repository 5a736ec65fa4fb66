import dataclasses
import enum
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import pytest

from scanlock.registration.methods.icp import distance_rejection
from scanlock.registration.registry import METHODS
from scanlock.registration.settings.types import allowed, annotations_of, default_of, docstrings_of
from scanlock.segmentation import clusters


class _Colour(enum.Enum):
    RED = 1
    BLUE = 2


class _Shape(Protocol):
    @property
    def width(self) -> float: ...

    def area(self, scale: float) -> float: ...


@dataclass(frozen=True)
class _Square:
    width: float = 1.0
    """Side [m]."""

    def area(self, scale):
        return self.width**2


@dataclass(frozen=True)
class _Line:
    width: float
    """Length [m];
    ``inf`` is not for `lines`."""

    colour: _Colour = _Colour.RED


@dataclass(frozen=True)
class _Drawing:
    shape: _Shape = dataclasses.field(default_factory=lambda: _Square(width=7.0))


def test_a_protocol_allows_the_classes_of_its_module_that_implement_it():
    assert allowed(_Shape).classes == (_Square,)
    assert allowed(clusters.MergeTest).classes == (
        clusters.MeanDistance,
        clusters.L2Distance,
        clusters.GaussianFit,
    )
    assert distance_rejection.AdaptiveRejection in allowed(distance_rejection.Rejection).classes
    assert distance_rejection.Rejection not in allowed(distance_rejection.Rejection).classes


@pytest.mark.parametrize(
    ("annotation", "words"),
    [
        (float, "a number"),
        (int | None, 'a whole number or "none"'),
        (Literal["a", 1] | bool, 'true or false or one of "a", 1'),
        (_Colour, 'one of "RED", "BLUE"'),
        (_Square | _Line | None, 'a table of _Square or _Line or "none"'),
        (tuple[float, ...], "a list, each a number"),
        (tuple[tuple[int, int], ...], "a list, each a list of 2, each a whole number"),
    ],
)
def test_allowed_values_are_described_in_words(annotation, words):
    assert str(allowed(annotation)) == words


@pytest.mark.parametrize("annotation", [np.ndarray, dict[str, int], tuple[int, str], list[int]])
def test_types_that_toml_cannot_hold_are_refused(annotation):
    with pytest.raises(TypeError, match="settings in files cannot be of type"):
        allowed(annotation)


def test_defaults_come_from_the_base_settings_or_the_class():
    assert default_of(_Drawing, "shape", None) == _Square(width=7.0)
    assert default_of(_Square, "width", _Square(width=3.0)) == 3.0
    assert default_of(_Square, "width", _Line(width=3.0)) == 1.0
    assert default_of(_Line, "width", None) is dataclasses.MISSING


def test_docstrings_are_plain_text_on_one_line():
    assert docstrings_of(_Line) == {"width": "Length [m]; inf is not for lines."}


def _classes(kind, found):
    if kind not in found:
        found.add(kind)
        for annotation in annotations_of(kind).values():
            allows = allowed(annotation)
            inner = [one for items in allows.tuples for one in allowed(items[0]).classes]
            for one in (*allows.classes, *inner):
                _classes(one, found)
    return found


@pytest.mark.parametrize("name", METHODS)
def test_every_setting_of_every_method_can_be_written_and_is_documented(name):
    for kind in _classes(type(METHODS[name]), set()):
        assert set(docstrings_of(kind)) == set(annotations_of(kind))
        # Reserved keys: the class of a table, and the name of a method.
        assert not {"type", "method"} & set(annotations_of(kind))
