"""Ground segmentation as its authors published it, kept for comparison."""

import numpy as np

from scanlock.arrays import Mask, Points, Vector, read_only
from scanlock.kernels.ground import heights_above_knots
from scanlock.models.gaussian_process import GaussianProcess
from scanlock.models.ground_prototypes import Prototypes

_UPWARDS = np.array([0.0, 0.0, 1.0, 0.0])


def published_heights(
    points: Points,
    prototypes: Prototypes,
    process: GaussianProcess,
    *,
    variance_limit: float,
    residual_limit: float,
    seed_height: float,
    seed_range: float,
    seed_count: int | None,
) -> tuple[Vector, int]:
    """Return the (m,) heights [m] above the prototype of each point's cell, and the sectors used.

    NaN in cells whose prototype is not ground. The mean function is zero, the height of the
    sensor; a sector's seeds are its lowest prototypes within `seed_range` [m] and `seed_height`
    [m] of the sensor's height, and a sector with fewer than two has no ground.
    """
    heights = prototypes.points[:, 2]
    seeds = np.zeros(len(heights), dtype=np.bool_)
    for first, last in zip(prototypes.starts[:-1], prototypes.starts[1:], strict=True):
        eligible = first + np.flatnonzero(
            (prototypes.ranges[first:last] < seed_range)
            & (np.abs(heights[first:last]) < seed_height)
        )
        lowest = eligible[np.argsort(heights[eligible], kind="stable")][:seed_count]
        if len(lowest) >= 2:
            seeds[lowest] = True
    accepted, _, _ = process.consensus(
        prototypes.starts,
        prototypes.ranges,
        heights,
        seeds,
        variance_limit=variance_limit,
        residual_limit=residual_limit,
    )
    return _above(points, prototypes, accepted), prototypes.sectors_of(accepted)


def _above(points: Points, prototypes: Prototypes, accepted: Mask) -> Vector:
    knots = np.zeros((len(prototypes.lowest), 4))
    knots[:, 1] = np.nan
    knots[prototypes.cells[accepted], 1] = prototypes.points[accepted, 2]
    return heights_above_knots(
        read_only(points), prototypes.cell_of_point, read_only(_UPWARDS), read_only(knots)
    )
