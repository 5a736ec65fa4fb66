"""Sectors and range bins around the sensor: tau of Das et al. 2013, section IV."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen
from scanlock.errors import InvalidInput, require_at_least, require_positive
from scanlock.kernels.polar import polar_cells


@dataclass(frozen=True, kw_only=True, slots=True)
class PolarGrid:
    """A grid of azimuth sectors and range bins in the xy plane of the sensor.

    Azimuth wraps; range does not. Cell ``sector * bins + bin`` is numbered outwards first.
    """

    sectors: int = 180
    """Number of equal azimuth sectors, N_s."""

    max_range: float = 80.0
    """Points beyond this horizontal range get no cell [m]."""

    first_width: float = 0.5
    """Width of the innermost bin [m]."""

    growth: float = 1.0
    """Each bin is this many times wider than the one before; 1 gives the paper's equal bins.

    Lidar returns thin out with range, so bins that grow keep enough points in each.
    """

    def __post_init__(self) -> None:
        require_at_least("sectors", self.sectors, 3)
        require_positive("max_range", self.max_range, unit="m")
        require_positive("first_width", self.first_width, unit="m")
        require_at_least("growth", self.growth, 1.0)
        if self.first_width > self.max_range:
            raise InvalidInput(
                f"first_width must not exceed max_range, got {self.first_width} m > "
                f"{self.max_range} m"
            )

    @property
    def edges(self) -> Vector:
        """The (bins + 1,) ranges [m] between bins, from 0 to at least `max_range`."""
        if self.growth == 1.0:
            count = int(np.ceil(self.max_range / self.first_width - 1e-9))
            edges = self.first_width * np.arange(count + 1, dtype=np.float64)
        else:
            ratio = self.max_range * (self.growth - 1.0) / self.first_width
            count = int(np.ceil(np.log1p(ratio) / np.log(self.growth) - 1e-9))
            powers = self.growth ** np.arange(count + 1, dtype=np.float64)
            edges = self.first_width * (powers - 1.0) / (self.growth - 1.0)
        frozen(edges)
        return edges

    @property
    def bins(self) -> int:
        """Number of range bins, N_b."""
        return len(self.edges) - 1

    def cells(self, points: Points) -> Labels:
        """Return the (n,) cell of each (n, 3) sensor-frame point; -1 beyond `max_range`."""
        cells = polar_cells(points, self.sectors, self.edges)
        frozen(cells)
        return cells
