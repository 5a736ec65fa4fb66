"""The height of the ground along every sector: consensus, lending, and knots to read it off."""

import numpy as np

from scanlock.arrays import Mask, Matrix, Vector, frozen
from scanlock.models.gaussian_process import GaussianProcess, Lending
from scanlock.models.ground_base import BaseSurface
from scanlock.models.ground_plane import BasePlane
from scanlock.models.ground_prototypes import Prototypes

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
    known = np.isfinite(base.height)
    heights = plane.heights(prototypes.points) - base.height
    firm = base.sharp & base.on_envelope
    with np.errstate(invalid="ignore"):
        seeds = (np.abs(heights) < seed_height) & (prototypes.ranges < seed_range)
        seeds &= firm | (base.on_envelope & (np.abs(heights) < BLUNT_LIMIT))

    accepted, mean, variance = process.consensus(
        prototypes.starts,
        prototypes.ranges,
        heights,
        seeds,
        variance_limit=variance_limit,
        residual_limit=residual_limit,
        caps=np.where(base.sharp, np.inf, BLUNT_LIMIT),
        lending=lending,
    )
    mean[(variance >= variance_limit) | ~known] = np.nan
    return accepted, mean + base.height


def knots_of_model(
    prototypes: Prototypes, modelled: Vector, sharp: Mask, height_limit: float
) -> Matrix:
    """Return the knots of all cells for `split_by_knots`: the model is linear between prototypes.

    `modelled` is the (n,) height of the model above the base plane at each prototype, NaN for
    none; in cells that are not `sharp` (n,), ground lies closer to it than `height_limit` [m].
    """
    with np.errstate(invalid="ignore"):
        slopes = np.diff(modelled) / np.maximum(np.diff(prototypes.ranges), _LEAST_STEP)
    slopes[prototypes.starts[1:-1][_inner(prototypes)] - 1] = np.nan
    slopes = np.nan_to_num(np.concatenate([[0.0], slopes, [0.0]]))
    limits = np.where(sharp, height_limit, min(height_limit, BLUNT_LIMIT))
    knots = np.full((len(prototypes.lowest), 5), np.nan)
    knots[prototypes.cells] = np.stack(
        [prototypes.ranges, modelled, slopes[:-1], slopes[1:], limits], axis=1
    )
    frozen(knots)
    return knots


def _inner(prototypes: Prototypes) -> Mask:
    """Tell which starts of sectors have prototypes before and after them."""
    starts = prototypes.starts[1:-1]
    return (starts > 0) & (starts < len(prototypes.ranges))
