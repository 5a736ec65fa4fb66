"""How far a scan saw in every direction, and what that says about places it looked through."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points, Vector, frozen, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import require_at_least, require_count, require_fraction
from scanlock.geometry.pose import Pose
from scanlock.kernels.verification.range_image import (
    free_space_violation,
    nearest_around,
    nearest_ranges,
)


@dataclass(frozen=True, slots=True, eq=False)
class RangeImage:
    """The ranges at which a scan saw something, by direction from the origin of its frame.

    Attributes
    ----------
    nearest : (6, s, s) [m]
        Range of the nearest point in and around each bin of the faces of a cube; infinite where
        the bin itself has none, and nothing is known.
    settings : RangeImager
        What made it, and how it is read.
    """

    nearest: NDArray[np.float64]
    settings: "RangeImager"

    def __post_init__(self) -> None:
        frozen(self.nearest)

    def free_space_violation(
        self, points: Points, image_from_points: Pose, weights: Vector
    ) -> float:
        """Return the share, by weight, of (n, 3) points [m] that lie where the scan looked through.

        Of the points that it would have seen: in a direction where it saw anything, and not
        hidden behind that. What is hidden says nothing, and would water down what is not. NaN
        where fewer than `least_count` points are left.
        """
        settings = self.settings
        count, known, before = free_space_violation(
            self.nearest,
            points,
            weights,
            image_from_points.rotation,
            image_from_points.translation,
            settings.margin,
            settings.share,
            settings.hidden_margin,
            settings.hidden_share,
        )
        return before / known if count >= settings.least_count else math.nan


@dataclass(frozen=True, kw_only=True, slots=True)
class RangeImager:
    """Settings of the image; the defaults part right poses from wrong ones best on real scans."""

    side: int = 90
    """Bins along a side of each of the six faces: one for each degree."""

    reach: int = 1
    """A bin counts with its neighbours this far: an edge that moved by a bin frees no space."""

    margin: float = 0.2
    """How much nearer than the nearest point a place must be to have been looked through [m]."""

    share: float = 0.01
    """And by what share of the range: bins are wide far away."""

    hidden_margin: float = 2.0
    """How far behind the nearest point a place is hidden [m]."""

    hidden_share: float = 0.05
    """And by what share of the range."""

    least_count: int = 6
    """Fewer points than these that could be seen say nothing."""

    def __post_init__(self) -> None:
        require_count("side", self.side, 1)
        require_count("reach", self.reach, 0)
        require_at_least("margin", self.margin, 0.0, unit="m")
        require_fraction("share", self.share)
        require_at_least("hidden_margin", self.hidden_margin, 0.0, unit="m")
        require_at_least("hidden_share", self.hidden_share, 0.0)
        require_count("least_count", self.least_count, 1)

    def image(self, cloud: PointCloud) -> RangeImage | None:
        """Return the image of a cloud about its sensor; None where its origin is no sensor."""
        if cloud.origin.any():
            return None
        ranges = nearest_ranges(cloud.points, self.side)
        return RangeImage(read_only(nearest_around(read_only(ranges), self.reach)), self)
