"""Cost of generalised ICP pair by pair: Segal, Haehnel and Thrun 2009, equation 2."""

import numpy as np


def hat(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def precision(target_covariance, source_covariance, rotation):
    """Inverse of the covariance of ``b - T a`` for a pose T with this rotation."""
    return np.linalg.inv(target_covariance + rotation @ source_covariance @ rotation.T)


def value(pose, fixed_at, pairs):
    """Mean of half the squared distance of ``(mu, C_t, x, C_s)``, with fixed precisions."""
    total = 0.0
    for mu, target_covariance, x, source_covariance in pairs:
        d = pose.rotation @ x + pose.translation - mu
        total += 0.5 * d @ precision(target_covariance, source_covariance, fixed_at.rotation) @ d
    return total / len(pairs)


def gauss_newton(pose, fixed_at, pairs):
    """Mean of ``J' B J`` with the Jacobian ``[I, -hat(y)]`` of a left step."""
    total = np.zeros((6, 6))
    for _, target_covariance, x, source_covariance in pairs:
        jacobian = np.hstack([np.eye(3), -hat(pose.rotation @ x + pose.translation)])
        B = precision(target_covariance, source_covariance, fixed_at.rotation)
        total += jacobian.T @ B @ jacobian
    return total / len(pairs)


def voxels(points, covariances, width):
    """Mean and mean covariance of the points in each voxel, by its cell index."""
    members = {}
    for point, covariance in zip(points, covariances, strict=True):
        members.setdefault(tuple(np.floor(point / width)), []).append((point, covariance))
    return {
        cell: tuple(np.mean(column, axis=0) for column in zip(*inside, strict=True))
        for cell, inside in members.items()
    }
