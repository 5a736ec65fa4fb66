"""The height of the ground along every sector: consensus, lending, and knots to read it off."""

import numpy as np

from scanlock.arrays import Mask, Matrix, Vector, frozen, read_only
from scanlock.kernels.ground.model import knots_between_prototypes, seeds_on_base
from scanlock.segmentation.ground.base import BaseSurface
from scanlock.segmentation.ground.gaussian_process import GaussianProcess, Lending
from scanlock.segmentation.ground.plane import BasePlane
from scanlock.segmentation.ground.prototypes import Prototypes

BLUNT_LIMIT = 0.15
"""Where points go on upwards, at walls and bushes, only what lies this close to the model is
ground [m] (ours)."""

_LEAST_STEP = 1e-3
"""Prototypes closer than this in range [m] give no slope between them."""


def modelled_heights(
    prototypes: Prototypes,
    plane: BasePlane,
    base: BaseSurface,
    process: GaussianProcess,
    lending: Lending,
    *,
    seed_height: float,
    seed_range: float,
    variance_limit: float,
    residual_limit: float,
) -> tuple[Mask, Vector]:
    """Return which prototypes are ground, and the modelled height above the plane at each [m].

    NaN where the model is uncertain. Sectors grow alone first, from the seeds near the base
    surface. Where one stays uncertain, behind a car or under dense leaves, the nearest certain
    sectors to its sides lend their heights, with a variance that grows with the distance
    across, and it grows again.
    """
    heights, seeds, caps = seeds_on_base(
        read_only(plane.heights(prototypes.points)),
        base.height,
        prototypes.ranges,
        base.sharp,
        base.on_envelope,
        float(seed_height),
        float(seed_range),
        BLUNT_LIMIT,
    )
    accepted, mean, variance = process.consensus(
        prototypes.starts,
        prototypes.ranges,
        heights,
        seeds,
        variance_limit=variance_limit,
        residual_limit=residual_limit,
        caps=caps,
        lending=lending,
    )
    modelled = mean + base.height
    modelled[variance >= variance_limit] = np.nan
    return accepted, modelled


def knots_of_model(
    prototypes: Prototypes, modelled: Vector, sharp: Mask, height_limit: float
) -> Matrix:
    """Return the knots of all cells for `split_by_knots`: the model is linear between prototypes.

    `modelled` is the (n,) height of the model above the base plane at each prototype, NaN for
    none; in cells that are not `sharp` (n,), ground lies closer to it than `height_limit` [m].
    """
    knots = knots_between_prototypes(
        prototypes.ranges,
        read_only(modelled),
        prototypes.cells,
        prototypes.starts,
        sharp,
        len(prototypes.lowest),
        _LEAST_STEP,
        float(height_limit),
        BLUNT_LIMIT,
    )
    frozen(knots)
    return knots
