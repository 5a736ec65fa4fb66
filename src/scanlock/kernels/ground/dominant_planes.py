"""Planes through triples of points, scored as the ground with either side up."""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Vector
from scanlock.kernels._compile import kernel, sum_kernel


@sum_kernel
def plane_sides(
    x: Vector, y: Vector, z: Vector, weights: Vector, inverse_thresholds: Vector,
    nx: float, ny: float, nz: float, d: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Return the weighted sums of points on the plane ``n . p + d = 0``, below it and above it.

    With the residual h of a point in thresholds, the first sum is that of ``1 - h^2`` over the
    points within their thresholds. The others are those of the points more than two thresholds
    away.
    """
    on = below = above = 0.0
    for i in range(x.shape[0]):
        h = (nx * x[i] + ny * y[i] + nz * z[i] + d) * inverse_thresholds[i]
        on += weights[i] * max(1.0 - h * h, 0.0)
        below += weights[i] if h < -2.0 else 0.0
        above += weights[i] if h > 2.0 else 0.0
    return on, below, above


@kernel
def scored_triples(
    x: Vector,
    y: Vector,
    z: Vector,
    weights: Vector,
    inverse_thresholds: Vector,
    triples: Labels,
    scored: int,
) -> Matrix:
    """Return the (t, 5) planes (nx, ny, nz, d, score) through (t, 3) triples of points.

    The first `scored` points score a plane as `plane_score` does; of its two sides, the one of the
    higher score is up. The score is -inf for three points on a line.
    """
    planes = np.empty((triples.shape[0], 5), np.float64)
    for t in range(triples.shape[0]):
        i = int(triples[t, 0])
        j = int(triples[t, 1])
        k = int(triples[t, 2])
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
        if norm == 0.0:
            planes[t, :4] = 0.0
            planes[t, 4] = -math.inf
            continue
        nx /= norm
        ny /= norm
        nz /= norm
        d = -(nx * x[i] + ny * y[i] + nz * z[i])
        on, below, above = plane_sides(
            x[:scored], y[:scored], z[:scored], weights[:scored], inverse_thresholds[:scored],
            nx, ny, nz, d,
        )  # fmt: skip
        sign = 1.0 if below <= above else -1.0
        planes[t, 0] = sign * nx
        planes[t, 1] = sign * ny
        planes[t, 2] = sign * nz
        planes[t, 3] = sign * d
        planes[t, 4] = on - 0.5 * min(below, above)
    return planes
