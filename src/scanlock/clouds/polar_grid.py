"""Polar grid of azimuth sectors and range bins: tau of Das et al. 2013, section IV."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen, read_only
from scanlock.errors import InvalidInput, require_at_least, require_count, require_positive
from scanlock.kernels.points.polar import polar_cells

_MAX_BINS = 1e6
"""Largest ratio of `max_range` to `first_width`; more is an error in units and fills the memory."""

_ROUNDING = 1e-9
"""Remainder of a bin at `max_range`, as a fraction of it, that is rounding and makes no bin."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PolarGrid:
    """Polar grid of azimuth sectors and range bins in the xy plane of the sensor.

    The azimuth is measured from the x axis towards the y axis and wraps. Cell
    ``sector * bins + bin`` is bin `bin` of sector `sector`.
    """

    sectors: int = 180
    """Number of equal azimuth sectors, N_s."""

    max_range: float = 80.0
    """Horizontal range at which the grid ends [m]; points at or beyond it have no cell."""

    first_width: float = 0.5
    """Radial width of the innermost bin [m], at least a millionth of `max_range`."""

    growth: float = 1.0
    """Ratio of the widths of consecutive bins; 1 gives the equal bins of the paper.

    The point density decreases with range; growing bins contain enough points at any range. The
    outermost bin is cut off at `max_range`.
    """

    def __post_init__(self) -> None:
        require_count("sectors", self.sectors, 3)
        require_positive("max_range", self.max_range, unit="m")
        require_at_least("first_width", self.first_width, self.max_range / _MAX_BINS, unit="m")
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
        """Return the (n,) cells of (n, 3) points in the sensor frame; -1 outside `max_range`."""
        cells = polar_cells(read_only(points), int(self.sectors), self.edges)
        frozen(cells)
        return cells


@lru_cache(maxsize=16)
def _edges(max_range: float, first_width: float, growth: float) -> Vector:
    """Return `PolarGrid.edges`; cached, since they are used several times for each scan."""
    ratio = max_range / first_width
    excess = growth - 1.0
    # log1p and expm1 are accurate for a growth close to 1 too.
    count = ratio if excess == 0.0 else np.log1p(ratio * excess) / np.log1p(excess)
    steps = np.arange(max(1, math.ceil(count - _ROUNDING)) + 1, dtype=np.float64)
    widths = steps if excess == 0.0 else np.expm1(steps * np.log1p(excess)) / excess
    edges = first_width * widths
    edges[-1] = max_range
    frozen(edges)
    return edges
