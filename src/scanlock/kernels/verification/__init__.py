"""Kernels of the verification of a pose."""
