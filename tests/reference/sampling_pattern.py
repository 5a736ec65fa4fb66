"""Reference of `uncertainty.sampling_pattern`: one cell after the other, by definition."""

import numpy as np


def motion_of(position):
    """Derivative (3, 6) of the motion of a point with respect to a step ``(rho, phi)``."""
    columns = [np.cross(axis, position) for axis in np.eye(3)]
    return np.hstack([np.eye(3), np.column_stack(columns)])


def hessian_along_surfaces(hessians, positions):
    """Sum of the Hessians of translations without their largest curvature, for a whole step."""
    total = np.zeros((6, 6))
    for hessian, position in zip(hessians, positions, strict=True):
        curvatures, axes = np.linalg.eigh(hessian[:3, :3])
        for curvature, axis in zip(curvatures[:2], axes.T[:2], strict=True):
            row = axis @ motion_of(position)
            total += max(curvature, 0.0) * np.outer(row, row)
    return total
