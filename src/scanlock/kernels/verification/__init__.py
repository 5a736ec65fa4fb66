"""Kernels that verify a pose: overlap, score profiles and range images, without derivatives.

Objectives that a solver minimises belong to `kernels.gaussians`.
"""
