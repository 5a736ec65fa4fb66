"""Reference of `verification.plane_constraints`: one plane after the other, by definition."""

import numpy as np


def normal_equations(planes, origin):
    """Return the information, the gradient, and the bias of the information by noisy normals."""
    information, gradient, bias = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6))
    for point, normal, residual, covariance in zip(
        planes.points, planes.normals, planes.residuals, planes.normal_covariances, strict=True
    ):
        weight = 1.0 / (1.0 + (residual / 0.1) ** 2)

        def derivative(direction, point=point):
            """Derivative of the motion of the point along a vector with respect to a step."""
            return np.array([*direction, *np.cross(point - origin, direction)])

        row = derivative(normal)
        information += weight * np.outer(row, row)
        gradient += weight * residual * row
        # The covariance of a normal is a sum over independent errors along its principal axes.
        variances, axes = np.linalg.eigh(covariance)
        for variance, axis in zip(variances, axes.T, strict=True):
            error = derivative(axis)
            bias += weight * variance * np.outer(error, error)
    return information, gradient, bias
