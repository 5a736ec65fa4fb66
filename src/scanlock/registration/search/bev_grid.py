"""A scan seen from above, upright: full columns and open ground."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Matrix, Vector, frozen, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import rotation_onto_z
from scanlock.kernels.search.bev_grid import column_slots, columns_and_ground
from scanlock.segmentation.ground.finder import Ground, GroundStatus
from scanlock.segmentation.segmentation import is_obstacle

_LOW_SHARE = 0.02
"""Where no ground was found, this share of the points lies beneath the columns: strays."""

_MOST_SLOTS = 62
"""Slots are the bits of a whole number."""

_GROUND_COLUMNS = 4
"""Columns along a side of the cells in which ground heights are averaged."""


@dataclass(frozen=True, slots=True, eq=False)
class BevGrid:
    """What a scan shows from above, about the z axis through its origin.

    Attributes
    ----------
    level_from_scan : Pose
        Turns the scan upright, with its ground at z = 0.
    has_ground : bool
        Whether a ground says which way is up; else the scan's z axis was taken for it, and a low
        point for the ground.
    columns : (k, 2) [m]
        Middles of the columns in which something stands, level frame.
    fills : (k,)
        Share of the height of each column that is full, above 0 and up to 1.
    open_columns : (m, 2) [m]
        Middles of the columns in which nothing but ground was seen.
    ground : (s, s) [m]
        Mean level z of the ground in square cells, NaN where none was seen; cell (i, j) begins
        ``i - s / 2`` and ``j - s / 2`` cells from the axis.
    ground_cell : float [m]
        Side of those cells.
    """

    level_from_scan: Pose
    has_ground: bool
    columns: Matrix
    fills: Vector
    open_columns: Matrix
    ground: Matrix
    ground_cell: float

    def __post_init__(self) -> None:
        for array in (self.columns, self.fills, self.open_columns, self.ground):
            frozen(array)

    @property
    def reach(self) -> float:
        """Range within which 95 % of the full columns lie [m]; 0 without any."""
        if len(self.columns) == 0:
            return 0.0
        return float(np.quantile(np.hypot(*self.columns.T), 0.95))


@dataclass(frozen=True, kw_only=True, slots=True)
class BevGridder:
    """Settings of the columns.

    How much of a column is full tells a trunk or a wall from a kerb or a crown, whichever part
    of it was seen; the number of points would tell how far away it was.
    """

    max_range: float = 60.0
    """Points beyond this horizontal range are left out [m]."""

    width: float = 0.5
    """Side of a column [m]."""

    slot: float = 0.5
    """Height of a slot [m]; a slot is full when a point lies in it."""

    slots: int = 8
    """Slots of a column. What is higher counts in the last: tops of trees tell little."""

    def __post_init__(self) -> None:
        require_positive("width", self.width, unit="m")
        require_positive("slot", self.slot, unit="m")
        require_count("slots", self.slots, 1)
        if self.slots > _MOST_SLOTS:
            raise InvalidInput(f"slots must be at most {_MOST_SLOTS}, got {self.slots}")
        require_positive("max_range", self.max_range, unit="m")

    def view(self, cloud: PointCloud, ground: Ground) -> BevGrid:
        """Return the view of a cloud whose ground is known, or known to be none."""
        level_from_scan = level_pose(cloud, ground)
        blocks = max(1, round(self.max_range / (_GROUND_COLUMNS * self.width)))
        reach = blocks * _GROUND_COLUMNS
        filled, ground_sums = column_slots(
            cloud.points,
            ground.height,
            read_only(is_obstacle(cloud, ground)),
            ground.is_ground,
            read_only(np.column_stack([level_from_scan.rotation, level_from_scan.translation])),
            reach,
            self.width,
            self.slot,
            self.slots,
        )
        columns, slots, open_columns, ground_heights = columns_and_ground(
            read_only(filled), read_only(ground_sums), self.width, _GROUND_COLUMNS
        )
        return BevGrid(
            level_from_scan,
            ground.status is not GroundStatus.NONE,
            columns,
            slots / self.slots,
            open_columns,
            ground_heights,
            _GROUND_COLUMNS * self.width,
        )


def level_pose(cloud: PointCloud, ground: Ground) -> Pose:
    """Return the pose that turns a cloud upright and puts its ground at z = 0.

    Where no ground was found, z is taken to point upwards, and the lowest points, but for a
    few, to be the ground.
    """
    if ground.status is GroundStatus.NONE:
        low = float(np.quantile(cloud.points[:, 2], _LOW_SHARE))
        return Pose(np.eye(3), np.array([0.0, 0.0, -low]))
    return Pose(rotation_onto_z(ground.up), np.array([0.0, 0.0, ground.plane[3]]))
