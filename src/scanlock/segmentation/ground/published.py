"""Steps of ground segmentation as published, section IV of Das et al. 2013."""

import numpy as np

from scanlock.arrays import Mask, Matrix, frozen
from scanlock.segmentation.ground.prototypes import Prototypes


def lowest_seeds(
    prototypes: Prototypes, *, max_height: float, max_range: float, max_count: int | None
) -> Mask:
    """Select the seeds of every sector: its lowest prototypes near the sensor.

    Parameters
    ----------
    prototypes : Prototypes
        Lowest points of the cells.
    max_height : float [m]
        Largest distance of a seed from the height of the sensor.
    max_range : float [m]
        Largest range of a seed.
    max_count : int or None
        Maximum number of seeds of a sector; None for all.

    Returns
    -------
    (n,)
        Seeds; none in sectors with fewer than two.
    """
    heights = prototypes.points[:, 2]
    seeds = np.zeros(len(heights), dtype=np.bool_)
    for first, last in zip(prototypes.starts[:-1], prototypes.starts[1:], strict=True):
        eligible = first + np.flatnonzero(
            (prototypes.ranges[first:last] < max_range) & (np.abs(heights[first:last]) < max_height)
        )
        lowest = eligible[np.argsort(heights[eligible], kind="stable")][:max_count]
        if len(lowest) >= 2:
            seeds[lowest] = True
    return seeds


def knots_of_prototypes(prototypes: Prototypes, accepted: Mask, height_threshold: float) -> Matrix:
    """Return the knots of a model that is constant in each cell with a ground prototype.

    Parameters
    ----------
    prototypes : Prototypes
        Lowest points of the cells.
    accepted : (n,)
        Prototypes that are ground.
    height_threshold : float [m]
        Height threshold of ground.

    Returns
    -------
    (cells, 5)
        Knot of each cell, as `classify_points` expects it; without a model in the other cells.
    """
    knots = np.full((len(prototypes.lowest), 5), height_threshold)
    knots[:, :4] = 0.0
    knots[:, 1] = np.nan
    knots[prototypes.cells[accepted], 1] = prototypes.points[accepted, 2]
    frozen(knots)
    return knots
