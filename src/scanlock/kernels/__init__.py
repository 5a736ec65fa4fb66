"""Loops that must be fast: plain arrays in, plain arrays out; NumPy and Numba only.

The subpackages are named after their users. Code that checks its input, raises errors or makes
decisions belongs to the users.
"""
