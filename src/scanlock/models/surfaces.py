"""The surface around each point of a scan: its normal, and a covariance that is flat along it.

Generalised ICP takes each point for a sample of a surface: where on the surface it lies is
uncertain, how far off it is not (Segal, Haehnel and Thrun 2009, section III.B).
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
"""What the neighbours of a point are taken for.

``"plane"`` gives every point the variances (thinness, 1, 1) about its normal, as in the paper,
whether its neighbours are flat or not. ``"ellipsoid"`` keeps the proportions of the neighbours'
own variances, largest 1 and none below the thinness: wires and foliage then are no planes.
"""

MIN_NEIGHBOURS = 4
"""Three points always lie in a plane, whatever the surface: the fourth tells."""

_PACKED_ROWS = [0, 0, 0, 1, 1, 2]
_PACKED_COLUMNS = [0, 1, 2, 1, 2, 2]


def require_surface(neighbours: int, shape: SurfaceShape, thinness: float) -> None:
    """Raise `InvalidInput` unless `surface_covariances` can take these settings."""
    require_count("neighbours", neighbours, MIN_NEIGHBOURS)
    if shape not in ("plane", "ellipsoid"):
        raise InvalidInput(f"shape must be 'plane' or 'ellipsoid', got {shape!r}")
    require_positive("thinness", thinness, unit="m^2")
    require_fraction("thinness", thinness)


@dataclass(frozen=True, slots=True, eq=False)
class Neighbourhoods:
    """How the points around each point of a cloud are spread. Build with `around`.

    Attributes
    ----------
    variances : (n, 3) [m^2]
        Of the neighbours along their principal axes, ascending.
    axes : (n, 3, 3)
        The axes by row, unit vectors of either sign.
    """

    variances: Matrix
    axes: NDArray[np.float64]

    def __post_init__(self) -> None:
        for array in (self.variances, self.axes):
            frozen(array)

    @classmethod
    def around(cls, points: Points | PointTree, neighbours: int = 10) -> "Neighbourhoods":
        """Return the spread about each point.

        Parameters
        ----------
        points : (n, 3) or PointTree [m]
            Of a tree, the rows are those of its own points.
        neighbours : int
            Nearest points that are looked at, the point itself included; all where there are
            fewer.

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
            places = np.argsort(tree.rows)
            variances, axes = variances[places], axes[places]
        return cls(variances, axes.reshape(-1, 3, 3))

    @property
    def widths(self) -> Vector:
        """The (n,) root mean square distance [m] of the neighbours from their mean."""
        return np.sqrt(np.maximum(self.variances.sum(axis=1), 0.0))

    def taken(self, rows: Labels) -> "Neighbourhoods":
        """Return the spread about the points of the given rows, in that order."""
        return Neighbourhoods(self.variances[rows], self.axes[rows])

    def covariances(self, shape: SurfaceShape = "plane", thinness: float = 1e-3) -> Matrix:
        """Return the (n, 6) covariances of the surface; see `surface_covariances`."""
        if shape == "plane":
            # Two axes of variance 1 are the identity less the third.
            across = self.axes[:, 0, _PACKED_ROWS] * self.axes[:, 0, _PACKED_COLUMNS]
            return np.eye(3)[_PACKED_ROWS, _PACKED_COLUMNS] - (1.0 - thinness) * across
        first, second = self.axes[:, :, _PACKED_ROWS], self.axes[:, :, _PACKED_COLUMNS]
        largest = self.variances[:, 2:]
        shares = np.divide(
            self.variances, largest, out=np.ones_like(self.variances), where=largest > 0.0
        )
        return np.einsum("na,nap,nap->np", np.maximum(shares, thinness), first, second)


def surface_covariances(
    points: Points | PointTree,
    neighbours: int = 10,
    *,
    shape: SurfaceShape = "plane",
    thinness: float = 1e-3,
) -> Matrix:
    """Return the (n, 6) covariances of the surface around each point [m^2].

    Packed upper triangles xx, xy, xz, yy, yz, zz, as the kernels read them;
    `scanlock.models.gaussians.unpacked` makes (n, 3, 3) matrices of them.

    Parameters
    ----------
    points : (n, 3) or PointTree [m]
        Thin them first: among the points of one scan line the surface is a line. Of a tree, the
        rows are those of its own points.
    neighbours : int
        Nearest points that are looked at, the point itself included; all where there are fewer.
    shape : str
        What the neighbours are taken for.
    thinness : float [m^2]
        Variance across the surface, where that along it is 1.

    Raises
    ------
    InvalidInput
        Fewer than 4 neighbours, an unknown shape, or a thinness outside (0, 1].

    Notes
    -----
    Segal, Haehnel and Thrun (2009) use the plane with a thinness of 1e-3 and 20 neighbours,
    small_gicp the same with 10.
    """
    require_surface(neighbours, shape, thinness)
    return Neighbourhoods.around(points, neighbours).covariances(shape, thinness)


def surface_normals(points: Points | PointTree, neighbours: int = 10) -> Points:
    """Return the (n, 3) unit normals of the surface around each point, towards the zero.

    Scans in their sensor's frame thus have normals that face the sensor. Where the neighbours
    lie on a line or in one place the direction is one of many, and the same in every run.

    Parameters
    ----------
    points, neighbours
        As for `surface_covariances`.

    Raises
    ------
    InvalidInput
        Fewer than 4 neighbours.
    """
    normals = Neighbourhoods.around(points, neighbours).axes[:, 0]
    places = points.points if isinstance(points, PointTree) else points
    away = np.einsum("na,na->n", normals, places) > 0.0
    return np.where(away[:, None], -normals, normals)
