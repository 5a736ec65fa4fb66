"""Columns as binary formats store them: common types, and rows of little-endian values."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.io.scan_file import Field


def with_common_type(values: Field) -> Field:
    """Return booleans as uint8 and half-precision numbers as float32; leave others as they are."""
    if values.dtype.kind == "b":
        return values.astype(np.uint8)
    return values.astype(np.float32) if values.dtype == np.float16 else values


def row_table(columns: Mapping[str, Field]) -> NDArray[Any]:
    """Return the (n,) rows of columns of equal length, little-endian and without padding.

    Parameters
    ----------
    columns : mapping of str to (n,) or (n, k)
        At least one column.
    """
    layout: list[Any] = [
        (name, values.dtype.newbyteorder("<"), values.shape[1:]) for name, values in columns.items()
    ]
    table = np.empty(len(next(iter(columns.values()))), dtype=layout)
    for name, values in columns.items():
        table[name] = values
    return table
