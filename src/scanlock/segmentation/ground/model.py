"""Ground model of every sector: seeds, growth by INSAC, and knots for the heights of points."""

import numpy as np

from scanlock.arrays import Mask, Matrix, Vector, frozen, read_only
from scanlock.kernels.ground.model import knots_between_prototypes, select_seeds
from scanlock.segmentation.ground.base import BaseSurface
from scanlock.segmentation.ground.gaussian_process import Insac
from scanlock.segmentation.ground.plane import BasePlane
from scanlock.segmentation.ground.prototypes import Prototypes

BLUNT_THRESHOLD = 0.15
"""Height threshold of ground in cells with upright structure, such as walls [m] (ours)."""

_MIN_STEP = 1e-3
"""Minimum difference in range [m] of prototypes that define a slope."""


def grow_ground(
    prototypes: Prototypes,
    plane: BasePlane,
    base: BaseSurface,
    insac: Insac,
    *,
    max_seed_height: float,
    max_seed_range: float,
) -> tuple[Mask, Vector]:
    """Grow the ground model of every sector from its seeds near the base surface.

    Parameters
    ----------
    prototypes : Prototypes
        Lowest points of the cells.
    plane : BasePlane
        Plane that heights are measured from.
    base : BaseSurface
        Mean function of the Gaussian processes.
    insac : Insac
        Settings of the growth.
    max_seed_height : float [m]
        Largest distance of a seed from the base surface.
    max_seed_range : float [m]
        Largest range of a seed.

    Returns
    -------
    accepted : (n,)
        Prototypes that are ground.
    modelled : (n,) [m]
        Modelled height above the base plane at each prototype; NaN where the model is uncertain.
    """
    heights, seeds, max_residuals = select_seeds(
        read_only(plane.heights(prototypes.points)),
        base.height,
        prototypes.ranges,
        base.sharp,
        base.on_envelope,
        float(max_seed_height),
        float(max_seed_range),
        BLUNT_THRESHOLD,
    )
    accepted, mean, variance = insac.grow(
        prototypes.starts, prototypes.ranges, heights, seeds, max_residuals
    )
    modelled = mean + base.height
    modelled[variance >= insac.variance_threshold] = np.nan
    return accepted, modelled


def knots_of_model(
    prototypes: Prototypes, modelled: Vector, sharp: Mask, height_threshold: float
) -> Matrix:
    """Return the knots of a model that is linear in range between prototypes.

    Parameters
    ----------
    prototypes : Prototypes
        Lowest points of the cells.
    modelled : (n,) [m]
        Modelled height above the base plane at each prototype; NaN for none.
    sharp : (n,)
        Cells without upright structure; see `BaseSurface`.
    height_threshold : float [m]
        Height threshold of ground in sharp cells; `BLUNT_THRESHOLD` limits that of the others.

    Returns
    -------
    (cells, 5)
        Knot of each cell, as `classify_points` expects it.
    """
    knots = knots_between_prototypes(
        prototypes.ranges,
        read_only(modelled),
        prototypes.cells,
        prototypes.starts,
        sharp,
        len(prototypes.lowest),
        _MIN_STEP,
        float(height_threshold),
        BLUNT_THRESHOLD,
    )
    frozen(knots)
    return knots
