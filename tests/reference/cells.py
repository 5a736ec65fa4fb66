"""P2D scores of the cells of a grid by their definition, point by point and cell by cell."""

import numpy as np

from reference.gaussian_scores import rho


def cells_of(points, corner, size):
    """Cell of each point."""
    return np.floor((points - corner) / size).astype(int)


def own_cell(point, cell, corner, size):
    """1 for the cell that contains the point, else 0 (Biber and Strasser 2003)."""
    return float((cells_of(point, corner, size) == cell).all())


def seven_cells(point, cell, corner, size):
    """1 for the cell of the point and the cells that share a face with it."""
    return float(np.abs(cells_of(point, corner, size) - cell).sum() <= 1)


def trilinear(point, cell, corner, size):
    """Product over axes of 1 less the distance to the centre of the cell in cells, at least 0."""
    centre = corner + size * (cell + 0.5)
    return float(np.prod(np.maximum(0.0, 1.0 - np.abs(point - centre) / size)))


WEIGHTS = {"own-cell": own_cell, "seven-cells": seven_cells, "trilinear": trilinear}


def value(pose, voxels, points, association, *, height=1.0, **shape):
    """Negative mean over the points of the weighted sum over all cells."""
    total = 0.0
    gaussians = voxels.gaussians
    for point in points @ pose.rotation.T + pose.translation:
        for mean, covariance, cell in zip(
            gaussians.means, gaussians.covariances, voxels.cells, strict=True
        ):
            offset = point - mean
            if association == "near-cells":
                weight = float(np.linalg.norm(offset) < voxels.size)
            else:
                weight = WEIGHTS[association](point, cell, voxels.corner, voxels.size)
            total -= weight * rho(offset @ np.linalg.inv(covariance) @ offset, **shape)
    return height * float(total) / len(points)


def convex_hessian(pose, voxels, points, association, **shape):
    """Mean over the points of ``-2 w rho'(s) J' B J``, with J the Jacobian of the step."""
    total = np.zeros((6, 6))
    gaussians = voxels.gaussians
    for point in points @ pose.rotation.T + pose.translation:
        x, y, z = point
        jacobian = np.hstack([np.eye(3), -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])])
        for mean, covariance, cell in zip(
            gaussians.means, gaussians.covariances, voxels.cells, strict=True
        ):
            precision = np.linalg.inv(covariance)
            s = (point - mean) @ precision @ (point - mean)
            slope = -(rho(s + 1e-6, **shape) - rho(s - 1e-6, **shape)) / 2e-6
            weight = WEIGHTS[association](point, cell, voxels.corner, voxels.size)
            total += 2.0 * weight * slope * jacobian.T @ precision @ jacobian
    return total / len(points)
