"""Rotations and rigid transforms; NumPy only."""
