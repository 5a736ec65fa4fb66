"""Short forms of values that hold arrays."""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from scanlock.arrays import short_repr


@dataclass(frozen=True)
class _Value:
    one: Any
    two: Any = None

    __repr__ = short_repr


def test_large_arrays_are_shown_by_type_and_shape():
    assert repr(_Value(np.zeros((1000, 3)))) == "_Value(one=<float64 (1000, 3)>, two=None)"


def test_small_arrays_and_numbers_are_shown_with_four_digits():
    text = repr(_Value(np.array([1.0, 2.123456]), 0.123456))
    assert "2.1235" in text
    assert "two=0.1235" in text
    assert "\n" not in repr(_Value(np.eye(3)))


def test_names_of_fields_and_lengths_of_tuples_are_shown():
    fields = MappingProxyType({"ring": np.zeros(5), "time": np.zeros(5)})
    assert repr(_Value(fields, tuple(range(100)))) == (
        "_Value(one={ring, time}, two=<tuple of 100>)"
    )
    assert repr(_Value((1, 2))) == "_Value(one=(1, 2), two=None)"
