"""Array types of scanlock with their shapes, and read-only views."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

_Scalar = TypeVar("_Scalar", bound=np.generic)

Points = NDArray[np.float64]
"""(n, 3) coordinates [m]."""

Vector = NDArray[np.float64]
"""(n,) numbers."""

Matrix = NDArray[np.float64]
"""(m, n) numbers."""

Labels = NDArray[np.int64]
"""(n,) group of each row, contiguous from 0; -1 for none."""

Counts = NDArray[np.int64 | np.float64]
"""(k,) number of points of each Gaussian; merged ones may have a fractional count."""

Mask = NDArray[np.bool_]
"""(n,) membership of each row."""


def frozen(array: NDArray[np.generic]) -> None:
    """Make an array read-only in place; value classes apply it to the arrays they own.

    Numba compiles read-only and writable arrays separately. Freezing all of them keeps one
    compiled signature for each kernel.
    """
    array.setflags(write=False)


def read_only(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Return a read-only, C-contiguous view of an array; a copy where it is not contiguous.

    Indexing a frozen array gives a writable one. Passing this view to a kernel avoids a second
    compiled signature.
    """
    view = np.ascontiguousarray(array).view()
    frozen(view)
    return view


def short_repr(self: Any) -> str:
    """Return the repr of a dataclass with arrays as their shapes and numbers with four digits.

    Assigned to ``__repr__`` by dataclasses that hold arrays of points.
    """
    parts = [f"{one.name}={_short(getattr(self, one.name))}" for one in fields(self) if one.repr]
    return f"{type(self).__name__}({', '.join(parts)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        shape: tuple[int, ...] = value.shape
        return f"<{value.dtype} {shape}>" if value.size > _MAX_SHOWN else _numbers(value)
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(map(str, cast(Mapping[Any, Any], value))) + "}"
    if isinstance(value, tuple) and len(cast(tuple[Any, ...], value)) > _MAX_SHOWN:
        return f"<tuple of {len(cast(tuple[Any, ...], value))}>"
    return repr(value)


_MAX_SHOWN = 9
"""Maximum size of an array or tuple that is shown with its values."""


def _numbers(array: NDArray[Any]) -> str:
    return np.array2string(array, precision=4, suppress_small=True, separator=", ").replace(
        "\n", ""
    )
