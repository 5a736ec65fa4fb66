"""P2D over the cells of a grid, point by point and cell by cell, from the definitions."""

import numpy as np

from reference.gaussian_scores import rho


def cells_of(places, corner, width):
    """The cell of each place."""
    return np.floor((places - corner) / width).astype(int)


def own_cell(place, cell, corner, width):
    """1 for the cell that holds the place, else 0 (Biber and Strasser 2003)."""
    return float((cells_of(place, corner, width) == cell).all())


def seven_cells(place, cell, corner, width):
    """1 for the cell of the place and those that share a face with it."""
    return float(np.abs(cells_of(place, corner, width) - cell).sum() <= 1)


def trilinear(place, cell, corner, width):
    """Along each axis 1 less the distance to the middle of the cell in widths, not below 0."""
    middle = corner + width * (cell + 0.5)
    return float(np.prod(np.maximum(0.0, 1.0 - np.abs(place - middle) / width)))


WEIGHTS = {"own-cell": own_cell, "seven-cells": seven_cells, "trilinear": trilinear}


def value(pose, voxels, points, meeting, *, height=1.0, **shape):
    """Minus the mean over the points of the weighted sum over all cells."""
    total = 0.0
    gaussians = voxels.gaussians
    for place in points @ pose.rotation.T + pose.translation:
        for mean, covariance, cell in zip(
            gaussians.means, gaussians.covariances, voxels.cells, strict=True
        ):
            gap = place - mean
            if meeting == "near-cells":
                weight = float(np.linalg.norm(gap) < voxels.width)
            else:
                weight = WEIGHTS[meeting](place, cell, voxels.corner, voxels.width)
            total -= weight * rho(gap @ np.linalg.inv(covariance) @ gap, **shape)
    return height * float(total) / len(points)


def convex_hessian(pose, voxels, points, meeting, **shape):
    """Mean over the points of ``-2 w rho'(s) J' B J``, with J the Jacobian of the step."""
    total = np.zeros((6, 6))
    gaussians = voxels.gaussians
    for place in points @ pose.rotation.T + pose.translation:
        x, y, z = place
        jacobian = np.hstack([np.eye(3), -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])])
        for mean, covariance, cell in zip(
            gaussians.means, gaussians.covariances, voxels.cells, strict=True
        ):
            precision = np.linalg.inv(covariance)
            s = (place - mean) @ precision @ (place - mean)
            slope = -(rho(s + 1e-6, **shape) - rho(s - 1e-6, **shape)) / 2e-6
            weight = WEIGHTS[meeting](place, cell, voxels.corner, voxels.width)
            total += 2.0 * weight * slope * jacobian.T @ precision @ jacobian
    return total / len(points)
