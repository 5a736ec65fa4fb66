"""Array types of scanlock with their shapes, and read-only views."""

from typing import TypeVar

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
