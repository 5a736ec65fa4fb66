"""Arrays that come and go with every scan, without asking the system for fresh memory each time."""

import numpy as np

_LARGEST = 1 << 24
"""Arrays of fewer bytes than this are made of memory that was used before."""


def keep_freed_memory() -> None:
    """Let the C library keep what arrays of up to 16 MB free, for those that come next.

    The library of GNU hands out a large array as fresh pages and gives them back as soon as it is
    freed; the first touch of each page then costs more than the arithmetic on it, a tenth to a
    quarter of the time of a scan. It stops doing so for sizes that it has once seen freed. No page
    of this one is ever touched, so it costs nothing; elsewhere it has no effect.
    """
    np.empty(_LARGEST, np.uint8)
