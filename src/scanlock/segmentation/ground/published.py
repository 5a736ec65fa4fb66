"""Ground segmentation as its authors published it, kept for comparison."""

import numpy as np

from scanlock.arrays import Matrix, frozen, read_only
from scanlock.kernels.ground.model import extent
from scanlock.segmentation.ground.gaussian_process import GaussianProcess
from scanlock.segmentation.ground.prototypes import Prototypes


def published_knots(
    prototypes: Prototypes,
    process: GaussianProcess,
    *,
    variance_limit: float,
    residual_limit: float,
    seed_height: float,
    seed_range: float,
    seed_count: int | None,
    height_limit: float,
) -> tuple[Matrix, int]:
    """Return the knots of all cells, as `split_by_knots` reads them, and the sectors used.

    A level step in each cell whose prototype is ground, no model elsewhere. The mean function is
    zero, the height of the sensor; a sector's seeds are its lowest prototypes within `seed_range`
    [m] and `seed_height` [m] of the sensor's height, and a sector with fewer than two has no
    ground.
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
    knots = np.full((len(prototypes.lowest), 5), height_limit)
    knots[:, :4] = 0.0
    knots[:, 1] = np.nan
    knots[prototypes.cells[accepted], 1] = prototypes.points[accepted, 2]
    frozen(knots)
    _, _, sectors = extent(prototypes.points, read_only(accepted), prototypes.starts)
    return knots, sectors
