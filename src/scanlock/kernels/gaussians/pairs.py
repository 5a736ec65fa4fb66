"""Pairs of points with covariances: the cost of generalised ICP and its derivatives.

The cost of a pair of a target point ``mu`` and a source point, ``y`` in the target's frame, is half
its squared Mahalanobis distance, ``q' B q / 2`` with ``q = y - mu``. For the step ``(rho, phi)``
and ``b = B q`` the cost has::

    gradient  (b, y x b)
    Hessian   L' B L + blkdiag(0, (b y' + y b') / 2 - (b.y) I)
    with      L = [I, -hat(y)]
"""

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import sum_kernel
from scanlock.kernels._inline import (
    add_point_terms,
    dot,
    inverse,
    nine,
    product,
    put_symmetric,
    rotated,
    summed,
    symmetric,
    transformed,
    triple,
)


@sum_kernel
def pair_precisions(
    target_covariances: Matrix,
    source_covariances: Matrix,
    target_rows: Labels,
    source_rows: Labels,
    rotation: Matrix,
) -> Matrix:
    """Return the (m, 6) inverses [m^-2] of ``C_t + R C_s R'``, one for each pair of rows.

    All matrices are packed upper triangles xx, xy, xz, yy, yz, zz.
    """
    precisions = np.empty((target_rows.shape[0], 6))
    r = nine(rotation)
    for m in range(target_rows.shape[0]):
        # Unsigned, because Numba checks the sign of other indices.
        i, j = np.uint64(source_rows[m]), np.uint64(target_rows[m])
        source = rotated(r, symmetric(source_covariances, i))
        put_symmetric(precisions, m, inverse(summed(symmetric(target_covariances, j), source)))
    return precisions


@sum_kernel
def pair_terms(
    target_points: Points,
    source_points: Points,
    precisions: Matrix,
    target_rows: Labels,
    source_rows: Labels,
    rotation: Matrix,
    translation: Vector,
    exact: float,
) -> Vector:
    """Return the 28 sums of the cost over all pairs of rows, each with its precision (m, 6).

    The terms are the value, the gradient (6) and the upper triangle of the Hessian, row by row
    (21). With `exact` 0 instead of 1 the Hessian is its convex part ``L' B L``, the Gauss-Newton
    approximation.
    """
    terms = np.zeros(28)
    r = nine(rotation)
    for m in range(target_rows.shape[0]):
        i, j = np.uint64(source_rows[m]), np.uint64(target_rows[m])
        t = triple(translation)
        x0, x1, x2 = source_points[i, 0], source_points[i, 1], source_points[i, 2]
        y0, y1, y2 = transformed(r, t, x0, x1, x2)
        q = y0 - target_points[j, 0], y1 - target_points[j, 1], y2 - target_points[j, 2]
        k = symmetric(precisions, m)
        b = product(k, q)
        add_point_terms(terms, 0.5 * dot(b, q), (y0, y1, y2), b, k, exact)
    return terms
