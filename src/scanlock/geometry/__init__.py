"""Rotations, rigid transforms and their closed-form estimation; NumPy only.

Iterative estimation of poses belongs to `scanlock.optimisation`.
"""
