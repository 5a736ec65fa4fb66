"""Reuse of freed memory for the arrays of consecutive scans."""

import numpy as np

_MAX_BYTES = 1 << 24
"""Size below which freed arrays are reused."""


def keep_freed_memory() -> None:
    """Make the C library of GNU reuse the freed memory of arrays of up to 16 MB.

    By default it requests fresh pages for a large array and returns them when the array is freed.
    The first access to each page then costs 10 to 25 % of the time of a scan. It stops returning
    them for sizes that it has seen freed once. This function frees one array whose pages are never
    accessed, at no cost; with other C libraries it has no effect.
    """
    np.empty(_MAX_BYTES, np.uint8)
