"""Planes fitted to the nearest points of a cloud around any positions, near points weighted more.

In sparse clouds the points of a plane lie far apart, and the surface bends between them. A plane
through equally weighted neighbours is that of their mean position; with weights that fall with the
distance it is that of the position itself.
"""

from dataclasses import dataclass, fields

import numpy as np

from scanlock.arrays import Mask, Matrix, Points, Vector, frozen, read_only, short_repr
from scanlock.clouds.point_tree import PointTree
from scanlock.kernels.gaussians.eigen3 import principal_axes

_ROWS, _COLUMNS = np.triu_indices(3)

_MIN_WEIGHT = 1e-6
"""Minimum weight of a neighbour, so that equally distant ones do not all have none."""

_MIN_MIDDLE_RATIO = 0.05
"""Minimum ratio of the middle to the largest variance; less is a line."""

_MAX_SQUARED_OFFSET = 4.0
"""Maximum squared distance along the plane from the mean of its points to the position, in their
variances. Beyond two standard deviations a plane is extrapolated, at the border of a cloud."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class WeightedPlanes:
    """Planes around n positions.

    Attributes
    ----------
    means : (n, 3) [m]
        Weighted means of the neighbours.
    normals : (n, 3)
        Unit normals of either sign.
    variances : (n,) [m^2]
        Variances of the neighbours across the planes.
    is_plane : (n,)
        Whether the neighbours are near and not on a line, and the position is among them.
    """

    means: Points
    normals: Points
    variances: Vector
    is_plane: Mask

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for one in fields(self):
            frozen(getattr(self, one.name))

    @classmethod
    def around(
        cls, positions: Points, tree: PointTree, neighbours: int, max_distance: float
    ) -> "WeightedPlanes":
        """Fit a plane to the nearest points around each position.

        The weights are ``(1 - d^2 / max d^2)^2`` of the distance d.

        Parameters
        ----------
        positions : (n, 3) [m]
        tree : PointTree
            The cloud.
        neighbours : int
            Number of nearest points; the farthest has no weight.
        max_distance : float [m]
            Maximum distance of the farthest one.
        """
        rows = tree.neighbours_of(positions, min(neighbours, len(tree)))
        offsets = tree.points[rows] - positions[:, None]
        squared = np.einsum("nka,nka->nk", offsets, offsets)
        farthest = squared.max(axis=1)
        relative = squared / np.maximum(farthest, np.finfo(np.float64).tiny)[:, None]
        weights = (1.0 - relative) ** 2 + _MIN_WEIGHT
        weights /= weights.sum(axis=1, keepdims=True)
        means = np.einsum("nk,nka->na", weights, offsets)
        variances, axes = _principal(offsets, weights, means)
        along = np.einsum("nba,na->nb", axes[:, 1:], means) ** 2
        lowest = np.maximum(variances[:, 1:], np.finfo(np.float64).tiny)
        return cls(
            means=positions + means,
            normals=np.ascontiguousarray(axes[:, 0]),
            variances=_unbiased(variances[:, 0], weights),
            is_plane=(farthest <= max_distance**2)
            & (variances[:, 1] > _MIN_MIDDLE_RATIO * variances[:, 2])
            & ((along / lowest).sum(axis=1) <= _MAX_SQUARED_OFFSET),
        )


def _principal(offsets: Matrix, weights: Matrix, means: Points) -> tuple[Matrix, Matrix]:
    """Return ascending variances (n, 3) and axes (n, 3, 3) of weighted (n, k, 3) offsets."""
    products = offsets[:, :, _ROWS] * offsets[:, :, _COLUMNS]
    packed = np.einsum("nk,nkp->np", weights, products) - means[:, _ROWS] * means[:, _COLUMNS]
    variances, axes = principal_axes(read_only(packed))
    return np.maximum(variances, 0.0), axes.reshape(-1, 3, 3)


def _unbiased(variances: Vector, weights: Matrix) -> Vector:
    """Return variances across planes of three parameters, by the effective number of points."""
    counts = 1.0 / np.square(weights).sum(axis=1)
    return variances * counts / np.maximum(counts - 3.0, 1.0)
