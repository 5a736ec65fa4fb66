"""Variances of Gaussians raised to a floor along their own axes."""

import math

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix
from scanlock.kernels._compile import kernel

_SWEEPS = 12
"""Rounds of rotations at most; three to five clear a matrix to the last digit."""


@kernel
def _rotate(a: Matrix, axes: Matrix, p: int, q: int) -> None:
    """Turn a symmetric matrix and its axes so that entry (p, q) vanishes (Jacobi's rotation)."""
    apq = a[p, q]
    if apq == 0.0:
        return
    half = (a[q, q] - a[p, p]) / (2.0 * apq)
    # The smaller of the two turns; hypot cannot overflow where the entry is tiny.
    t = math.copysign(1.0, half) / (abs(half) + math.hypot(1.0, half))
    c = 1.0 / math.sqrt(1.0 + t * t)
    s = t * c
    r = 3 - p - q
    arp, arq = a[r, p], a[r, q]
    a[p, p] -= t * apq
    a[q, q] += t * apq
    a[p, q] = a[q, p] = 0.0
    a[r, p] = a[p, r] = c * arp - s * arq
    a[r, q] = a[q, r] = s * arp + c * arq
    for k in range(3):
        vp, vq = axes[k, p], axes[k, q]
        axes[k, p] = c * vp - s * vq
        axes[k, q] = s * vp + c * vq


@kernel
def floored_covariances(
    covariances: NDArray[np.float64], least: float, ratio: float
) -> tuple[NDArray[np.float64], Matrix]:
    """Return (k, 3, 3) covariances with no principal variance below a floor, and those variances.

    The floor is the larger of `least` and `ratio` times the largest variance of the same matrix.
    The (k, 3) variances ascend. Jacobi's method: for matrices this small it takes a tenth of the
    time of a call to LAPACK for each.
    """
    count = covariances.shape[0]
    raised = np.empty((count, 3, 3))
    variances = np.empty((count, 3))
    a = np.empty((3, 3))
    axes = np.empty((3, 3))
    for k in range(count):
        for i in range(3):
            for j in range(3):
                a[i, j] = covariances[k, i, j]
                axes[i, j] = 1.0 if i == j else 0.0
        for _ in range(_SWEEPS):
            _rotate(a, axes, 0, 1)
            _rotate(a, axes, 0, 2)
            _rotate(a, axes, 1, 2)
            size = abs(a[0, 0]) + abs(a[1, 1]) + abs(a[2, 2])
            if abs(a[0, 1]) + abs(a[0, 2]) + abs(a[1, 2]) <= 1e-17 * size:
                break
        floor = max(least, ratio * max(a[0, 0], a[1, 1], a[2, 2]))
        v0, v1, v2 = max(a[0, 0], floor), max(a[1, 1], floor), max(a[2, 2], floor)
        for i in range(3):
            for j in range(i, 3):
                value = v0 * axes[i, 0] * axes[j, 0] + v1 * axes[i, 1] * axes[j, 1]
                value += v2 * axes[i, 2] * axes[j, 2]
                raised[k, i, j] = raised[k, j, i] = value
        variances[k, 0] = min(v0, v1, v2)
        variances[k, 2] = max(v0, v1, v2)
        variances[k, 1] = max(min(v0, v1), min(max(v0, v1), v2))
    return raised, variances
