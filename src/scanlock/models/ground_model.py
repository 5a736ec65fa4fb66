"""The height of the ground along every sector: prototypes, consensus, lending, knots."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Mask, Points, Vector, frozen, read_only
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.kernels.gaussian_process import lend_heights
from scanlock.kernels.ground import heights_above_knots, lowest_in_cells
from scanlock.models.gaussian_process import GaussianProcess
from scanlock.models.ground_plane import BasePlane

_LENDING_ROUNDS = 2
"""How often sectors without a model of their own take one from their neighbours (ours)."""

_LENDING_REACH = 8
"""Sectors to either side that may lend (ours)."""

_LENDING_GAP = 1.0
"""How much nearer or farther the lender may be [m] (ours)."""

_SIDE_SLOPE = 0.05
"""Standard deviation of the slope of the ground, less the base plane, across sectors (ours)."""

_LEAST_STEP = 1e-3
"""Prototypes closer than this in range [m] give no slope between them."""


@dataclass(frozen=True, slots=True, eq=False)
class Prototypes:
    """The lowest point of each occupied cell, sector by sector and outwards.

    Attributes
    ----------
    points : (n, 3) [m]
    ranges : (n,) [m]
        Horizontal distances from the origin.
    cells : (n,)
        The cell of each prototype, ascending.
    starts : (sectors + 1,)
        Sector s owns the prototypes ``starts[s]:starts[s + 1]``.
    cell_of_point : (m,)
        The cell of every point of the cloud, -1 outside the grid.
    cell_count : int
        Cells of the grid, sectors times bins.
    """

    points: Points
    ranges: Vector
    cells: Labels
    starts: Labels
    cell_of_point: Labels
    cell_count: int

    def __post_init__(self) -> None:
        for array in (self.points, self.ranges, self.cells, self.starts, self.cell_of_point):
            frozen(array)

    @classmethod
    def of(cls, points: Points, grid: PolarGrid, min_points: int) -> "Prototypes":
        """Return the prototypes of the cells with at least `min_points` points."""
        cell_of_point = grid.cells(points)
        bins = grid.bins
        cell_count = int(grid.sectors) * bins
        lowest, count = lowest_in_cells(read_only(points), cell_of_point, cell_count)
        cells = np.flatnonzero(count >= min_points)
        low = points[lowest[cells]]
        return cls(
            points=low,
            ranges=np.hypot(low[:, 0], low[:, 1]),
            cells=cells,
            starts=np.searchsorted(cells, np.arange(grid.sectors + 1) * bins),
            cell_of_point=cell_of_point,
            cell_count=cell_count,
        )

    def sectors_of(self, chosen: Mask) -> int:
        """Return how many sectors hold a chosen prototype."""
        sectors = np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))
        return len(np.unique(sectors[chosen]))


def consensus_with_neighbours(
    prototypes: Prototypes,
    process: GaussianProcess,
    heights: Vector,
    seeds: Mask,
    *,
    variance_limit: float,
    residual_limit: float,
) -> tuple[Mask, Vector]:
    """Return which prototypes are ground, and the modelled height at each; NaN where uncertain.

    Sectors grow alone first. Where one stays uncertain, behind a car or under dense leaves, the
    nearest certain sectors to its sides lend their heights, with a variance that grows with the
    distance across, and it grows again.
    """

    def grow(lent: tuple[Vector, Vector] | None) -> tuple[Mask, Vector, Vector]:
        return process.consensus(
            prototypes.starts,
            prototypes.ranges,
            heights,
            seeds,
            variance_limit=variance_limit,
            residual_limit=residual_limit,
            lent=lent,
        )

    accepted, mean, variance = grow(None)
    lent_height, lent_variance = np.full((2, len(heights)), np.nan)
    for _ in range(_LENDING_ROUNDS):
        offered, worth = lend_heights(
            prototypes.starts,
            prototypes.ranges,
            read_only(mean),
            read_only(variance),
            variance_limit,
            _LENDING_REACH,
            _SIDE_SLOPE,
            _LENDING_GAP,
        )
        taken = np.isfinite(worth)
        if not taken.any():
            break
        lent_height = np.where(taken, offered, lent_height)
        lent_variance = np.where(taken, worth, lent_variance)
        accepted, mean, variance = grow((lent_height, lent_variance))
    mean[variance >= variance_limit] = np.nan
    return accepted, mean


def heights_above_model(
    points: Points, prototypes: Prototypes, plane: BasePlane, modelled: Vector
) -> Vector:
    """Return the (m,) heights [m] of all points above the model, linear between prototypes.

    `modelled` is the (n,) height of the model above `plane` at each prototype, NaN for none.
    """
    with np.errstate(invalid="ignore"):
        slopes = np.diff(modelled) / np.maximum(np.diff(prototypes.ranges), _LEAST_STEP)
    slopes[prototypes.starts[1:-1][_inner(prototypes)] - 1] = np.nan
    slopes = np.nan_to_num(np.concatenate([[0.0], slopes, [0.0]]))
    knots = np.full((4, prototypes.cell_count), np.nan)
    knots[:, prototypes.cells] = prototypes.ranges, modelled, slopes[:-1], slopes[1:]
    frozen(knots)
    return heights_above_knots(
        read_only(points), prototypes.cell_of_point, plane.coefficients, *knots
    )


def _inner(prototypes: Prototypes) -> Mask:
    """Tell which starts of sectors have prototypes before and after them."""
    starts = prototypes.starts[1:-1]
    return (starts > 0) & (starts < len(prototypes.ranges))
