"""Loops that must be fast: plain arrays in, plain arrays out; NumPy and Numba only."""
