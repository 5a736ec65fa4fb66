"""Range images of scans, and the points that lie in the free space of a scan."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points, Vector, frozen, read_only, short_repr
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import require_at_least, require_count, require_fraction
from scanlock.geometry.pose import Pose
from scanlock.kernels.verification.range_image import (
    build_range_image,
    free_space_violation,
    measured_ranges,
    minimum_filtered,
)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RangeImage:
    """Range image of a scan on the six faces of a cube around the sensor.

    Attributes
    ----------
    ranges : (6, s, s) [m]
        Range of the nearest point in each cell and its neighbours; infinite in cells without
        a point of their own.
    settings : RangeImager
        Settings of the image.
    """

    ranges: NDArray[np.float64]
    settings: "RangeImager"

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.ranges)

    def free_space_violation(
        self, points: Points, image_from_points: Pose, weights: Vector
    ) -> float:
        """Return the weighted fraction of (n, 3) points [m] in the free space of the scan.

        Only visible points count: those in a cell with a range, and not occluded. Occluded
        points would dilute the fraction. NaN with fewer than `min_points` visible points.
        """
        count, visible, violating = self._visibility(points, image_from_points, weights)
        return violating / visible if count >= self.settings.min_points else math.nan

    def measured_ranges(self, points: Points) -> tuple[Vector, Vector]:
        """Return the range of (n, 3) points [m] of the scan's frame, and the range measured there.

        The measured range is infinite in cells without a range.
        """
        identity = Pose.identity()
        return measured_ranges(self.ranges, points, identity.rotation, identity.translation)

    def visible_ratio(self, points: Points) -> float:
        """Return the ratio of (n, 3) points [m] of the scan that are not occluded."""
        count, _, _ = self._visibility(points, Pose.identity(), read_only(np.ones(len(points))))
        return count / len(points)

    def _visibility(
        self, points: Points, image_from_points: Pose, weights: Vector
    ) -> tuple[int, float, float]:
        """Return the number and weight of visible points, and the weight of those in free space."""
        settings = self.settings
        return free_space_violation(
            self.ranges,
            points,
            weights,
            image_from_points.rotation,
            image_from_points.translation,
            settings.margin,
            settings.relative_margin,
            settings.occlusion_margin,
            settings.relative_occlusion_margin,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class RangeImager:
    """Settings of range images; the defaults separate correct from wrong real poses best."""

    cells_per_side: int = 90
    """Number of cells along each side of the six faces; 90 give one cell per degree."""

    neighbourhood: int = 1
    """Number of neighbouring cells on either side whose ranges count for a cell too: an edge off
    by one cell then frees no space."""

    margin: float = 0.2
    """Distance [m] in front of the range of its cell from which a point is in free space."""

    relative_margin: float = 0.01
    """Additional margin as a fraction of the range, since distant cells are wide."""

    occlusion_margin: float = 2.0
    """Distance [m] behind the range of its cell from which a point is occluded."""

    relative_occlusion_margin: float = 0.05
    """Additional occlusion margin as a fraction of the range."""

    min_points: int = 6
    """Minimum number of visible points; with fewer the violation is unknown."""

    min_visible_ratio: float = 0.25
    """Minimum ratio of the points of a sparse scan that are visible from its origin; with fewer
    the origin is not the sensor. Airborne tiles about their middle have 0.05 to 0.4."""

    def __post_init__(self) -> None:
        require_count("cells_per_side", self.cells_per_side, 1)
        require_count("neighbourhood", self.neighbourhood, 0)
        require_at_least("margin", self.margin, 0.0, unit="m")
        require_fraction("relative_margin", self.relative_margin)
        require_at_least("occlusion_margin", self.occlusion_margin, 0.0, unit="m")
        require_at_least("relative_occlusion_margin", self.relative_occlusion_margin, 0.0)
        require_count("min_points", self.min_points, 1)
        require_fraction("min_visible_ratio", self.min_visible_ratio)

    def image(self, cloud: PointCloud) -> RangeImage | None:
        """Return the range image of a cloud; None if its origin is not the sensor."""
        if cloud.origin.any():
            return None
        ranges = build_range_image(cloud.points, self.cells_per_side)
        ranges = minimum_filtered(read_only(ranges), self.neighbourhood)
        image = RangeImage(ranges=read_only(ranges), settings=self)
        # Dense scans are those of a scanner nearly always; the test would take time for each.
        if cloud.is_sparse and image.visible_ratio(cloud.points) < self.min_visible_ratio:
            return None
        return image
