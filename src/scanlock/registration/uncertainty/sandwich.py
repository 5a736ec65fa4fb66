"""The scatter of gradients as the covariance of a minimum, with each unit left out in turn."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Matrix, Vector

_MOST_LEVERAGE = 0.9
"""No unit counts as holding more than this share of a direction: what the others say of it is
then known ten times as badly."""


@dataclass(frozen=True, slots=True, eq=False)
class BlockTerms:
    """What pieces of a scene add to an objective at its minimum.

    Attributes
    ----------
    gradients : (k, p)
    hessians : (k, p, p)
    grids : tuple of (k,)
        The unit that each piece belongs to, from 0 on, none of them empty; in one or more ways,
        over which the covariance is a mean.
    """

    gradients: Matrix
    hessians: Matrix
    grids: tuple[Labels, ...]


def sandwich(shares: BlockTerms, root: Matrix) -> tuple[Matrix, float]:
    """Return the (p, p) whitened covariance of the minimum, and the effective number of units.

    Parameters
    ----------
    shares : Shares
    root : (p, p)
        Whitens the Hessian H of the whole: ``root' H root = I``; ``root C root'`` is then the
        covariance in the units of a step.

    Notes
    -----
    With few units the scatter itself is unsure, and the mean of Hotelling's statistic is above
    the number of directions: by a share of (p + 1) over the number of units, to first order.
    """
    size = len(root)
    covariance, effective = np.zeros((size, size)), 0.0
    for labels in shares.grids:
        gradients = _summed(shares.gradients, labels) @ root
        hessians = root.T @ _summed(shares.hessians, labels) @ root
        weights = np.trace(hessians, axis1=1, axis2=2) / size
        units = 1.0 / float(weights @ weights)
        inflated = 1.0 + (size + 1.0) / units
        covariance += inflated / len(shares.grids) * jackknife(steps_without(gradients, hessians))
        effective += units / len(shares.grids)
    return covariance, effective


def steps_without(gradients: Matrix, hessians: Matrix) -> Matrix:
    """Return the (u, p) Newton steps that lead to the minimum without each of the units.

    Parameters
    ----------
    gradients : (u, p)
    hessians : (u, p, p)
        Of each unit, whitened: those of all units, and of a prior, add up to the identity.
    """
    heavy = np.flatnonzero(np.linalg.norm(hessians, axis=(1, 2)) > _MOST_LEVERAGE)
    if len(heavy):
        leverages, axes = np.linalg.eigh(hessians[heavy])
        capped = np.minimum(leverages, _MOST_LEVERAGE)
        hessians = hessians.copy()
        hessians[heavy] = (axes * capped[:, None, :]) @ axes.transpose(0, 2, 1)
    left = np.eye(hessians.shape[1]) - hessians
    return np.linalg.solve(left, gradients[:, :, None])[:, :, 0].astype(np.float64, copy=False)


def jackknife(steps: Matrix) -> Matrix:
    """Return the covariance of an estimate that moves by (u, p) steps with one unit left out."""
    centred = steps - steps.mean(axis=0)
    return (len(steps) - 1.0) / len(steps) * (centred.T @ centred)


def tilted(covariance: Matrix, rows: Labels, times: float) -> Matrix:
    """Return a (p, p) covariance with errors along some of its rows so many times as large.

    What hangs on them moves along: errors are those foretold by these rows, which grow, and the
    rest, which stays. So it is the same whichever point of the scene the translation is told of.
    """
    shared = covariance[:, rows]
    foretold = shared @ np.linalg.solve(covariance[np.ix_(rows, rows)], shared.T)
    return covariance + (times**2 - 1.0) * foretold


def root_of(hessian: Matrix, scale: Vector) -> Matrix | None:
    """Return the matrix that whitens a Hessian; None where it holds no minimum.

    Parameters
    ----------
    hessian : (p, p)
    scale : (p,)
        Makes its directions comparable: 1 for translations, a length [m] for rotations.
    """
    curvatures, axes = np.linalg.eigh(hessian / np.outer(scale, scale))
    if not curvatures[0] > _LEAST_RATIO * curvatures[-1]:
        return None
    return axes / np.sqrt(curvatures) / scale[:, None]


def _summed(values: Matrix, labels: Labels) -> Matrix:
    order = np.argsort(labels, kind="stable")
    firsts = np.flatnonzero(np.diff(labels[order], prepend=-1))
    return np.add.reduceat(values[order], firsts, axis=0)


_LEAST_RATIO = 1e-10
"""Curvatures below this share of the largest are rounding."""
