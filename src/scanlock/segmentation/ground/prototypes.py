"""Prototypes: the lowest point of each polar cell, the input of all ground models."""

from dataclasses import dataclass

from scanlock.arrays import Labels, Points, Vector, frozen, read_only
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.kernels.ground.point_passes import gather_prototypes, lowest_points


@dataclass(frozen=True, slots=True, eq=False)
class Prototypes:
    """Lowest point of each occupied cell, ordered by sector, then by range.

    Attributes
    ----------
    points : (n, 3) [m]
        Prototypes.
    ranges : (n,) [m]
        Horizontal distances of the prototypes from the origin.
    cells : (n,)
        Cell of each prototype, ascending.
    starts : (sectors + 1,)
        Sector s has the prototypes ``starts[s]:starts[s + 1]``.
    cell_of_point : (m,)
        Cell of every point of the cloud, -1 outside the grid.
    lowest : (sectors * bins,)
        Row in the cloud of the prototype of every cell, -1 for none.
    bins : int
        Number of range bins of the grid.
    """

    points: Points
    ranges: Vector
    cells: Labels
    starts: Labels
    cell_of_point: Labels
    lowest: Labels
    bins: int

    def __post_init__(self) -> None:
        for array in (self.points, self.ranges, self.cells, self.starts):
            frozen(array)
        for array in (self.cell_of_point, self.lowest):
            frozen(array)

    @classmethod
    def of(cls, points: Points, grid: PolarGrid, min_points: int) -> "Prototypes":
        """Find the prototypes of the cells with at least `min_points` of (m, 3) points [m]."""
        sectors, bins = int(grid.sectors), grid.bins
        cell_of_point = grid.cells(points)
        lowest = lowest_points(read_only(points), cell_of_point, sectors * bins, int(min_points))
        frozen(lowest)
        low, ranges, cells, starts = gather_prototypes(read_only(points), lowest, sectors)
        return cls(low, ranges, cells, starts, cell_of_point, lowest, bins)
