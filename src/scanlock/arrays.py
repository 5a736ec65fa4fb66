"""Names for the arrays that travel through scanlock, with their shapes."""

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
"""(n,) group of each row, contiguous from 0; -1 means left out."""

Counts = NDArray[np.int64 | np.float64]
"""(k,) points behind each part; of merged parts seldom whole."""

Mask = NDArray[np.bool_]
"""(n,) membership of each row."""


def frozen(array: NDArray[np.generic]) -> None:
    """Make an array read-only in place; every value type calls this on what it owns.

    Read-only arrays are a type of their own to Numba, so freezing all of them keeps one
    compiled signature for each kernel.
    """
    array.setflags(write=False)


def read_only(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Return a read-only, C-contiguous view of an array; a copy where it is not contiguous.

    Indexing a frozen array gives a writable one. A kernel that is handed such an array gets
    this view of it, or it would be compiled a second time.
    """
    view = np.ascontiguousarray(array).view()
    frozen(view)
    return view
