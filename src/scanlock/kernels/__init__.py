"""Loops that must be fast: plain arrays in, plain arrays out; NumPy and Numba only."""

from scanlock.kernels._memory import keep_freed_memory

keep_freed_memory()
