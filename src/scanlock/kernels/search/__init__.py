"""Kernels of the global search."""
