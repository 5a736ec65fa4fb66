"""Kernels of the simulated sensors."""
