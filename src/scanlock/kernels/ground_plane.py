"""The plane that most low points share, found from quasi-random triples."""

import math

import numpy as np

from scanlock.arrays import Vector
from scanlock.kernels._compile import kernel, sum_kernel


@sum_kernel
def plane_score(
    x: Vector, y: Vector, z: Vector, weights: Vector, sharpness: Vector,
    nx: float, ny: float, nz: float, d: float,
) -> float:  # fmt: skip
    """Return how well the plane ``n . p + d = 0`` serves as the ground of low points.

    `sharpness` is one over the gate of each point. A point within its gate counts up to its
    weight, less the farther off it is; one more than two gates below takes off half its weight,
    because ground has little beneath it.
    """
    score = 0.0
    for i in range(x.shape[0]):
        h = (nx * x[i] + ny * y[i] + nz * z[i] + d) * sharpness[i]
        beneath = -0.5 if h < -2.0 else 0.0
        score += weights[i] * max(1.0 - h * h, beneath)
    return score


@kernel
def best_triple_plane(
    x: Vector,
    y: Vector,
    z: Vector,
    weights: Vector,
    sharpness: Vector,
    triples: int,
    least_cosine: float,
) -> tuple[float, float, float, float, float]:
    """Return (nx, ny, nz, d, score) of the best of `triples` planes through three points.

    The triples follow a three-dimensional low-discrepancy sequence, so the result repeats.
    Only upward normals with ``nz >= least_cosine`` are tried. Score 0 means none was any good.
    """
    n = x.shape[0]
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
        if nz < least_cosine:
            continue
        d = -(nx * x[i] + ny * y[i] + nz * z[i])
        score = plane_score(x, y, z, weights, sharpness, nx, ny, nz, d)
        if score > best[4]:
            best = (nx, ny, nz, d, score)
    return best


@sum_kernel
def plane_moments(
    x: Vector, y: Vector, z: Vector, weights: Vector, sharpness: Vector, reach: float,
    nx: float, ny: float, nz: float, d: float,
) -> Vector:  # fmt: skip
    """Return weighted sums over the points within `reach` gates of a plane.

    (sum w, wx, wy, wz, wxx, wxy, wxz, wyy, wyz, wzz) with w the weight of the point, over its
    squared gate, times the biweight of its distance; points below the plane weigh as much as
    those above.
    """
    s0 = sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = 0.0
    for i in range(x.shape[0]):
        h = (nx * x[i] + ny * y[i] + nz * z[i] + d) * sharpness[i] / reach
        inside = max(1.0 - h * h, 0.0)
        w = weights[i] * inside * inside * sharpness[i] * sharpness[i]
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
