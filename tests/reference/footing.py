"""Slow twin of `verification.plane_constraints`: one plane after the other, by definition."""

import numpy as np


def summed(surface, origin):
    """Return the information, the gradient and what of the information is noise of the normals."""
    information, gradient, doubtful = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6))
    for place, normal, gap, doubt in zip(
        surface.points, surface.normals, surface.residuals, surface.normal_covariances, strict=True
    ):
        weight = 1.0 / (1.0 + (gap / 0.1) ** 2)

        def change(along, place=place):
            """How far a step moves the place along a vector."""
            return np.array([*along, *np.cross(place - origin, along)])

        row = change(normal)
        information += weight * np.outer(row, row)
        gradient += weight * gap * row
        # The doubt is a sum of squares of independent errors of the normal.
        variances, axes = np.linalg.eigh(doubt)
        for variance, axis in zip(variances, axes.T, strict=True):
            off = change(axis)
            doubtful += weight * variance * np.outer(off, off)
    return information, gradient, doubtful
