"""NDT scores pair by pair: rho and Lambda of Das et al. 2013, sections VI and VII."""

import numpy as np


def window(s, start, end):
    """Window: 1 up to `start`, 0 from `end` on, and a quintic with flat ends in between."""
    v = np.clip((s - start) / (end - start), 0.0, 1.0)
    return 1.0 - (6.0 * v**5 - 15.0 * v**4 + 10.0 * v**3)


def rho(s, sharpness=1.0, start=16.0, end=25.0):
    """Likelihood of a pair at squared Mahalanobis distance s, times the window."""
    return np.exp(-0.5 * sharpness * s) * window(sharpness * s, start, end)


def d2d_squared(pose, target_means, target_covariances, source_means, source_covariances):
    """Squared Mahalanobis distances of all pairs (source, target)."""
    R = pose.rotation
    residuals = (source_means @ R.T + pose.translation)[:, None] - target_means[None]
    sums = (R @ source_covariances @ R.T)[:, None] + target_covariances[None]
    return np.einsum("ija,ijab,ijb->ij", residuals, np.linalg.inv(sums), residuals)


def d2d_value(pose, target, source, power=0.5, **shape):
    """Minus the weighted sum over all pairs; weights are powers of counts, of unit length."""
    s = d2d_squared(pose, target.means, target.covariances, source.means, source.covariances)
    weights = [side.counts**power / np.linalg.norm(side.counts**power) for side in (source, target)]
    return -float(weights[0] @ rho(s, **shape) @ weights[1])


def p2d_value(pose, target, points, **shape):
    """Minus the mean over the points of the sum over all Gaussians."""
    residuals = (points @ pose.rotation.T + pose.translation)[:, None] - target.means[None]
    s = np.einsum("ija,jab,ijb->ij", residuals, np.linalg.inv(target.covariances), residuals)
    return -float(rho(s, **shape).sum() / len(points))


def p2d_gauss_newton(pose, target, points):
    """Sum over all pairs of ``-2 rho'(s) J' B J``, with J the Jacobian of the step."""
    total = np.zeros((6, 6))
    for y in points @ pose.rotation.T + pose.translation:
        x0, x1, x2 = y
        cross_product = np.array([[0.0, -x2, x1], [x2, 0.0, -x0], [-x1, x0, 0.0]])
        jacobian = np.hstack([np.eye(3), -cross_product])
        for mean, covariance in zip(target.means, target.covariances, strict=True):
            precision = np.linalg.inv(covariance)
            s = (y - mean) @ precision @ (y - mean)
            step = 1e-6
            slope = -(rho(s + step) - rho(s - step)) / (2.0 * step)
            total += 2.0 * slope * jacobian.T @ precision @ jacobian
    return total


def own_cell_value(pose, target, points, width):
    """P2D of Biber: each point against the Gaussian whose mean lies in its cell, if any."""
    moved = points @ pose.rotation.T + pose.translation
    total = 0.0
    for point in moved:
        for mean, covariance in zip(target.means, target.covariances, strict=True):
            if (np.floor(mean / width) == np.floor(point / width)).all():
                residual = point - mean
                total -= rho(residual @ np.linalg.inv(covariance) @ residual)
    return float(total) / len(points)
