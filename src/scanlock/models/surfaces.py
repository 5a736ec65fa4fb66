"""Local surface estimation: normals and surface covariances from nearest neighbours.

Generalised ICP models each point as a sample of a surface: its position along the surface is
uncertain, its distance from the surface is not (Segal, Haehnel and Thrun 2009, section III.B).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector, frozen, read_only
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput, require_count, require_fraction, require_positive
from scanlock.kernels.gaussians.eigen3 import principal_axes

SurfaceShape = Literal["plane", "ellipsoid"]
"""Shape of a surface covariance.

``"plane"``: variances (epsilon, 1, 1), the smallest along the normal, as in the paper.
``"ellipsoid"``: the variances of the neighbours, scaled to a largest of 1 and with the minimum
epsilon, so that wires and foliage are not modelled as planes.
"""

MIN_NEIGHBOURS = 4
"""Minimum number of neighbours: three points are always coplanar."""

_PACKED_ROWS = [0, 0, 0, 1, 1, 2]
_PACKED_COLUMNS = [0, 1, 2, 1, 2, 2]


def require_surface(neighbours: int, shape: SurfaceShape, covariance_epsilon: float) -> None:
    """Raise `InvalidInput` unless these settings are valid for `surface_covariances`."""
    require_count("neighbours", neighbours, MIN_NEIGHBOURS)
    if shape not in ("plane", "ellipsoid"):
        raise InvalidInput(f"shape must be 'plane' or 'ellipsoid', got {shape!r}")
    require_positive("covariance_epsilon", covariance_epsilon, unit="m^2")
    require_fraction("covariance_epsilon", covariance_epsilon)


@dataclass(frozen=True, slots=True, eq=False)
class Neighbourhoods:
    """Principal axes and variances of the neighbours of points; build with `around`.

    Attributes
    ----------
    variances : (n, 3) [m^2]
        Variances of the neighbours along their principal axes, ascending.
    axes : (n, 3, 3)
        Principal axes by row, unit vectors of either sign.
    """

    variances: Matrix
    axes: NDArray[np.float64]

    def __post_init__(self) -> None:
        for array in (self.variances, self.axes):
            frozen(array)

    @classmethod
    def around(cls, points: Points | PointTree, neighbours: int = 10) -> "Neighbourhoods":
        """Compute the neighbourhoods of all points of a cloud.

        Parameters
        ----------
        points : (n, 3) or PointTree [m]
            Points. The rows of the result follow the array, or the points of the tree.
        neighbours : int
            Number of nearest neighbours, the point itself included; all points of a smaller cloud.

        Raises
        ------
        InvalidInput
            Fewer than 4 neighbours.
        """
        require_count("neighbours", neighbours, MIN_NEIGHBOURS)
        tree = points if isinstance(points, PointTree) else PointTree.from_points(points)
        covariances = tree.neighbour_covariances(min(neighbours, len(tree)))
        variances, axes = principal_axes(read_only(covariances))
        if tree is not points:
            order = np.argsort(tree.rows)
            variances, axes = variances[order], axes[order]
        return cls(variances, axes.reshape(-1, 3, 3))

    @property
    def radii(self) -> Vector:
        """The (n,) root mean square distances [m] of the neighbours from their mean."""
        return np.sqrt(np.maximum(self.variances.sum(axis=1), 0.0))

    def taken(self, rows: Labels) -> "Neighbourhoods":
        """Return the neighbourhoods at the given rows, in that order."""
        return Neighbourhoods(self.variances[rows], self.axes[rows])

    def covariances(
        self, shape: SurfaceShape = "plane", covariance_epsilon: float = 1e-3
    ) -> Matrix:
        """Return the (n, 6) surface covariances [m^2]; see `surface_covariances`."""
        if shape == "plane":
            # The sum of the two tangential products is the identity less that of the normal.
            normal = self.axes[:, 0, _PACKED_ROWS] * self.axes[:, 0, _PACKED_COLUMNS]
            return np.eye(3)[_PACKED_ROWS, _PACKED_COLUMNS] - (1.0 - covariance_epsilon) * normal
        first, second = self.axes[:, :, _PACKED_ROWS], self.axes[:, :, _PACKED_COLUMNS]
        largest = self.variances[:, 2:]
        relative = np.divide(
            self.variances, largest, out=np.ones_like(self.variances), where=largest > 0.0
        )
        relative = np.maximum(relative, covariance_epsilon)
        return np.einsum("na,nap,nap->np", relative, first, second)


def surface_covariances(
    points: Points | PointTree,
    neighbours: int = 10,
    *,
    shape: SurfaceShape = "plane",
    covariance_epsilon: float = 1e-3,
) -> Matrix:
    """Estimate the covariances of the surface around points from their nearest neighbours.

    Parameters
    ----------
    points : (n, 3) or PointTree [m]
        Points. Downsample scans first: the neighbours within one scan line are collinear.
    neighbours : int
        Number of nearest neighbours, the point itself included; all points of a smaller cloud.
    shape : str
        ``"plane"`` or ``"ellipsoid"``, see `SurfaceShape`.
    covariance_epsilon : float [m^2]
        Variance along the normal; the largest variance along the surface is 1.

    Returns
    -------
    (n, 6) [m^2]
        Covariances, packed as xx, xy, xz, yy, yz, zz; `scanlock.models.gaussians.unpacked` gives
        (n, 3, 3) matrices. The rows follow the array, or the points of the tree.

    Raises
    ------
    InvalidInput
        Fewer than 4 neighbours, an unknown shape, or an epsilon outside (0, 1].

    Notes
    -----
    Segal, Haehnel and Thrun (2009) use the plane with an epsilon of 1e-3 and 20 neighbours,
    small_gicp the same with 10 neighbours.
    """
    require_surface(neighbours, shape, covariance_epsilon)
    return Neighbourhoods.around(points, neighbours).covariances(shape, covariance_epsilon)


def surface_normals(points: Points | PointTree, neighbours: int = 10) -> Points:
    """Estimate the (n, 3) unit normals of the surface around points, oriented towards the origin.

    Normals of a scan in the sensor frame thus face the sensor. Where the neighbours are collinear
    or identical the normal is not unique; the choice is deterministic.

    Parameters
    ----------
    points : (n, 3) or PointTree [m]
        Points, as for `surface_covariances`.
    neighbours : int
        Number of nearest neighbours, as for `surface_covariances`.

    Returns
    -------
    (n, 3)

    Raises
    ------
    InvalidInput
        Fewer than 4 neighbours.
    """
    normals = Neighbourhoods.around(points, neighbours).axes[:, 0]
    positions = points.points if isinstance(points, PointTree) else points
    faces_away = np.einsum("na,na->n", normals, positions) > 0.0
    return np.where(faces_away[:, None], -normals, normals)
