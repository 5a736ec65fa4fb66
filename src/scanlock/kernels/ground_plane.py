"""The plane that most low points share, found from quasi-random triples."""

import math

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def plane_score(
    points: Points,
    weights: Vector,
    gates: Vector,
    stride: int,
    nx: float,
    ny: float,
    nz: float,
    d: float,
) -> float:
    """Return how well the plane ``n . p + d = 0`` serves as the ground of low points.

    A point within its gate counts up to its weight, less the farther off it is; one more than
    two gates below takes off half its weight, because ground has little beneath it.
    """
    score = 0.0
    for i in range(0, points.shape[0], stride):
        h = (nx * points[i, 0] + ny * points[i, 1] + nz * points[i, 2] + d) / gates[i]
        if h * h < 1.0:
            score += weights[i] * (1.0 - h * h)
        elif h < -2.0:
            score -= 0.5 * weights[i]
    return score


@kernel
def best_triple_plane(
    points: Points,
    weights: Vector,
    gates: Vector,
    triples: int,
    stride: int,
    least_cosine: float,
) -> tuple[float, float, float, float, float]:
    """Return (nx, ny, nz, d, score) of the best of `triples` planes through three points.

    The triples follow a three-dimensional low-discrepancy sequence, so the result repeats.
    Only upward normals with ``nz >= least_cosine`` are tried. Score 0 means none was any good.
    """
    n = points.shape[0]
    best = (0.0, 0.0, 1.0, 0.0, 0.0)
    # Steps of the R3 sequence: powers of the root of x**4 = x + 1.
    g = 1.2207440846057596
    for t in range(1, triples + 1):
        i = int(n * ((0.5 + t / g) % 1.0))
        j = int(n * ((0.5 + t / (g * g)) % 1.0))
        k = int(n * ((0.5 + t / (g * g * g)) % 1.0))
        ax = points[j, 0] - points[i, 0]
        ay = points[j, 1] - points[i, 1]
        az = points[j, 2] - points[i, 2]
        bx = points[k, 0] - points[i, 0]
        by = points[k, 1] - points[i, 1]
        bz = points[k, 2] - points[i, 2]
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
        d = -(nx * points[i, 0] + ny * points[i, 1] + nz * points[i, 2])
        score = plane_score(points, weights, gates, stride, nx, ny, nz, d)
        if score > best[4]:
            best = (nx, ny, nz, d, score)
    return best


@kernel
def plane_moments(
    points: Points,
    weights: Vector,
    gates: Vector,
    reach: float,
    nx: float,
    ny: float,
    nz: float,
    d: float,
) -> Vector:
    """Return weighted sums over the points within `reach` gates of a plane.

    (sum w, wx, wy, wz, wxx, wxy, wxz, wyy, wyz, wzz) with w the weight of the point times
    the biweight of its distance; points below the plane weigh as much as those above.
    """
    sums = np.zeros(10, np.float64)
    for i in range(points.shape[0]):
        x = points[i, 0]
        y = points[i, 1]
        z = points[i, 2]
        h = (nx * x + ny * y + nz * z + d) / (reach * gates[i])
        if h * h >= 1.0:
            continue
        w = weights[i] * (1.0 - h * h) * (1.0 - h * h) / (gates[i] * gates[i])
        sums[0] += w
        sums[1] += w * x
        sums[2] += w * y
        sums[3] += w * z
        sums[4] += w * x * x
        sums[5] += w * x * y
        sums[6] += w * x * z
        sums[7] += w * y * y
        sums[8] += w * y * z
        sums[9] += w * z * z
    return sums
