"""BEV grid: a levelled scan as occupied and free cells seen from above."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Matrix, Vector, frozen, read_only, short_repr
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import rotation_onto_z
from scanlock.kernels.search.bev_grid import cells_and_ground, occupied_height_bins
from scanlock.segmentation.ground.finder import Ground, GroundStatus
from scanlock.segmentation.segmentation import is_obstacle

_GROUND_QUANTILE = 0.02
"""Without a ground, this quantile of z is taken for the ground; points below it are outliers."""

_MAX_HEIGHT_BINS = 62
"""The height bins of a cell are the bits of one int64."""

_CELLS_PER_GROUND_CELL = 4
"""Cells along each side of a ground cell, over which the ground height is averaged."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class BevGrid:
    """The bird's-eye view of a scan, about the z axis of its levelled frame.

    Attributes
    ----------
    level_from_scan : Pose
        Pose of the scan in its levelled frame: upright, ground at z = 0.
    has_ground : bool
        Whether a ground defines the levelled frame. Otherwise the z axis of the scan is taken
        for upwards, and a low quantile of z for the ground.
    occupied_cells : (k, 2) [m]
        Centres of the cells with obstacle points, in the levelled frame.
    occupancy : (k,)
        Fraction of the height bins of each occupied cell that contain a point, in (0, 1].
    free_cells : (m, 2) [m]
        Centres of the cells with ground points only.
    ground_heights : (s, s) [m]
        Mean z of the ground in square cells of the levelled frame, NaN if unobserved. Cell (i, j)
        begins ``i - s / 2`` and ``j - s / 2`` cells from the axis.
    ground_cell_size : float [m]
        Side of those cells.
    """

    level_from_scan: Pose
    has_ground: bool
    occupied_cells: Matrix
    occupancy: Vector
    free_cells: Matrix
    ground_heights: Matrix
    ground_cell_size: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for array in (self.occupied_cells, self.occupancy, self.free_cells, self.ground_heights):
            frozen(array)

    @property
    def radius(self) -> float:
        """Horizontal range that contains 95 % of the occupied cells [m]; 0 without any."""
        if len(self.occupied_cells) == 0:
            return 0.0
        return float(np.quantile(np.hypot(*self.occupied_cells.T), 0.95))


@dataclass(frozen=True, kw_only=True, slots=True)
class BevProjector:
    """Settings of the BEV grid.

    The occupancy of a cell is the fraction of its height bins that contain a point. It
    distinguishes a trunk or a wall from a kerb or a crown. The number of points would mostly
    depend on the range.
    """

    max_range: float = 60.0
    """Maximum horizontal range of the points [m]."""

    cell_size: float = 0.5
    """Side of a cell [m]."""

    bin_height: float = 0.5
    """Height of a height bin [m]."""

    height_bins: int = 8
    """Number of height bins of a cell. Higher points count in the top bin: tree tops differ
    between views."""

    def __post_init__(self) -> None:
        require_positive("cell_size", self.cell_size, unit="m")
        require_positive("bin_height", self.bin_height, unit="m")
        require_count("height_bins", self.height_bins, 1)
        if self.height_bins > _MAX_HEIGHT_BINS:
            raise InvalidInput(
                f"height_bins must be at most {_MAX_HEIGHT_BINS}, got {self.height_bins}"
            )
        require_positive("max_range", self.max_range, unit="m")

    def project(self, cloud: PointCloud, ground: Ground) -> BevGrid:
        """Compute the BEV grid of a cloud from the result of its ground segmentation."""
        level_from_scan = level_pose(cloud, ground)
        ground_cell_size = _CELLS_PER_GROUND_CELL * self.cell_size
        half_side = max(1, round(self.max_range / ground_cell_size)) * _CELLS_PER_GROUND_CELL
        occupied_bins, ground_sums = occupied_height_bins(
            cloud.points,
            ground.height,
            read_only(is_obstacle(cloud, ground)),
            ground.is_ground,
            read_only(np.column_stack([level_from_scan.rotation, level_from_scan.translation])),
            half_side,
            self.cell_size,
            self.bin_height,
            self.height_bins,
        )
        occupied_cells, bin_counts, free_cells, ground_heights = cells_and_ground(
            read_only(occupied_bins), read_only(ground_sums), self.cell_size, _CELLS_PER_GROUND_CELL
        )
        return BevGrid(
            level_from_scan=level_from_scan,
            has_ground=ground.status is not GroundStatus.NONE,
            occupied_cells=occupied_cells,
            occupancy=bin_counts / self.height_bins,
            free_cells=free_cells,
            ground_heights=ground_heights,
            ground_cell_size=ground_cell_size,
        )


def level_pose(cloud: PointCloud, ground: Ground) -> Pose:
    """Return the pose of a cloud in its levelled frame: upright, ground at z = 0.

    Without a ground, z is assumed to point upwards, and the second percentile of z is assumed to
    be the ground.
    """
    if ground.status is GroundStatus.NONE:
        low = float(np.quantile(cloud.points[:, 2], _GROUND_QUANTILE))
        return Pose(np.eye(3), np.array([0.0, 0.0, -low]))
    return Pose(rotation_onto_z(ground.up), np.array([0.0, 0.0, ground.plane[3]]))
