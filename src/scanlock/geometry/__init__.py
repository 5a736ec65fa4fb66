"""Rotations and rigid motions; NumPy only."""
