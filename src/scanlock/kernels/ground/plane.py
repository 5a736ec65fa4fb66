"""Dominant plane of low points, by sample consensus over quasi-random triples."""

import math

import numpy as np

from scanlock.arrays import Matrix, Points, Vector
from scanlock.kernels._compile import kernel, sum_kernel

_SWEEPS = 12
"""Jacobi sweeps, far more than enough to make a 3x3 matrix diagonal."""


@kernel
def weighted_columns(
    points: Points, near: float, threshold: float, threshold_slope: float
) -> Matrix:
    """Return the (5, n) rows x, y, z, weight and inverse threshold of (n, 3) low points [m].

    Weights are inversely proportional to the range plus `near` [m] and sum to one. The threshold
    of a residual is `threshold` [m] plus `threshold_slope` times the range.
    """
    n = points.shape[0]
    columns = np.empty((5, n), np.float64)
    total = 0.0
    for i in range(n):
        x = points[i, 0]
        y = points[i, 1]
        distance = math.sqrt(x * x + y * y)
        columns[0, i] = x
        columns[1, i] = y
        columns[2, i] = points[i, 2]
        columns[3, i] = 1.0 / (near + distance)
        columns[4, i] = 1.0 / (threshold + threshold_slope * distance)
        total += columns[3, i]
    for i in range(n):
        columns[3, i] /= total
    return columns


@sum_kernel
def plane_score(
    x: Vector, y: Vector, z: Vector, weights: Vector, inverse_thresholds: Vector,
    nx: float, ny: float, nz: float, d: float,
) -> float:  # fmt: skip
    """Return the score of the plane ``n . p + d = 0`` as the ground of low points.

    With the residual h of a point in thresholds, the point adds ``1 - h^2`` of its weight if it
    is within its threshold. It subtracts half its weight if it is more than two thresholds below,
    because there is little beneath the ground.
    """
    score = 0.0
    for i in range(x.shape[0]):
        h = (nx * x[i] + ny * y[i] + nz * z[i] + d) * inverse_thresholds[i]
        beneath = -0.5 if h < -2.0 else 0.0
        score += weights[i] * max(1.0 - h * h, beneath)
    return score


@kernel
def best_sampled_plane(
    x: Vector,
    y: Vector,
    z: Vector,
    weights: Vector,
    inverse_thresholds: Vector,
    triples: int,
    min_cosine: float,
) -> tuple[float, float, float, float, float]:
    """Return (nx, ny, nz, d, score) of the best of `triples` planes through three points.

    The triples follow a three-dimensional low-discrepancy sequence, so the result is
    reproducible. Only upward normals with ``nz >= min_cosine`` are tried. A score of 0 means that
    no plane has a positive score.
    """
    n = x.shape[0]
    half = n // 2
    rest = weights[half:].sum()
    best = (0.0, 0.0, 1.0, 0.0, 0.0)
    # Steps of the R3 sequence: powers of the root of x**4 = x + 1.
    g = 1.2207440846057596
    for t in range(1, triples + 1):
        i = int(n * ((0.5 + t / g) % 1.0))
        j = int(n * ((0.5 + t / (g * g)) % 1.0))
        k = int(n * ((0.5 + t / (g * g * g)) % 1.0))
        ax = x[j] - x[i]
        ay = y[j] - y[i]
        az = z[j] - z[i]
        bx = x[k] - x[i]
        by = y[k] - y[i]
        bz = z[k] - z[i]
        nx = ay * bz - az * by
        ny = az * bx - ax * bz
        nz = ax * by - ay * bx
        norm = math.sqrt(nx * nx + ny * ny + nz * nz)
        if nz < 0.0:
            norm = -norm
        if norm == 0.0:
            continue
        nx /= norm
        ny /= norm
        nz /= norm
        if nz < min_cosine:
            continue
        d = -(nx * x[i] + ny * y[i] + nz * z[i])
        score = plane_score(
            x[:half], y[:half], z[:half], weights[:half], inverse_thresholds[:half], nx, ny, nz, d
        )
        # The second half adds at most its weights.
        if score + rest <= best[4]:
            continue
        score += plane_score(
            x[half:], y[half:], z[half:], weights[half:], inverse_thresholds[half:], nx, ny, nz, d
        )
        if score > best[4]:
            best = (nx, ny, nz, d, score)
    return best


@sum_kernel
def plane_moments(
    x: Vector, y: Vector, z: Vector, weights: Vector, inverse_thresholds: Vector, cutoff: float,
    nx: float, ny: float, nz: float, d: float,
) -> Vector:  # fmt: skip
    """Return weighted sums over the points within `cutoff` thresholds of a plane.

    (sum w, wx, wy, wz, wxx, wxy, wxz, wyy, wyz, wzz), where w is the weight of the point over its
    squared threshold, times the biweight of its residual on either side of the plane.
    """
    s0 = sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = 0.0
    for i in range(x.shape[0]):
        h = (nx * x[i] + ny * y[i] + nz * z[i] + d) * inverse_thresholds[i] / cutoff
        inside = max(1.0 - h * h, 0.0)
        w = weights[i] * inside * inside * inverse_thresholds[i] * inverse_thresholds[i]
        s0 += w
        sx += w * x[i]
        sy += w * y[i]
        sz += w * z[i]
        sxx += w * x[i] * x[i]
        sxy += w * x[i] * y[i]
        sxz += w * x[i] * z[i]
        syy += w * y[i] * y[i]
        syz += w * y[i] * z[i]
        szz += w * z[i] * z[i]
    return np.array([s0, sx, sy, sz, sxx, sxy, sxz, syy, syz, szz])


@kernel
def smallest_eigenvector(covariance: Matrix) -> tuple[float, float, float]:
    """Return the upward unit eigenvector of the smallest eigenvalue of a symmetric 3x3 matrix.

    Jacobi's method, which leaves `covariance` diagonal.
    """
    axes = np.eye(3)
    for _ in range(_SWEEPS):
        for p in range(2):
            for q in range(p + 1, 3):
                if abs(covariance[p, q]) <= 1e-17 * (abs(covariance[p, p]) + abs(covariance[q, q])):
                    continue
                cotangent = 0.5 * (covariance[q, q] - covariance[p, p]) / covariance[p, q]
                t = math.copysign(1.0, cotangent) / (
                    abs(cotangent) + math.sqrt(cotangent * cotangent + 1.0)
                )
                c = 1.0 / math.sqrt(t * t + 1.0)
                for k in range(3):
                    a = covariance[k, p]
                    b = covariance[k, q]
                    covariance[k, p] = c * (a - t * b)
                    covariance[k, q] = c * (b + t * a)
                for k in range(3):
                    a = covariance[p, k]
                    b = covariance[q, k]
                    covariance[p, k] = c * (a - t * b)
                    covariance[q, k] = c * (b + t * a)
                for k in range(3):
                    a = axes[k, p]
                    b = axes[k, q]
                    axes[k, p] = c * (a - t * b)
                    axes[k, q] = c * (b + t * a)
    k = 0
    for other in range(1, 3):
        if covariance[other, other] < covariance[k, k]:
            k = other
    sign = 1.0 if axes[2, k] >= 0.0 else -1.0
    return sign * axes[0, k], sign * axes[1, k], sign * axes[2, k]


@kernel
def refined_plane(
    x: Vector,
    y: Vector,
    z: Vector,
    weights: Vector,
    inverse_thresholds: Vector,
    cutoffs: Vector,
    nx: float,
    ny: float,
    nz: float,
    d: float,
) -> tuple[float, float, float, float, float]:
    """Return (nx, ny, nz, d, score) of a plane after one reweighted fit for each of `cutoffs`.

    `cutoffs` are in thresholds, see `plane_moments`. The score is -inf if no point is within one
    of them.
    """
    covariance = np.empty((3, 3), np.float64)
    for cutoff in cutoffs:
        sums = plane_moments(x, y, z, weights, inverse_thresholds, cutoff, nx, ny, nz, d)
        if sums[0] <= 0.0:
            return nx, ny, nz, d, -math.inf
        k = 4
        for p in range(3):
            for q in range(p, 3):
                mean_product = sums[1 + p] / sums[0] * (sums[1 + q] / sums[0])
                covariance[p, q] = covariance[q, p] = sums[k] / sums[0] - mean_product
                k += 1
        nx, ny, nz = smallest_eigenvector(covariance)
        d = -(nx * sums[1] + ny * sums[2] + nz * sums[3]) / sums[0]
    return nx, ny, nz, d, plane_score(x, y, z, weights, inverse_thresholds, nx, ny, nz, d)
