"""Names for the arrays that travel through scanlock, with their shapes."""

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""(n, 3) coordinates [m]."""

Vector = NDArray[np.float64]
"""(n,) numbers."""

Matrix = NDArray[np.float64]
"""(m, n) numbers."""

Labels = NDArray[np.int64]
"""(n,) group of each row, contiguous from 0; -1 means left out."""

Mask = NDArray[np.bool_]
"""(n,) membership of each row."""


def frozen(array: NDArray[np.generic]) -> None:
    """Make an array read-only in place; every value type calls this on what it owns.

    Read-only arrays are a type of their own to Numba, so freezing all of them keeps one
    compiled signature for each kernel.
    """
    array.setflags(write=False)
