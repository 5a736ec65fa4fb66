"""Sectors and range bins around the sensor: tau of Das et al. 2013, section IV."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen, read_only
from scanlock.errors import InvalidInput, require_at_least, require_count, require_positive
from scanlock.kernels.points.polar import polar_cells

_MOST_BINS = 1e6
"""A grid of more innermost widths than this [1] is a mistake in units, and would fill memory."""

_SLIVER = 1e-9
"""Part of a bin [1] that rounding alone may leave at `max_range`; no bin is made of it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PolarGrid:
    """A grid of azimuth sectors and range bins in the xy plane of the sensor.

    Azimuth counts from the x axis towards the y axis and wraps; range does not. Cell
    ``sector * bins + bin`` is numbered outwards first.
    """

    sectors: int = 180
    """Number of equal azimuth sectors, N_s."""

    max_range: float = 80.0
    """Points at this horizontal range or beyond get no cell [m]."""

    first_width: float = 0.5
    """Width of the innermost bin [m], at least a millionth of `max_range`."""

    growth: float = 1.0
    """Each bin is this many times wider than the one before; 1 gives the paper's equal bins.

    Lidar returns thin out with range, so bins that grow keep enough points in each. The
    outermost bin ends at `max_range`, however narrow that leaves it.
    """

    def __post_init__(self) -> None:
        require_count("sectors", self.sectors, 3)
        require_positive("max_range", self.max_range, unit="m")
        require_at_least("first_width", self.first_width, self.max_range / _MOST_BINS, unit="m")
        require_at_least("growth", self.growth, 1.0)
        if self.first_width > self.max_range:
            raise InvalidInput(
                f"first_width must not exceed max_range, got {self.first_width} m > "
                f"{self.max_range} m"
            )

    @property
    def edges(self) -> Vector:
        """The (bins + 1,) ranges [m] between bins, from 0 to `max_range`."""
        return _edges(self.max_range, self.first_width, self.growth)

    @property
    def bins(self) -> int:
        """Number of range bins, N_b."""
        return len(self.edges) - 1

    def cells(self, points: Points) -> Labels:
        """Return the (n,) cell of each (n, 3) sensor-frame point; -1 from `max_range` on."""
        cells = polar_cells(read_only(points), int(self.sectors), self.edges)
        frozen(cells)
        return cells


@lru_cache(maxsize=16)
def _edges(max_range: float, first_width: float, growth: float) -> Vector:
    """Return the edges of a grid, see there; every scan asks for them several times."""
    ratio = max_range / first_width
    excess = growth - 1.0
    # The logarithms keep their digits however little the bins grow.
    count = ratio if excess == 0.0 else np.log1p(ratio * excess) / np.log1p(excess)
    steps = np.arange(max(1, math.ceil(count - _SLIVER)) + 1, dtype=np.float64)
    widths = steps if excess == 0.0 else np.expm1(steps * np.log1p(excess)) / excess
    edges = first_width * widths
    edges[-1] = max_range
    frozen(edges)
    return edges
