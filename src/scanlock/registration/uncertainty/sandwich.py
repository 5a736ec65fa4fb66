"""Sandwich covariance of a minimum, by a jackknife that leaves out one block at a time."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Matrix, Vector

_MAX_LEVERAGE = 0.9
"""Maximum fraction of the Hessian along a direction that one block may contribute. Without such a
block the direction is known ten times worse."""

_MIN_CURVATURE_RATIO = 1e-10
"""Minimum ratio of the smallest to the largest curvature of a minimum; less is rounding."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class BlockTerms:
    """Contributions of k cells of a scene to the derivatives of an objective at its minimum.

    Attributes
    ----------
    gradients : (k, p)
        Contributions to the gradient.
    hessians : (k, p, p)
        Contributions to the Hessian.
    grids : tuple of (k,)
        Block of each cell, from 0 without gaps, for one or more grids of blocks. The covariance
        is the mean over the grids.
    """

    gradients: Matrix
    hessians: Matrix
    grids: tuple[Labels, ...]


def sandwich_covariance(terms: BlockTerms, whitening: Matrix) -> tuple[Matrix, float]:
    """Return the whitened (p, p) covariance of the minimum, and the effective number of blocks.

    Parameters
    ----------
    terms : BlockTerms
    whitening : (p, p)
        Whitening matrix W of the total Hessian H, ``W' H W = I``. With the result C,
        ``W C W'`` is the covariance of a step.

    Notes
    -----
    With few blocks the scatter itself is uncertain: to first order, the mean of Hotelling's
    statistic exceeds the number of directions by a fraction of (p + 1) over the number of blocks.
    """
    size = len(whitening)
    covariance, effective_blocks = np.zeros((size, size)), 0.0
    for labels in terms.grids:
        gradients = _sums_by_label(terms.gradients, labels) @ whitening
        hessians = whitening.T @ _sums_by_label(terms.hessians, labels) @ whitening
        weights = np.trace(hessians, axis1=1, axis2=2) / size
        blocks = 1.0 / float(weights @ weights)
        inflation = 1.0 + (size + 1.0) / blocks
        steps = leave_one_out_steps(gradients, hessians)
        covariance += inflation / len(terms.grids) * jackknife_covariance(steps)
        effective_blocks += blocks / len(terms.grids)
    return covariance, effective_blocks


def leave_one_out_steps(gradients: Matrix, hessians: Matrix) -> Matrix:
    """Return the (b, p) Newton steps to the minimum without each of b blocks.

    Parameters
    ----------
    gradients : (b, p)
        Whitened gradient of each block.
    hessians : (b, p, p)
        Whitened Hessian of each block; those of all blocks and of a prior sum to the identity.
    """
    dominant = np.flatnonzero(np.linalg.norm(hessians, axis=(1, 2)) > _MAX_LEVERAGE)
    if len(dominant):
        leverages, axes = np.linalg.eigh(hessians[dominant])
        leverages = np.minimum(leverages, _MAX_LEVERAGE)
        hessians = hessians.copy()
        hessians[dominant] = (axes * leverages[:, None, :]) @ axes.transpose(0, 2, 1)
    remaining = np.eye(hessians.shape[1]) - hessians
    return np.linalg.solve(remaining, gradients[:, :, None])[:, :, 0].astype(np.float64, copy=False)


def jackknife_covariance(steps: Matrix) -> Matrix:
    """Return the covariance of an estimate from its (b, p) leave-one-out steps."""
    centred = steps - steps.mean(axis=0)
    return (len(steps) - 1.0) / len(steps) * (centred.T @ centred)


def inflated(covariance: Matrix, rows: Labels, factor: float) -> Matrix:
    """Return a (p, p) covariance with the standard deviations of some rows inflated.

    Errors of the other rows that are predicted by these rows grow with them; the rest of their
    errors stays. The result is therefore the same for any reference point of the translation.
    """
    cross = covariance[:, rows]
    # The pseudo-inverse, since identical scans have no scatter at all.
    predicted = cross @ np.linalg.pinv(covariance[np.ix_(rows, rows)], hermitian=True) @ cross.T
    return covariance + (factor**2 - 1.0) * predicted


def whitening_matrix(hessian: Matrix, scales: Vector) -> Matrix | None:
    """Return the whitening matrix of a Hessian; None if it is not positive definite.

    Parameters
    ----------
    hessian : (p, p)
    scales : (p,)
        Scales of the directions, which make their curvatures comparable: 1 for translations, a
        length [m] for rotations.
    """
    curvatures, axes = np.linalg.eigh(hessian / np.outer(scales, scales))
    if not curvatures[0] > _MIN_CURVATURE_RATIO * curvatures[-1]:
        return None
    return axes / np.sqrt(curvatures) / scales[:, None]


def _sums_by_label(values: Matrix, labels: Labels) -> Matrix:
    """Return the sums of the rows of each label."""
    order = np.argsort(labels, kind="stable")
    firsts = np.flatnonzero(np.diff(labels[order], prepend=-1))
    return np.add.reduceat(values[order], firsts, axis=0)
