"""Low objects of a scan, which distinguish a place from look-alikes.

Walls, columns and floors repeat; cars, bins, pallets and bushes hardly do. An object that the other
scan measured too supports a pose. An object in the free space of the other scan contradicts it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector, frozen, read_only, short_repr
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.rotations import rotation_onto_z
from scanlock.kernels.verification.low_objects import (
    joined_voxels,
    low_voxels,
    near_obstacles,
    occupied_columns,
)
from scanlock.segmentation.cluster_gaussians import ClusterGaussians
from scanlock.segmentation.ground.finder import Ground, GroundStatus

_MIN_RANGE, _MAX_RANGE = 2.5, 30.0
"""Range of the points of low objects [m]. Nearer points may be of the vehicle or of the person that
carries the sensor; farther objects have few points."""

_MIN_HEIGHT = 0.35
"""Minimum height above the ground [m]."""

_VOXEL_SIZE = 0.3
"""Side of a voxel [m]."""

_LOW_LAYERS, _LAYERS = 5, 8
"""Layers of voxels of low objects, up to 1.85 m, and of all points used, up to 2.75 m. Objects
higher than 1.85 m are structure, which repeats in buildings and rows of trees."""

_MIN_POINTS = 2
"""Minimum number of points of a voxel."""

_MIN_VOXELS = 4
"""Minimum number of voxels of an object."""

_MIN_LENGTH, _MAX_LENGTH = 0.3, 7.0
"""Length of an object along an axis [m]. Longer ones are kerbs, hedges and walls."""

_CELL_SIZE = 0.2
"""Side of an occupied column and of its height bins [m]."""

_COLUMNS = 400
"""Columns along each side: 40 m on either side of the sensor, beyond the range of low objects."""

_DEPTH = 4.8
"""Depth of the first height bin below the ground at the sensor [m]; the last one is 8 m above."""

_GROUND_QUANTILE = 0.05
"""Without a ground, this quantile of z is taken for the ground."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class OccupiedColumns:
    """Obstacle points of a scan as vertical columns of occupied height bins.

    Attributes
    ----------
    columns : (s, s) uint64
        Column (i, j) begins ``i - s / 2`` and ``j - s / 2`` cells from the vertical axis through
        the sensor. Its bits are height bins from `base` on.
    rotation : (3, 3)
        Rotation of the scan into the level frame.
    base : float [m]
        Height of the first bin in the level frame.
    cell_size : float [m]
        Side of a column and of a height bin.
    """

    columns: NDArray[np.uint64]
    rotation: Matrix
    base: float
    cell_size: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.columns)
        frozen(self.rotation)

    def is_near(self, points: Points, reach: float) -> Mask:
        """Return whether an obstacle is within `reach` [m] of each (n, 3) point [m] of the scan.

        Obstacles count at the centres of their bins.
        """
        return near_obstacles(self.columns, self.rotation, self.base, self.cell_size, reach, points)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LowObjects:
    """Low objects of a scan, and its occupied columns, which hit those of another scan.

    Attributes
    ----------
    voxels : (k, 3) [m]
        Voxels of all low_objects: means of their points, in the frame of the scan.
    object_of_voxel : (k,)
        Object of each voxel, ascending.
    occupied : OccupiedColumns
        Obstacles of the scan.
    """

    voxels: Points
    object_of_voxel: Labels
    occupied: OccupiedColumns

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.voxels)
        frozen(self.object_of_voxel)

    @property
    def count(self) -> int:
        """Number of objects."""
        return int(self.object_of_voxel[-1]) + 1 if len(self.object_of_voxel) else 0

    def counts(self, selected: Mask) -> Matrix:
        """Return the number of selected voxels of each object.

        `selected` (r k,) has r sets of all voxels one after the other; the result is (r, count).
        """
        sets = selected.reshape(-1, len(self.voxels))
        cells = self.object_of_voxel + self.count * np.arange(len(sets))[:, None]
        counts = np.bincount(cells[sets], minlength=self.count * len(sets))
        return counts.reshape(len(sets), self.count).astype(np.float64)


def find_low_objects(clusters: ClusterGaussians) -> LowObjects:
    """Find the low objects of a segmented scan."""
    cloud, ground = clusters.cloud, clusters.ground
    rotation, heights, ground_height = _level(cloud, ground)
    cells, voxels = low_voxels(
        cloud.points,
        heights,
        rotation,
        _MIN_RANGE,
        _MAX_RANGE,
        _MIN_HEIGHT,
        _VOXEL_SIZE,
        _LOW_LAYERS,
        _LAYERS,
        _MIN_POINTS,
    )
    voxels, object_of_voxel = _compact(voxels, *joined_voxels(read_only(cells)))
    base = ground_height - _DEPTH
    columns = occupied_columns(clusters.obstacles, rotation, base, _CELL_SIZE, _COLUMNS)
    return LowObjects(
        voxels=voxels,
        object_of_voxel=object_of_voxel,
        occupied=OccupiedColumns(
            columns=columns, rotation=rotation, base=base, cell_size=_CELL_SIZE
        ),
    )


def _level(cloud: PointCloud, ground: Ground) -> tuple[Matrix, Vector, float]:
    """Return the rotation into the level frame, heights above the ground, and its own height."""
    if ground.status is not GroundStatus.NONE:
        return read_only(rotation_onto_z(ground.up)), ground.height, -float(ground.plane[3])
    z = cloud.points[:, 2]
    low = float(np.quantile(z, _GROUND_QUANTILE))
    return read_only(np.eye(3)), read_only(z - low), low


def _compact(voxels: Points, labels: Labels, count: int) -> tuple[Points, Labels]:
    """Return the voxels of components of the size of objects, and their labels."""
    order = np.argsort(labels, kind="stable")
    voxels, labels = voxels[order], labels[order]
    starts = np.searchsorted(labels, np.arange(count))
    if count == 0:
        return voxels, labels
    lengths = (np.maximum.reduceat(voxels, starts) - np.minimum.reduceat(voxels, starts)).max(
        axis=1
    )
    sizes = np.diff(np.append(starts, len(labels)))
    is_object = (sizes >= _MIN_VOXELS) & (lengths >= _MIN_LENGTH) & (lengths <= _MAX_LENGTH)
    selected = is_object[labels]
    new_labels = np.cumsum(is_object) - 1
    return voxels[selected], new_labels[labels[selected]]
